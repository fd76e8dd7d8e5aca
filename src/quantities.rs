//! Sizes, boxes and counts as people type and read them.

use pointmill_format::Aabb;

/// Parses `1GiB`, `512MB`, `1.5g`, `4096`: bytes. `K`, `M`, `G`, `T` alone and with `iB` are powers of 1024, with `B`
/// powers of 1000.
pub(crate) fn parse_bytes(text: &str) -> Result<u64, String> {
    let advice = || format!("`{text}` is no size; write it like 2GiB, 512MiB or 1500MB");
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
    // 2^60: no machine has it, and arithmetic on it does not overflow.
    if bytes >= 1.0 && bytes < (1u64 << 60) as f64 { Ok(bytes as u64) } else { Err(advice()) }
}

/// Parses `xmin,ymin,zmin..xmax,ymax,zmax`, world coordinates.
pub(crate) fn parse_bounds(text: &str) -> Result<Aabb, String> {
    let advice = || format!("`{text}` is no box; write it as xmin,ymin,zmin..xmax,ymax,zmax");
    let (min, max) = text.split_once("..").ok_or_else(advice)?;
    let corner = |text: &str| {
        let numbers: Option<Vec<f64>> =
            text.split(',').map(|n| n.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
        <[f64; 3]>::try_from(numbers?).ok()
    };
    let bounds = Aabb { min: corner(min).ok_or_else(advice)?, max: corner(max).ok_or_else(advice)? };
    if bounds.is_empty() {
        return Err(format!("`{text}` is empty: a minimum lies above its maximum"));
    }
    Ok(bounds)
}

/// Bytes for people: `1.25 GiB`.
pub(crate) fn bytes(count: u64) -> String {
    const UNITS: [&str; 5] = ["KiB", "MiB", "GiB", "TiB", "PiB"];
    if count < 1024 {
        return format!("{count} B");
    }
    let mut value = count as f64 / 1024.0;
    let mut unit = 0;
    while value >= 1023.995 && unit + 1 < UNITS.len() {
        value /= 1024.0;
        unit += 1;
    }
    format!("{value:.2} {}", UNITS[unit])
}

/// A count with thousands separators: `20,000,000`.
pub(crate) fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

/// A count with its noun: `1 point`, `2 points`.
pub(crate) fn plural(n: u64, noun: &str) -> String {
    format!("{} {noun}{}", count(n), if n == 1 { "" } else { "s" })
}

/// A rate for people: `12.3 M points/s`.
pub(crate) fn rate(points_per_second: f64) -> String {
    match points_per_second {
        r if !r.is_finite() || r <= 0.0 => "–".to_owned(),
        r if r >= 1e6 => format!("{:.1} M points/s", r / 1e6),
        r if r >= 1e3 => format!("{:.1} k points/s", r / 1e3),
        r => format!("{r:.0} points/s"),
    }
}

/// Seconds for people: `0.42 s`, `12 s`, `3 min 05 s`, `2 h 10 min`.
pub(crate) fn seconds(s: f64) -> String {
    let whole = s.max(0.0).round() as u64;
    match whole {
        _ if s < 10.0 => format!("{:.2} s", s.max(0.0)),
        0..60 => format!("{whole} s"),
        60..3600 => format!("{} min {:02} s", whole / 60, whole % 60),
        _ => format!("{} h {:02} min", whole / 3600, whole % 3600 / 60),
    }
}

/// A number for people: at most nine decimals, none that say nothing. JSON has all of them.
pub(crate) fn number(v: f64) -> String {
    if v != 0.0 && !(1e-6..1e15).contains(&v.abs()) {
        return format!("{v:e}");
    }
    let fixed = format!("{v:.9}");
    let short = fixed.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

/// Numbers side by side.
pub(crate) fn numbers(values: &[f64]) -> String {
    values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

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

    #[test]
    fn quantities_read_well() {
        assert_eq!(count(1_234_567), "1,234,567");
        assert_eq!((count(0), count(999)), ("0".into(), "999".into()));
        assert_eq!(plural(1, "point"), "1 point");
        assert_eq!(
            (bytes(1023), bytes(1 << 20), bytes(5 << 29)),
            ("1023 B".into(), "1.00 MiB".into(), "2.50 GiB".into())
        );
        assert_eq!(bytes((1 << 30) - 1), "1.00 GiB");
        assert_eq!((seconds(0.416), seconds(185.0)), ("0.42 s".into(), "3 min 05 s".into()));
        assert_eq!(rate(12_345_678.0), "12.3 M points/s");
        assert_eq!(numbers(&[848_935.200_000_000_1, -0.0, 1e-7, 0.001]), "848935.2 0 1e-7 0.001");
        assert_eq!(numbers(&[f64::MAX, f64::NAN, 100.0]), "1.7976931348623157e308 NaN 100");
    }
}
