//! Units of coordinates that a user can name.

/// A unit of length of the coordinates of a scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Units {
    /// 0.001 m.
    Millimetre,
    /// 0.01 m.
    Centimetre,
    /// 1 m.
    Metre,
    /// The international foot, 0.3048 m.
    Foot,
    /// The foot of surveys in the United States, 1200/3937 m.
    UsSurveyFoot,
}

impl Units {
    /// Its length.
    pub const fn metres(self) -> f64 {
        match self {
            Self::Millimetre => 0.001,
            Self::Centimetre => 0.01,
            Self::Metre => 1.0,
            Self::Foot => 0.3048,
            Self::UsSurveyFoot => 1200.0 / 3937.0,
        }
    }

    /// The usual abbreviation: "mm", "cm", "m", "ft", "us-ft".
    pub const fn name(self) -> &'static str {
        match self {
            Self::Millimetre => "mm",
            Self::Centimetre => "cm",
            Self::Metre => "m",
            Self::Foot => "ft",
            Self::UsSurveyFoot => "us-ft",
        }
    }
}

/// Units that differ by less than this part of them are the same, written with few digits: the two feet differ by 2e-6.
const SAME: f64 = 1e-7;

/// True if two units, in metres, are the same.
pub(crate) fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= SAME * b
}

/// A unit of `metres`, for people.
pub(crate) fn name(metres: f64) -> String {
    const NAMES: [(f64, &str); 5] = [
        (1.0, "metres"),
        (0.3048, "feet"),
        (1200.0 / 3937.0, "US survey feet"),
        (0.001, "millimetres"),
        (0.01, "centimetres"),
    ];
    let known = NAMES.iter().find(|(of, _)| is_same(metres, *of));
    known.map_or_else(|| format!("units of {metres} m"), |(_, name)| (*name).to_owned())
}

/// How many of `to` make one of `from`, both in metres; exactly 1 where they are the same.
pub(crate) fn ratio(from: f64, to: f64) -> f64 {
    if is_same(from, to) { 1.0 } else { from / to }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_two_feet_are_not_the_same_and_few_digits_suffice() {
        assert_eq!(ratio(0.3048006, Units::UsSurveyFoot.metres()), 1.0);
        assert!(!is_same(Units::Foot.metres(), Units::UsSurveyFoot.metres()));
        assert_eq!((name(0.3048006), name(0.5)), ("US survey feet".to_owned(), "units of 0.5 m".to_owned()));
    }
}
