//! Numbers as bytes.

use crate::Changes;

/// Which byte of a number comes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Endian {
    /// The lowest.
    Little,
    /// The highest.
    Big,
}

/// A scalar as it stands in a record.
pub(crate) trait Number: Copy {
    /// From exactly as many bytes as the type has; 0 from any other number of bytes.
    fn read(bytes: &[u8], endian: Endian) -> Self;
    /// Exact but for 64-bit integers beyond 2^53.
    fn as_f64(self) -> f64;
    /// Rounded to the nearest; `None` outside the range; NaN is 0.
    fn as_u8(self) -> Option<u8>;
    /// Rounded to the nearest; `None` outside the range; NaN is 0.
    fn as_u16(self) -> Option<u16>;
}

macro_rules! read_in_either_order {
    () => {
        #[inline]
        fn read(bytes: &[u8], endian: Endian) -> Self {
            let bytes = bytes.try_into().unwrap_or_default();
            match endian {
                Endian::Little => Self::from_le_bytes(bytes),
                Endian::Big => Self::from_be_bytes(bytes),
            }
        }
    };
}

macro_rules! integers {
    ($($ty:ty)*) => {$(
        impl Number for $ty {
            read_in_either_order!();

            #[inline]
            fn as_f64(self) -> f64 {
                self as f64
            }

            #[inline]
            fn as_u8(self) -> Option<u8> {
                u8::try_from(self).ok()
            }

            #[inline]
            #[allow(irrefutable_let_patterns, clippy::unnecessary_fallible_conversions)]
            fn as_u16(self) -> Option<u16> {
                u16::try_from(self).ok()
            }
        }
    )*};
}

macro_rules! floats {
    ($($ty:ty)*) => {$(
        impl Number for $ty {
            read_in_either_order!();

            #[inline]
            fn as_f64(self) -> f64 {
                f64::from(self)
            }

            #[inline]
            fn as_u8(self) -> Option<u8> {
                rounded(f64::from(self), 255.0).map(|v| v as u8)
            }

            #[inline]
            fn as_u16(self) -> Option<u16> {
                rounded(f64::from(self), 65535.0).map(|v| v as u16)
            }
        }
    )*};
}

integers!(i8 u8 i16 u16 i32 u32 i64 u64);
floats!(f32 f64);

/// `v` + ½, to be truncated, if it rounds to 0..=`max`. (`f64::round` is a call where SSE 4.1 cannot be assumed.)
#[inline]
fn rounded(v: f64, max: f64) -> Option<f64> {
    if v.is_nan() {
        return Some(0.0);
    }
    (v >= -0.5 && v < max + 0.5).then_some(v + 0.5)
}

/// 0–1 to 0–65535, rounded; a thousandth beyond either end is cut off, more is `None`; NaN is 0.
#[inline]
pub(crate) fn unit_to_u16(v: f64) -> Option<u16> {
    // NaN becomes 0 in the cast
    (v.is_nan() || (-0.001..=1.001).contains(&v)).then(|| (v.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16)
}

/// Counts what becomes of a float that is stored as an integer. `is_unit`: by [`unit_to_u16`], where only the ends of
/// the range change it.
pub(crate) fn count_change(v: f64, is_unit: bool, changes: &mut Changes) {
    if v.is_nan() {
        changes.not_finite += 1;
    } else if is_unit {
        if !(0.0..=1.0).contains(&v) {
            changes.clamp(v);
        }
    } else if (v as i64) as f64 != v {
        changes.round(v);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_byte_orders_are_read() {
        assert_eq!(u16::read(&[1, 2], Endian::Little), 0x0201);
        assert_eq!(u16::read(&[1, 2], Endian::Big), 0x0102);
        assert_eq!(f32::read(&[0x3f, 0x80, 0, 0], Endian::Big), 1.0);
    }

    #[test]
    fn what_an_integer_cannot_hold_is_counted() {
        let count = |values: &[f64], is_unit| {
            let mut changes = Changes::default();
            values.iter().for_each(|v| count_change(*v, is_unit, &mut changes));
            (changes.not_finite, changes.rounded, changes.clamped)
        };
        assert_eq!(count(&[0.5, 1.0, f64::NAN, 1.0005], true), (1, 0, 1));
        assert_eq!(count(&[0.5, 1.0, f64::NAN, 255.0], false), (1, 1, 0));
    }

    #[test]
    fn colours_round_and_refuse_what_is_outside() {
        assert_eq!((0.5f32.as_u8(), 254.6f64.as_u8(), 255.5f64.as_u8()), (Some(1), Some(255), None));
        assert_eq!(((-1i8).as_u16(), f64::NAN.as_u16(), 70_000u32.as_u16()), (None, Some(0), None));
        assert_eq!((unit_to_u16(0.0), unit_to_u16(0.5), unit_to_u16(1.0)), (Some(0), Some(32768), Some(65535)));
        assert_eq!((unit_to_u16(1.0005), unit_to_u16(-0.0005), unit_to_u16(f64::NAN)), (Some(65535), Some(0), Some(0)));
        assert_eq!((unit_to_u16(1.5), unit_to_u16(-0.1)), (None, None));
    }
}
