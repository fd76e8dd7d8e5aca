//! The fields of a prototype: what a record consists of and how its bits are stored.

use ::e57::{Record, RecordDataType, RecordName};

use super::xml::TEXT_MARK;

/// How the values of a field are stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Encoding {
    /// IEEE 754 single precision.
    Single,
    /// IEEE 754 double precision.
    Double,
    /// `value - min` in as many bits as `max - min` needs, none if they are equal.
    Integer { min: i64, max: i64 },
    /// The same, meaning `value · scale + offset`.
    Scaled { min: i64, max: i64, scale: f64, offset: f64 },
    /// Text of varying length, which is not read.
    Text,
}

impl Encoding {
    /// Bits a record: 0 to 64; 0 for constants, and for text.
    pub(super) fn bits(self) -> u32 {
        match self {
            Self::Single => 32,
            Self::Double => 64,
            Self::Integer { min, max } | Self::Scaled { min, max, .. } => 64 - max.abs_diff(min).leading_zeros(),
            Self::Text => 0,
        }
    }
}

/// One field.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) name: RecordName,
    pub(super) encoding: Encoding,
    /// The range that the prototype gives, as meant values; `None` if it gives none or that of its whole type.
    pub(super) range: Option<(f64, f64)>,
}

impl Field {
    /// The field that the `e57` crate describes.
    pub(super) fn new(record: &Record) -> Self {
        let encoding = match record.data_type {
            RecordDataType::Single { .. } => Encoding::Single,
            RecordDataType::Double { .. } => Encoding::Double,
            RecordDataType::Integer { min: TEXT_MARK, max: TEXT_MARK } => Encoding::Text,
            RecordDataType::Integer { min, max } => Encoding::Integer { min, max },
            RecordDataType::ScaledInteger { min, max, scale, offset } => Encoding::Scaled { min, max, scale, offset },
        };
        let pair = match record.data_type {
            RecordDataType::Single { min, max } => min.map(f64::from).zip(max.map(f64::from)),
            RecordDataType::Double { min, max } => min.zip(max),
            RecordDataType::Integer { min, max } => Some((min as f64, max as f64)),
            RecordDataType::ScaledInteger { min, max, scale, offset } => {
                let (a, b) = (min as f64 * scale + offset, max as f64 * scale + offset);
                Some((a.min(b), a.max(b)))
            }
        };
        let is_whole_type = match record.data_type {
            RecordDataType::Single { .. } | RecordDataType::Double { .. } => pair.is_some_and(|(_, b)| b >= 3e38),
            RecordDataType::Integer { min, max } | RecordDataType::ScaledInteger { min, max, .. } => {
                max.abs_diff(min) > u64::from(u32::MAX)
            }
        };
        let range = pair.filter(|(a, b)| a < b && a.is_finite() && b.is_finite() && !is_whole_type);
        Self { name: record.name.clone(), encoding, range }
    }

    /// The name as it stands in the file, without the prefix of an extension.
    pub(super) fn tag(&self) -> &str {
        match &self.name {
            RecordName::Unknown { name, .. } => name,
            RecordName::RowIndex => "rowIndex",
            RecordName::ColumnIndex => "columnIndex",
            RecordName::ReturnCount => "returnCount",
            RecordName::ReturnIndex => "returnIndex",
            RecordName::TimeStamp => "timeStamp",
            RecordName::CartesianX => "cartesianX",
            RecordName::CartesianY => "cartesianY",
            RecordName::CartesianZ => "cartesianZ",
            RecordName::SphericalRange => "sphericalRange",
            RecordName::SphericalAzimuth => "sphericalAzimuth",
            RecordName::SphericalElevation => "sphericalElevation",
            RecordName::ColorRed => "colorRed",
            RecordName::ColorGreen => "colorGreen",
            RecordName::ColorBlue => "colorBlue",
            RecordName::Intensity => "intensity",
            _ => "invalid state",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_are_those_that_the_range_needs() {
        let bits = |min, max| Encoding::Integer { min, max }.bits();
        assert_eq!([bits(0, 0), bits(7, 8), bits(0, 2), bits(-128, 127), bits(0, 256)], [0, 1, 2, 8, 9]);
        assert_eq!(bits(i64::MIN, i64::MAX), 64);
    }

    #[test]
    fn a_range_counts_only_if_it_says_something() {
        let range = |data_type| Field::new(&Record { name: RecordName::Intensity, data_type }).range;
        assert_eq!(range(RecordDataType::U8), Some((0.0, 255.0)));
        assert_eq!(range(RecordDataType::UNIT_F32), Some((0.0, 1.0)));
        assert_eq!(range(RecordDataType::Integer { min: i64::MIN, max: i64::MAX }), None);
        assert_eq!(range(RecordDataType::Integer { min: 3, max: 3 }), None);
        assert_eq!(range(RecordDataType::Single { min: Some(f32::MIN), max: Some(f32::MAX) }), None);
        let scaled = RecordDataType::ScaledInteger { min: -10, max: 10, scale: -0.5, offset: 1.0 };
        assert_eq!(range(scaled), Some((-4.0, 6.0)));
    }
}
