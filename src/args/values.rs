//! Values of options: parsed here and checked against each other in the commands.

use std::num::NonZero;
use std::ops::RangeInclusive;

use pointmill_converter::{LengthUnit, PositionPrecision};
use pointmill_format::{Aabb, Lattice};
use pointmill_render::Size;

/// More than the cores of any machine with one memory; a thread needs tens of MiB.
const MAX_THREADS: u64 = 1024;

/// A whole number within a range, written with digits alone.
pub(super) fn whole<T: TryFrom<u64>>(
    range: RangeInclusive<u64>,
) -> impl Fn(&str) -> Result<T, String> + Clone + Send + Sync {
    move |text| {
        let number = text.parse::<u64>().ok().filter(|n| range.contains(n) && !text.starts_with('+'));
        number.and_then(|n| T::try_from(n).ok()).ok_or_else(|| match (range.start(), range.end()) {
            (least, &u64::MAX) => format!("expected a whole number from {least} on"),
            (least, most) => format!("expected a whole number from {least} to {most}"),
        })
    }
}

/// A number of threads.
pub(super) fn parse_threads(text: &str) -> Result<NonZero<u16>, String> {
    let threads: u16 = whole(1..=MAX_THREADS)(text)?;
    NonZero::new(threads).ok_or_else(String::new) // the range begins at 1
}

/// A class; scans of some kinds have negative ones.
pub(super) fn parse_class(text: &str) -> Result<i64, String> {
    text.trim().parse().map_err(|_| "expected whole numbers separated by commas, such as 2,6".to_owned())
}

/// A character that may stand between two numbers.
pub(super) fn parse_separator(text: &str) -> Result<char, String> {
    let advice = || Err("expected one character, or tab, space, comma, semicolon".to_owned());
    let mut chars = text.chars();
    match (text, chars.next(), chars.next()) {
        ("tab" | "\\t", ..) => Ok('\t'),
        ("space" | "blank", ..) => Ok(' '),
        ("comma", ..) => Ok(','),
        ("semicolon", ..) => Ok(';'),
        (_, Some(c), None) if c.is_ascii_alphanumeric() || matches!(c, '+' | '-' | '.') => {
            Err("this can be a part of a number and separates none".to_owned())
        }
        (_, Some(c @ ('\t' | ' '..='~')), None) => Ok(c),
        (_, Some(_), None) => Err("expected a character of ASCII".to_owned()),
        _ => advice(),
    }
}

/// `--planes`, parsed, in planes of ten bits; `None` is `auto`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Planes(pub(crate) Option<u8>);

pub(super) fn parse_planes(text: &str) -> Result<Planes, String> {
    match text {
        "auto" => Ok(Planes(None)),
        "10" => Ok(Planes(Some(1))),
        "20" => Ok(Planes(Some(2))),
        "30" => Ok(Planes(Some(3))),
        _ => Err("expected 10, 20, 30 or auto".to_owned()),
    }
}

/// Whether a run leaves what another one can go on with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum CheckpointArg {
    Auto,
    Always,
    Never,
    /// Always, each time that so many points were read.
    Every(u64),
}

pub(super) fn parse_checkpoint(text: &str) -> Result<CheckpointArg, String> {
    match text {
        "auto" => Ok(CheckpointArg::Auto),
        "always" => Ok(CheckpointArg::Always),
        "never" => Ok(CheckpointArg::Never),
        _ => whole(1..=u64::MAX)(text)
            .map(CheckpointArg::Every)
            .map_err(|_| "expected auto, always, never, or a number of points".to_owned()),
    }
}

/// The default level of Zstandard.
pub(super) const ZSTD_LEVEL: i32 = 3;

pub(super) fn parse_compress(text: &str) -> Result<i32, String> {
    match text.split_once(':').unwrap_or((text, "")) {
        ("zstd", "") => Ok(ZSTD_LEVEL),
        ("zstd", level) => whole(1..=19)(level).map_err(|_| "expected a level from 1 to 19, as in zstd:3".to_owned()),
        _ => Err("expected zstd or zstd:LEVEL".to_owned()),
    }
}

/// `--scale`, parsed; `None` is `auto`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scale(pub(crate) Option<f64>);

pub(super) fn parse_scale(text: &str) -> Result<Scale, String> {
    match (text, text.parse::<f64>()) {
        ("auto", _) => Ok(Scale(None)),
        (_, Ok(step)) if Lattice::is_sound_step(step) => Ok(Scale(Some(step))),
        (_, Ok(step)) if step.is_finite() && step > 0.0 => Err(format!(
            "no coordinate has such a step; expected {:e} to {:e}, or auto",
            Lattice::FINEST_STEP,
            Lattice::COARSEST_STEP
        )),
        _ => Err("expected a number above 0, for example 0.001, or auto".to_owned()),
    }
}

/// `--precision`: a length such as `1mm`, or a number in units of the coordinates.
pub(super) fn parse_precision(text: &str) -> Result<PositionPrecision, String> {
    let advice =
        || "expected a length above 0 such as 1mm, 0.5cm or 0.02ft, or a number in units of the CRS".to_owned();
    let text = text.trim();
    let is_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-' | '+');
    // an exponent is a part of the number, the m of mm is not
    let digits = text.find(|c: char| !is_number(c)).unwrap_or(text.len());
    let exponent = text[digits..].strip_prefix(['e', 'E']).filter(|rest| rest.starts_with(is_number));
    let end = exponent
        .map_or(digits, |rest| text.len() - rest.len() + rest.find(|c: char| !is_number(c)).unwrap_or(rest.len()));
    let length = text[..end].parse::<f64>().ok().filter(|n| n.is_finite() && *n > 0.0).ok_or_else(advice)?;
    let unit = match text[end..].trim_start().to_ascii_lowercase().as_str() {
        "" => LengthUnit::Coordinates,
        "µm" | "μm" => LengthUnit::Micrometre,
        name => LengthUnit::NAMED.into_iter().find(|unit| unit.name() == name).ok_or_else(advice)?,
    };
    let metres = length * unit.metres().unwrap_or(1.0);
    if (Lattice::FINEST_STEP..=Lattice::COARSEST_STEP).contains(&metres) {
        return Ok(PositionPrecision { length, unit });
    }
    Err(format!("no coordinates are that exact; expected {:e} to {:e}", Lattice::FINEST_STEP, Lattice::COARSEST_STEP))
}

/// A distance.
pub(super) fn parse_spacing(text: &str) -> Result<f64, String> {
    let spacing = text.parse::<f64>().ok().filter(|spacing| spacing.is_finite() && *spacing > 0.0);
    spacing.ok_or_else(|| "expected a number above 0, for example 0.05".to_owned())
}

/// A default value in the help.
pub(super) fn or_auto(value: Option<impl ToString>) -> String {
    value.map_or_else(|| "auto".to_owned(), |value| value.to_string())
}

/// `--attributes`, parsed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Attributes {
    All,
    Scene,
    List(Vec<String>),
}

pub(super) fn parse_attributes(text: &str) -> Result<Attributes, String> {
    let names: Vec<String> = text.split(',').map(|name| name.trim().to_owned()).collect();
    match text {
        "all" => Ok(Attributes::All),
        "scene" => Ok(Attributes::Scene),
        "" => Err("expected all, scene, or names such as intensity,rgb".to_owned()),
        _ if names.iter().any(String::is_empty) => Err("an attribute has no name between its commas".to_owned()),
        _ => Ok(Attributes::List(names)),
    }
}

/// Parses `1GiB`, `512MB`, `1.5g`, `4096`: bytes. `K`, `M`, `G`, `T` alone and with `iB` are powers of 1024, with `B`
/// powers of 1000.
pub(super) fn parse_bytes(text: &str) -> Result<u64, String> {
    let advice = || "expected a size such as 2GiB, 512MiB or 1500MB".to_owned();
    let text = text.trim();
    let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
    let number: f64 = text[..digits].parse().map_err(|_| advice())?;
    let unit = text[digits..].trim_start().to_ascii_lowercase();
    let (power, base) = match unit.as_str() {
        "" | "b" => (0, 1024.0),
        "k" | "kib" => (1, 1024.0),
        "m" | "mib" => (2, 1024.0),
        "g" | "gib" => (3, 1024.0),
        "t" | "tib" => (4, 1024.0),
        "kb" => (1, 1000.0_f64),
        "mb" => (2, 1000.0),
        "gb" => (3, 1000.0),
        "tb" => (4, 1000.0),
        _ => return Err(advice()),
    };
    let bytes = number * base.powi(power);
    // Below 2^60, so that arithmetic on sizes does not overflow.
    if bytes >= 1.0 && bytes < (1u64 << 60) as f64 { Ok(bytes as u64) } else { Err(advice()) }
}

/// Parses a number of points: digits, and `k`, `M` or `G` for thousands, millions or thousands of millions.
pub(super) fn parse_points(text: &str) -> Result<u64, String> {
    let unit = [('k', 1_000), ('K', 1_000), ('M', 1_000_000), ('m', 1_000_000), ('G', 1_000_000_000)];
    let unit = unit.into_iter().find(|(letter, _)| text.ends_with(*letter));
    let (digits, factor) =
        unit.map_or((text, 1), |(letter, factor)| (text.strip_suffix(letter).unwrap_or(text), factor));
    let number = digits.parse::<f64>().ok().filter(|_| digits.bytes().all(|b| b.is_ascii_digit() || b == b'.'));
    let points = number.map(|n| n * factor as f64).filter(|n| (1.0..=1e18).contains(n));
    points.map(|n| n as u64).ok_or_else(|| "expected a number of points, such as 500000, 500k or 5M".to_owned())
}

/// Parses the size of a picture, such as `1920x1080`.
pub(super) fn parse_size(text: &str) -> Result<Size, String> {
    let side = |text: &str| text.parse::<u32>().ok().filter(|_| text.bytes().all(|b| b.is_ascii_digit()));
    let sides = text.split_once(['x', 'X']).and_then(|(width, height)| Some((side(width)?, side(height)?)));
    let (width, height) = sides.ok_or_else(|| "expected pixels, as in 1920x1080".to_owned())?;
    Size::new(width, height).map_err(|e| e.to_string())
}

/// Parses `xmin,ymin,zmin..xmax,ymax,zmax`, world coordinates.
pub(super) fn parse_bounds(text: &str) -> Result<Aabb, String> {
    let advice = || "expected two corners, xmin,ymin,zmin..xmax,ymax,zmax".to_owned();
    let (min, max) = text.split_once("..").ok_or_else(advice)?;
    let corner = |text: &str| {
        let numbers: Option<Vec<f64>> =
            text.split(',').map(|n| n.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
        <[f64; 3]>::try_from(numbers?).ok()
    };
    let bounds = Aabb { min: corner(min).ok_or_else(advice)?, max: corner(max).ok_or_else(advice)? };
    if bounds.is_empty() {
        return Err("the box is empty: a minimum is above its maximum".to_owned());
    }
    Ok(bounds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_counted_in_thousands_and_millions() {
        let values = ["1", "500k", "5M", "2.5M", "1G"].map(|text| parse_points(text).unwrap());
        assert_eq!(values, [1, 500_000, 5_000_000, 2_500_000, 1_000_000_000]);
        for text in ["", "0", "-1", "M", "1e6", "5MM", "1 M", "nan", "99999999999999999999"] {
            assert!(parse_points(text).is_err(), "{text}");
        }
    }

    #[test]
    fn numbers_are_digits_within_a_range() {
        assert_eq!(
            (whole::<u8>(0..=11)("11"), whole::<u64>(0..=u64::MAX)("18446744073709551615")),
            (Ok(11), Ok(u64::MAX))
        );
        for text in ["", "x", "1.5", "+1", "-1", "0", "1025", "99999999999999999999999", "1_000", " 1"] {
            assert_eq!(parse_threads(text), Err("expected a whole number from 1 to 1024".to_owned()), "{text}");
        }
        assert_eq!(parse_threads("1024").map(u16::from), Ok(1024));
        assert_eq!((parse_class("-1"), parse_class(" 6")), (Ok(-1), Ok(6)));
        assert!(["", "x", "2.5", "99999999999999999999"].iter().all(|text| parse_class(text).is_err()));
    }

    #[test]
    fn separators_are_no_part_of_a_number() {
        let table = [("tab", '\t'), ("\\t", '\t'), ("space", ' '), (";", ';'), ("|", '|'), ("/", '/')];
        assert!(table.iter().all(|(text, c)| parse_separator(text) == Ok(*c)));
        for text in ["", "ab", "5", "-", ".", "e", "→", "é", "\n", "\u{1b}"] {
            assert!(parse_separator(text).is_err(), "{text:?}");
        }
    }

    #[test]
    fn steps_are_lengths_that_coordinates_can_have() {
        let step = |text: &str| parse_scale(text).map(|s| s.0);
        assert_eq!((step("auto"), step("0.001"), step("1e-15")), (Ok(None), Ok(Some(0.001)), Ok(Some(1e-15))));
        for text in ["0", "-1", "nan", "inf", "5e-310", "1e-300", "1e300", "x", ""] {
            assert!(step(text).is_err(), "{text}");
        }
    }

    #[test]
    fn precisions_are_lengths_or_plain_numbers() {
        let parsed = |text| parse_precision(text).map(|p| (p.length, p.unit));
        assert_eq!(parsed("1mm"), Ok((1.0, LengthUnit::Millimetre)));
        assert_eq!(parsed("0.5 cm"), Ok((0.5, LengthUnit::Centimetre)));
        assert_eq!(parsed("2e2µm"), Ok((200.0, LengthUnit::Micrometre)));
        assert_eq!(parsed("5E-2M"), Ok((0.05, LengthUnit::Metre)));
        assert_eq!(parsed("0.001km"), Ok((0.001, LengthUnit::Kilometre)));
        assert_eq!(parsed(".02us-ft"), Ok((0.02, LengthUnit::UsSurveyFoot)));
        assert_eq!(parsed("1e-7"), Ok((1e-7, LengthUnit::Coordinates)));
        for text in ["", "mm", "0mm", "-1mm", "1inch", "1 m m", "nan", "inf", "1e", "1e-400", "1e300km", "auto", "é"] {
            assert!(parse_precision(text).is_err(), "{text}");
        }
    }

    #[test]
    fn sizes_take_binary_and_decimal_units() {
        let table = [
            ("1GiB", 1 << 30),
            ("1g", 1 << 30),
            ("512MiB", 512 << 20),
            ("512MB", 512_000_000),
            ("1.5 GiB", 3 << 29),
            ("4096", 4096),
        ];
        for (text, bytes) in table {
            assert_eq!(parse_bytes(text), Ok(bytes), "{text}");
        }
        for text in ["", "GiB", "-1GiB", "1XB", "0", "1e99TB", "..", "9999999999TiB"] {
            assert!(parse_bytes(text).is_err(), "{text}");
        }
    }

    #[test]
    fn bounds_are_two_corners() {
        let b = parse_bounds("-1,2,3.5..4,5e3,6").unwrap();
        assert_eq!((b.min, b.max), ([-1.0, 2.0, 3.5], [4.0, 5000.0, 6.0]));
        for text in ["1,2,3", "1,2..3,4", "1,2,3..0,5,6", "nan,0,0..1,1,1", "0,0,0..inf,1,1"] {
            assert!(parse_bounds(text).is_err(), "{text}");
        }
    }
}
