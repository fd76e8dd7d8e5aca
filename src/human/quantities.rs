//! Sizes, counts, rates and times as people read them.

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

/// A number for people: at most nine decimals, without trailing zeros. JSON has all of them.
pub(crate) fn number(v: f64) -> String {
    if v != 0.0 && !(1e-6..1e15).contains(&v.abs()) {
        return format!("{v:e}");
    }
    let fixed = format!("{v:.9}");
    let short = fixed.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}

/// A number that is not below `v`, with three digits.
pub(crate) fn at_most(v: f64) -> String {
    let text = format!("{v:.2e}");
    let near: f64 = text.parse().unwrap_or(v);
    // a step of the third digit
    let step = text.split_once('e').map_or(0.0, |(_, exponent)| format!("1e{exponent}").parse().unwrap_or(0.0) / 100.0);
    let up = if near < v { near + step } else { near };
    number(format!("{up:.2e}").parse().unwrap_or(up))
}

/// A number to the nearest, with three digits.
pub(crate) fn three_digits(v: f64) -> String {
    format!("{v:.2e}").parse().map_or_else(|_| v.to_string(), number)
}

/// Numbers side by side.
pub(crate) fn numbers(values: &[f64]) -> String {
    values.iter().map(|v| number(*v)).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

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
        assert_eq!(
            [0.0, 0.001, 0.000_001_907_348_6, 0.051_512_3, 0.999_1, 1234.5, 9.999e-9].map(at_most).join(" "),
            "0 0.001 0.00000191 0.0516 1 1240 1e-8"
        );
        assert_eq!(rate(12_345_678.0), "12.3 M points/s");
        assert_eq!(numbers(&[848_935.200_000_000_1, -0.0, 1e-7, 0.001]), "848935.2 0 1e-7 0.001");
        assert_eq!(numbers(&[f64::MAX, f64::NAN, 100.0]), "1.7976931348623157e308 NaN 100");
    }
}
