//! Units of coordinates.

use std::f64::consts::PI;
use std::fmt;

/// Sizes of the usual units that differ by less than this part of them are the same unit, written with few digits. The
/// feet of the world differ from these by more.
const SAME: f64 = 1e-7;
/// The same for the names of all others.
const SAME_NAME: f64 = 1e-9;

/// A unit of coordinates, by its size.
///
/// ```
/// use pointmill_format::Unit;
///
/// assert_eq!(Unit::length(0.3048006), Unit::US_SURVEY_FOOT);
/// assert_eq!(Unit::FOOT.metres(), Some(0.3048));
/// assert_eq!(Unit::DEGREE.to_string(), "degree");
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Unit {
    /// A length; one has that many metres, > 0.
    Length(f64),
    /// An angle; one has that many radians, > 0.
    Angle(f64),
    /// Declared in a way that gives no size.
    Unknown,
}

/// EPSG's units of length: code, metres, name. The first three are the usual ones.
#[rustfmt::skip]
const LENGTHS: [Named; 47] = [
    (9001, 1.0, "metre"), (9002, 0.3048, "foot"), (9003, 1200.0 / 3937.0, "US survey foot"),
    (1025, 0.001, "millimetre"), (1033, 0.01, "centimetre"), (9036, 1000.0, "kilometre"),
    (9005, 0.304_797_265_4, "Clarke's foot"), (9014, 1.8288, "fathom"), (9030, 1852.0, "nautical mile"),
    (9031, 1.000_013_596_5, "German legal metre"), (9033, 79_200.0 / 3937.0, "US survey chain"),
    (9034, 792.0 / 3937.0, "US survey link"), (9035, 6_336_000.0 / 3937.0, "US survey mile"),
    (9037, 0.914_391_796_2, "Clarke's yard"), (9038, 20.116_619_516_4, "Clarke's chain"),
    (9039, 0.201_166_195_164, "Clarke's link"), (9040, 0.914_398_414_616_029, "British yard (Sears 1922)"),
    (9041, 0.304_799_471_538_676, "British foot (Sears 1922)"),
    (9042, 20.116_765_121_552_6, "British chain (Sears 1922)"),
    (9043, 0.201_167_651_215_526, "British link (Sears 1922)"),
    (9050, 0.914_399_2, "British yard (Benoit 1895 A)"), (9051, 0.304_799_733_333_333, "British foot (Benoit 1895 A)"),
    (9052, 20.116_782_4, "British chain (Benoit 1895 A)"), (9053, 0.201_167_824, "British link (Benoit 1895 A)"),
    (9060, 0.914_399_204_289_812, "British yard (Benoit 1895 B)"),
    (9061, 0.304_799_734_763_271, "British foot (Benoit 1895 B)"),
    (9062, 20.116_782_494_375_9, "British chain (Benoit 1895 B)"),
    (9063, 0.201_167_824_943_759, "British link (Benoit 1895 B)"),
    (9070, 0.304_800_833_333_333, "British foot (1865)"), (9080, 0.304_799_510_248_147, "Indian foot"),
    (9081, 0.304_798_41, "Indian foot (1937)"), (9082, 0.304_799_6, "Indian foot (1962)"),
    (9083, 0.304_799_5, "Indian foot (1975)"), (9084, 0.914_398_530_744_441, "Indian yard"),
    (9085, 0.914_395_23, "Indian yard (1937)"), (9086, 0.914_398_8, "Indian yard (1962)"),
    (9087, 0.914_398_5, "Indian yard (1975)"), (9093, 1609.344, "mile"),
    (9094, 0.304_799_710_181_509, "Gold Coast foot"), (9095, 0.304_800_749_1, "British foot (1936)"),
    (9096, 0.9144, "yard"), (9097, 20.1168, "chain"), (9098, 0.201_168, "link"),
    (9099, 0.914_398, "British yard (Sears 1922 truncated)"),
    (9300, 0.304_799_333_333_333, "British foot (Sears 1922 truncated)"),
    (9301, 20.116_756, "British chain (Sears 1922 truncated)"),
    (9302, 0.201_167_56, "British link (Sears 1922 truncated)"),
];

/// The usual ones of [`LENGTHS`].
const USUAL: usize = 3;

/// EPSG's units of angle whose values are plain numbers: code, radians, name.
const ANGLES: [Named; 9] = [
    (9102, PI / 180.0, "degree"),
    (9122, PI / 180.0, "degree"),
    (9101, 1.0, "radian"),
    (9103, PI / 10_800.0, "arc-minute"),
    (9104, PI / 648_000.0, "arc-second"),
    (9105, PI / 200.0, "grad"),
    (9106, PI / 200.0, "gon"),
    (9109, 1e-6, "microradian"),
    (9114, PI / 3200.0, "mil"),
];

impl Unit {
    /// 1 m.
    pub const METRE: Self = Self::Length(LENGTHS[0].1);
    /// The international foot, 0.3048 m.
    pub const FOOT: Self = Self::Length(LENGTHS[1].1);
    /// The foot of surveys in the United States, 1200/3937 m: longer by two millionths, which is a metre in 500 km.
    pub const US_SURVEY_FOOT: Self = Self::Length(LENGTHS[2].1);
    /// 1°.
    pub const DEGREE: Self = Self::Angle(ANGLES[0].1);

    /// The unit of that many metres; a usual one if they are nearly its. [`Self::Unknown`] unless finite and > 0.
    pub fn length(metres: f64) -> Self {
        if !(metres.is_finite() && metres > 0.0) {
            return Self::Unknown;
        }
        let usual = nearest(&LENGTHS[..USUAL], metres, SAME).or_else(|| nearest(&LENGTHS, metres, SAME_NAME));
        Self::Length(usual.map_or(metres, |(_, size, _)| *size))
    }

    /// The unit of that many radians; a known one if they are nearly its. [`Self::Unknown`] unless finite and > 0.
    pub fn angle(radians: f64) -> Self {
        if !(radians.is_finite() && radians > 0.0) {
            return Self::Unknown;
        }
        Self::Angle(nearest(&ANGLES, radians, SAME).map_or(radians, |(_, size, _)| *size))
    }

    /// The unit with that EPSG code; [`Self::Unknown`] if it is none, or one that numbers alone do not carry (degrees,
    /// minutes and seconds as the digits of one number).
    pub fn from_epsg(code: u16) -> Self {
        let size = |table: &[Named]| table.iter().find(|(c, ..)| *c == code).map(|(_, size, _)| *size);
        match (size(&LENGTHS), size(&ANGLES)) {
            (Some(metres), _) => Self::Length(metres),
            (None, Some(radians)) => Self::Angle(radians),
            (None, None) => Self::Unknown,
        }
    }

    /// The EPSG code of the unit; `None` if it has none.
    pub fn epsg(self) -> Option<u16> {
        let (table, size) = match self {
            Self::Length(metres) => (&LENGTHS[..], metres),
            Self::Angle(radians) => (&ANGLES[..], radians),
            Self::Unknown => return None,
        };
        table.iter().find(|(_, of, _)| *of == size).map(|(code, ..)| *code)
    }

    /// Metres of a length; `None` for others.
    pub const fn metres(self) -> Option<f64> {
        match self {
            Self::Length(metres) => Some(metres),
            Self::Angle(_) | Self::Unknown => None,
        }
    }

    /// True for degrees and other angles: coordinates in them are geographic.
    pub const fn is_angle(self) -> bool {
        matches!(self, Self::Angle(_))
    }
}

/// A unit of code, size, name.
type Named = (u16, f64, &'static str);

/// The first unit whose size differs from `size` by at most `part` of its own.
fn nearest(table: &'static [Named], size: f64, part: f64) -> Option<&'static Named> {
    table.iter().find(|(_, of, _)| (size - of).abs() <= part * of)
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (table, size, base) = match *self {
            Self::Length(metres) => (&LENGTHS[..], metres, "m"),
            Self::Angle(radians) => (&ANGLES[..], radians, "rad"),
            Self::Unknown => return f.write_str("unknown unit"),
        };
        match nearest(table, size, SAME_NAME) {
            Some((.., name)) => f.write_str(name),
            None => write!(f, "unit of {size} {base}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_feet_of_the_world_are_told_apart_and_few_digits_suffice() {
        assert_eq!(Unit::length(0.304800609601219), Unit::US_SURVEY_FOOT);
        assert_eq!(Unit::length(0.3048006), Unit::US_SURVEY_FOOT);
        assert_eq!(Unit::length(0.3048), Unit::FOOT);
        assert_eq!(Unit::length(0.3048007491).to_string(), "British foot (1936)");
        assert_eq!(Unit::from_epsg(9070).to_string(), "British foot (1865)");
        assert_eq!(Unit::length(0.333).to_string(), "unit of 0.333 m");
        for (code, metres, name) in LENGTHS {
            let unit = Unit::from_epsg(code);
            assert_eq!((unit, unit.to_string().as_str()), (Unit::length(metres), name), "{code}");
            assert_eq!(unit.epsg(), Some(code));
        }
    }

    #[test]
    fn angles_are_geographic_and_what_is_no_number_is_unknown() {
        assert_eq!(Unit::angle(0.0174532925), Unit::DEGREE);
        assert!(Unit::from_epsg(9122).is_angle() && !Unit::METRE.is_angle());
        assert_eq!(Unit::from_epsg(9105).to_string(), "grad");
        for unit in [Unit::from_epsg(9110), Unit::from_epsg(0), Unit::length(0.0), Unit::angle(f64::NAN)] {
            assert_eq!((unit, unit.metres()), (Unit::Unknown, None));
        }
    }
}
