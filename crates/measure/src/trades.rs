//! What each option buys and costs, as sentences.

use crate::axis::Axis;
use crate::result::{Row, Trade};

/// The trades of rows: each value against the first of its axis.
pub(crate) fn trades(rows: &[Row]) -> Vec<Trade> {
    let mut trades = Vec::new();
    let mut outputs: Vec<&str> = rows.iter().map(|row| row.output.as_str()).collect();
    outputs.dedup();
    for output in outputs {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.output == output && row.failed.is_none()).collect();
        for axis in Axis::ALL.into_iter().filter(|axis| *axis != Axis::Output) {
            let mut values: Vec<&String> = rows.iter().filter_map(|row| row.values.get(axis.name())).collect();
            let mut seen = std::collections::HashSet::new();
            values.retain(|value| seen.insert(*value));
            for to in values.iter().skip(1) {
                trades.extend(trade(output, axis, values[0], to, &rows));
            }
        }
    }
    trades
}

fn trade(output: &str, axis: Axis, from: &str, to: &str, rows: &[&Row]) -> Option<Trade> {
    let is_pair = |a: &Row, b: &Row| {
        Axis::ALL.iter().filter(|other| **other != axis).all(|o| a.values.get(o.name()) == b.values.get(o.name()))
    };
    let with = |value: &str| -> Vec<&Row> {
        rows.iter().copied().filter(|row| row.values.get(axis.name()).is_some_and(|v| v == value)).collect()
    };
    let pairs: Vec<(&Row, &Row)> = with(from)
        .into_iter()
        .flat_map(|a| with(to).into_iter().filter(|b| is_pair(a, b)).map(move |b| (a, b)))
        .collect();
    if pairs.is_empty() {
        return None;
    }
    let ratio = |figure: fn(&Row) -> Option<f64>| {
        // nothing against nothing is no change
        let quotient = |a: f64, b: f64| if a == b { 1.0 } else { b / a };
        let logs = pairs.iter().map(|(a, b)| Some(quotient(figure(a)?, figure(b)?).ln()));
        let logs: Vec<f64> = logs.collect::<Option<_>>()?;
        let mean = (logs.iter().sum::<f64>() / logs.len() as f64).exp();
        mean.is_finite().then_some(mean)
    };
    let largest = |side: fn(&(&Row, &Row)) -> Option<f64>| pairs.iter().filter_map(side).reduce(f64::max);
    // errors of depths do not compare with those of colours
    let has_alike = pairs.iter().all(|(a, b)| a.is_shaded_by_depth == b.is_shaded_by_depth);
    let pictures = if has_alike { ratio(Row::picture_error) } else { None };
    let mut trade = Trade {
        output: output.to_owned(),
        axis: axis.name(),
        from: from.to_owned(),
        to: to.to_owned(),
        ratios: [ratio(Row::seconds_per_million), ratio(Row::bytes_per_point), pictures],
        position: [largest(|pair| pair.0.position_error()), largest(|pair| pair.1.position_error())],
        sentence: String::new(),
    };
    trade.sentence = sentence(&trade);
    Some(trade)
}

fn sentence(trade: &Trade) -> String {
    let Trade { output, axis, from, to, ratios: [time, bytes, picture], position, .. } = trade;
    let mut changes = Vec::new();
    let mut unknown = Vec::new();
    for (ratio, of) in [
        (*time, "processor time"),
        (*bytes, "disk and download"),
        (*picture, "difference between the pictures and the whole cloud"),
    ] {
        match ratio {
            Some(ratio) => changes.extend(change(ratio, of)),
            None => unknown.push(of),
        }
    }
    if let [Some(before), Some(after)] = position
        && (before - after).abs() > 0.03 * before.max(*after)
    {
        changes.push(format!("coordinates are within {} instead of {}", length(*after), length(*before)));
    }
    if position.contains(&None) {
        unknown.push("error of coordinates");
    }
    if changes.is_empty() {
        changes.push(match unknown.len() {
            0 => "nothing that can be measured changes".to_owned(),
            4 => "no figures that compare".to_owned(),
            _ => "no change that was measured".to_owned(),
        });
    }
    if !unknown.is_empty() {
        changes.push(format!("not compared: {}", unknown.join(", ")));
    }
    let what = changes.join(", ");
    format!("{output}: with {axis} {to} instead of {from}, {what}.")
}

/// `12 % less processor time`; nothing if it is within the noise.
fn change(ratio: f64, of: &str) -> Option<String> {
    let percent = (ratio - 1.0) * 100.0;
    match ratio {
        r if (0.97..=1.03).contains(&r) => None,
        r if r > 3.0 => Some(format!("{ratio:.1} times the {of}")),
        r if r > 1.0 => Some(format!("{percent:.0} % more {of}")),
        _ => Some(format!("{:.0} % less {of}", -percent)),
    }
}

/// A length in units of the coordinate system.
pub(crate) fn length(units: f64) -> String {
    match units {
        0.0 => "0".to_owned(),
        u if u < 1e-6 => format!("{u:.0e}"),
        u => format!("{:.*}", (1 - u.log10().floor() as i32).clamp(0, 8) as usize, u),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::{Cost, ViewError};
    use crate::{AxisError, ImageError};

    fn row(sampling: &str, encoding: &str, seconds: f64, bytes: f64) -> Row {
        let cost = Cost {
            wall_seconds: 1.0,
            cpu_seconds: Some(seconds),
            points_per_second: 1e6,
            bytes_per_point: bytes,
            ..Cost::default()
        };
        let values = [("output", "potree2"), ("sampling", sampling), ("encoding", encoding)];
        Row {
            output: "potree2".to_owned(),
            values: values.map(|(axis, value)| (axis, value.to_owned())).into(),
            cost: Some(cost),
            position: Some([AxisError::default(); 3]),
            views: vec![ViewError { view: "whole", error: ImageError::default(), points: 1 }],
            ..Row::default()
        }
    }

    #[test]
    fn what_was_not_measured_is_not_said_to_be_unchanged() {
        let same = || row("grid", "default", 1.0, 30.0);
        let said = |b: Row| trades(&[row("poisson", "default", 1.0, 30.0), b])[0].sentence.clone();
        assert_eq!(
            said(same()),
            "potree2: with sampling grid instead of poisson, nothing that can be measured changes."
        );
        let by_depth = Row { is_shaded_by_depth: true, ..same() };
        assert_eq!(
            said(by_depth),
            "potree2: with sampling grid instead of poisson, no change that was measured, not compared: difference between \
             the pictures and the whole cloud."
        );
        let nothing = Row { cost: None, views: Vec::new(), position: None, ..same() };
        assert!(said(nothing).contains("no figures that compare, not compared: processor time, disk"), "nothing");
        let faster = Row { position: None, ..row("grid", "default", 0.5, 30.0) };
        assert!(said(faster).ends_with("50 % less processor time, not compared: error of coordinates."));
    }

    #[test]
    fn pairs_that_differ_in_one_value_make_a_trade() {
        let rows = vec![
            row("poisson", "default", 1.0, 30.0),
            row("poisson", "brotli", 4.0, 10.0),
            row("random", "default", 0.5, 30.0),
            row("random", "brotli", 2.0, 10.0),
        ];
        let found = trades(&rows);
        let sentences: Vec<&str> = found.iter().map(|trade| trade.sentence.as_str()).collect();
        assert_eq!(
            sentences,
            [
                "potree2: with sampling random instead of poisson, 50 % less processor time.",
                "potree2: with encoding brotli instead of default, 4.0 times the processor time, 67 % less disk and \
                 download.",
            ]
        );
    }

    #[test]
    fn lengths_have_two_digits() {
        assert_eq!([0.0, 0.00123, 1e-9, 0.5, 123.4].map(length), ["0", "0.0012", "1e-9", "0.50", "123"]);
    }
}
