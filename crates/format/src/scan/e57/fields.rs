//! The fields of a prototype: what a record consists of and how its bits are stored.

use super::xml::element::Element;
use super::xml::numbers::Numbers;
use crate::Lattice;

/// The finest step of an angle: 64 bits of a turn are 3e-19, and doubles hold it well.
const FINEST_ANGLE: f64 = 1e-30;

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

/// What a field is.
#[derive(Debug, Clone, PartialEq, Eq)]
#[allow(missing_docs)] // the names are those of the standard
pub(super) enum Name {
    CartesianX,
    CartesianY,
    CartesianZ,
    CartesianInvalidState,
    SphericalRange,
    SphericalAzimuth,
    SphericalElevation,
    SphericalInvalidState,
    Intensity,
    IsIntensityInvalid,
    ColorRed,
    ColorGreen,
    ColorBlue,
    IsColorInvalid,
    RowIndex,
    ColumnIndex,
    ReturnCount,
    ReturnIndex,
    TimeStamp,
    IsTimeStampInvalid,
    /// Of an extension, or of none that is known.
    Other {
        prefix: String,
        tag: String,
    },
}

const NAMES: [(Name, &str); 20] = [
    (Name::CartesianX, "cartesianX"),
    (Name::CartesianY, "cartesianY"),
    (Name::CartesianZ, "cartesianZ"),
    (Name::CartesianInvalidState, "cartesianInvalidState"),
    (Name::SphericalRange, "sphericalRange"),
    (Name::SphericalAzimuth, "sphericalAzimuth"),
    (Name::SphericalElevation, "sphericalElevation"),
    (Name::SphericalInvalidState, "sphericalInvalidState"),
    (Name::Intensity, "intensity"),
    (Name::IsIntensityInvalid, "isIntensityInvalid"),
    (Name::ColorRed, "colorRed"),
    (Name::ColorGreen, "colorGreen"),
    (Name::ColorBlue, "colorBlue"),
    (Name::IsColorInvalid, "isColorInvalid"),
    (Name::RowIndex, "rowIndex"),
    (Name::ColumnIndex, "columnIndex"),
    (Name::ReturnCount, "returnCount"),
    (Name::ReturnIndex, "returnIndex"),
    (Name::TimeStamp, "timeStamp"),
    (Name::IsTimeStampInvalid, "isTimeStampInvalid"),
];

/// One field.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) name: Name,
    pub(super) encoding: Encoding,
    /// The range that the prototype gives, as meant values; `None` if it gives none or that of its whole type.
    pub(super) range: Option<(f64, f64)>,
}

impl Field {
    /// The field that an element of a prototype describes.
    ///
    /// # Errors
    /// A type that has no bits of fixed length, or an empty range.
    pub(super) fn read(element: &Element<'_>, numbers: &Numbers) -> Result<Self, String> {
        let tag = element.name;
        let known = NAMES.iter().find(|(_, name)| element.prefix.is_empty() && *name == tag);
        let name = match known {
            Some((name, _)) => name.clone(),
            None => Name::Other { prefix: element.prefix.to_owned(), tag: tag.to_owned() },
        };
        let float = |name: &str| element.attribute(name).and_then(|text| numbers.float(text));
        let ends = || -> Result<(i64, i64), String> {
            let min = numbers.attribute(element, "minimum")?.unwrap_or(i64::MIN);
            let max = numbers.attribute(element, "maximum")?.unwrap_or(i64::MAX);
            if max < min { Err(format!("{tag} ranges from {min} to {max}")) } else { Ok((min, max)) }
        };
        let encoding = match (element.attribute("type").unwrap_or_default(), element.attribute("precision")) {
            ("Float", None | Some("double")) => Encoding::Double,
            ("Float", Some("single")) => Encoding::Single,
            ("Float", Some(other)) => return Err(format!("{tag} is of the precision {}", quoted(other))),
            ("Integer", _) => ends().map(|(min, max)| Encoding::Integer { min, max })?,
            ("ScaledInteger", _) => {
                let (min, max) = ends()?;
                let (scale, offset) = (float("scale").unwrap_or(1.0), float("offset").unwrap_or(0.0));
                Encoding::Scaled { min, max, scale, offset }
            }
            ("String", _) => Encoding::Text,
            (other, _) => return Err(format!("{tag} is of type {}", quoted(other))),
        };
        Ok(Self::new(name, encoding, float("minimum").zip(float("maximum"))))
    }

    /// `declared`: the range of a floating-point field.
    fn new(name: Name, encoding: Encoding, declared: Option<(f64, f64)>) -> Self {
        let pair = match encoding {
            // single precision is written with few digits
            Encoding::Single => declared.map(|(a, b)| (f64::from(a as f32), f64::from(b as f32))),
            Encoding::Double => declared,
            Encoding::Integer { min, max } => Some((min as f64, max as f64)),
            Encoding::Scaled { min, max, scale, offset } => {
                let (a, b) = (min as f64 * scale + offset, max as f64 * scale + offset);
                Some((a.min(b), a.max(b)))
            }
            Encoding::Text => None,
        };
        let is_whole_type = match encoding {
            Encoding::Single | Encoding::Double | Encoding::Text => pair.is_some_and(|(_, b)| b >= 3e38),
            Encoding::Integer { min, max } | Encoding::Scaled { min, max, .. } => {
                max.abs_diff(min) > u64::from(u32::MAX)
            }
        };
        let range = pair.filter(|(a, b)| a < b && a.is_finite() && b.is_finite() && !is_whole_type);
        Self { name, encoding, range }
    }

    /// What is wrong with the scale or offset of a field of positions, if they place no point. `is_length`: it is not an
    /// angle, which 64 bits may hold in finer steps than a length.
    pub(super) fn misplaced(&self, is_length: bool) -> Option<String> {
        let Encoding::Scaled { min, max, scale, offset } = self.encoding else { return None };
        let least = if is_length { Lattice::FINEST_STEP } else { FINEST_ANGLE };
        let is_sound_step = (least..=Lattice::FARTHEST).contains(&scale.abs()) || (scale == 0.0 && min == max);
        let ends = self.range.map_or([offset; 2], |(a, b)| [a, b]);
        if is_sound_step && ends.into_iter().all(Lattice::is_sound_offset) {
            return None;
        }
        Some(format!("{} has the scale {scale:e} and the offset {offset:e}, which place no point", self.tag()))
    }

    /// The name as it stands in the file, without the prefix of an extension.
    pub(super) fn tag(&self) -> &str {
        match &self.name {
            Name::Other { tag, .. } => tag,
            known => NAMES.iter().find(|(name, _)| name == known).map_or("", |(_, tag)| tag),
        }
    }
}

/// The start of a text, for a message.
fn quoted(text: &str) -> String {
    format!("{:?}", text.chars().take(40).collect::<String>())
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
    fn scales_that_place_no_point_are_named() {
        let misplaced = |scale, offset, is_length| {
            Field::new(Name::CartesianX, Encoding::Scaled { min: -9, max: 9, scale, offset }, None).misplaced(is_length)
        };
        for (scale, offset) in [(0.001, 0.0), (-0.001, 5e6), (1e-15, 0.0), (1.0, -1e30)] {
            assert_eq!(misplaced(scale, offset, true), None);
        }
        for scale in [0.0, 5e-310, 1e-16, 1e300, f64::INFINITY, f64::NAN, -5e-310] {
            assert!(
                misplaced(scale, 0.0, true).is_some_and(|what| what.starts_with("cartesianX has the scale")),
                "{scale}"
            );
        }
        assert!(misplaced(1.0, 2e30, true).is_some() && misplaced(1.0, f64::NAN, true).is_some());
        assert!(misplaced(1e-19, 0.0, false).is_none() && misplaced(5e-310, 0.0, false).is_some());
        let constant = Encoding::Scaled { min: 3, max: 3, scale: 0.0, offset: 7.0 };
        assert_eq!(Field::new(Name::CartesianZ, constant, None).misplaced(true), None);
    }

    #[test]
    fn a_range_counts_only_if_it_says_something() {
        let range = |encoding, declared| Field::new(Name::Intensity, encoding, declared).range;
        let integer = |min, max| range(Encoding::Integer { min, max }, None);
        assert_eq!(integer(0, 255), Some((0.0, 255.0)));
        assert_eq!(range(Encoding::Single, Some((0.0, 1.0))), Some((0.0, 1.0)));
        assert_eq!([integer(i64::MIN, i64::MAX), integer(3, 3)], [None; 2]);
        assert_eq!(range(Encoding::Single, Some((f64::from(f32::MIN), f64::from(f32::MAX)))), None);
        assert_eq!(range(Encoding::Double, None), None);
        let scaled = Encoding::Scaled { min: -10, max: 10, scale: -0.5, offset: 1.0 };
        assert_eq!(range(scaled, None), Some((-4.0, 6.0)));
    }
}
