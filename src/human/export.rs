//! The account of an export as text. No figure is computed here.

use pointmill_converter::{ChangedValues, ExportReport, ExportedAttribute, ExportedPoints};
use pointmill_format::Changes;

use super::quantities::{at_most, bytes, count, number, plural, rate, seconds};

/// The summary of a run, line by line.
pub(crate) fn report(report: &ExportReport) -> Vec<String> {
    let ExportReport { output, format, points, .. } = report;
    let written = plural(points.written, "point");
    let mut lines = vec![format!("{}: {written}, {format}, {}", output.display(), bytes(report.bytes))];
    let per_second = points.read as f64 / report.seconds.max(1e-9);
    let memory = report.memory_bytes.map_or_else(String::new, |peak| format!(", peak memory {}", bytes(peak)));
    lines.push(format!("{}, {}{memory}", seconds(report.seconds), rate(per_second)));
    lines.push(points_line(points, report.inputs));
    lines.push(positions_line(report));
    lines.extend(attributes_lines(&report.attributes));
    if !report.crs.is_empty() {
        lines.push(format!("coordinate reference system: {}", report.crs));
    }
    lines
}

fn points_line(p: &ExportedPoints, inputs: u64) -> String {
    let from = plural(inputs, "input");
    let causes = [
        (p.outside_bounds, "outside the bounds"),
        (p.other_class, "by class"),
        (p.thinned, "by thinning"),
        (p.invalid, "without a valid position"),
        (p.at_origin, "at the scanner's origin"),
        (p.unreadable, "unreadable"),
    ];
    let causes: Vec<_> = causes.iter().filter(|(n, _)| *n > 0).map(|(n, why)| format!("{} {why}", count(*n))).collect();
    match causes.is_empty() {
        true => format!("all {} of {from} written", plural(p.read, "point")),
        false => {
            let all = plural(p.read + p.unreadable, "point");
            format!("points not written, of {all} in {from}: {}", causes.join(", "))
        }
    }
}

fn positions_line(report: &ExportReport) -> String {
    let p = &report.positions;
    let mut line = if p.max_3d == 0.0 {
        "coordinates are unchanged".to_owned()
    } else if !p.moved {
        format!("coordinates are unchanged to the rounding of doubles, at most {}", at_most(p.max_3d))
    } else {
        let by_axis = p.max.map(at_most).join(" ");
        let rms = at_most(p.rms_3d);
        format!("coordinates are off by at most {} (by axis {by_axis}), root mean square {rms}", at_most(p.max_3d))
    };
    match report.scale {
        Some([x, y, z]) if x == y && y == z => line += &format!("; step {}", number(x)),
        Some(scale) => line += &format!("; step {}", scale.map(number).join(" ")),
        None => {}
    }
    line
}

fn attributes_lines(attributes: &[ExportedAttribute]) -> Vec<String> {
    let named = |place: &str| -> Vec<&str> {
        attributes.iter().filter(|a| a.place.iter().any(|p| p == place)).map(|a| a.name.as_str()).collect()
    };
    let mut lines = Vec::new();
    let extra = named("extra bytes");
    if !extra.is_empty() {
        lines.push(format!("extra bytes: {}", extra.join(", ")));
    }
    for a in attributes {
        if let Some(changed) = &a.changed {
            lines.push(format!("{}: {}", a.name, words(changed)));
        }
        if let Some(missing) = &a.missing {
            lines.push(format!("{}: {} without it have 0", a.name, plural(missing.points, "point")));
        }
    }
    lines
}

/// What became of values.
fn words(changed: &ChangedValues) -> Changes {
    let ChangedValues { clamped, rounded, not_finite, out_of_range, extremes, .. } = *changed;
    Changes { clamped, rounded, not_finite, out_of_range, extremes, missing: 0 }
}
