//! The accuracy of an output in one line.

use pointmill_converter::{Accuracy, OutputReport, Report, SavedBytes};

use super::quantities::{at_most, bytes, count, number, plural, three_digits};

/// What a reader of the output decodes, against the sources.
pub(crate) fn line(output: &OutputReport, report: &Report) -> String {
    let accuracy = &output.accuracy;
    let mut parts = vec![positions(accuracy)];
    parts.extend(metres(accuracy));
    parts.extend(integers(accuracy));
    parts.extend(merged(accuracy));
    parts.push(format!("step {}", steps(&report.grid.scale)));
    format!("{}: {}", output.format, parts.join("; "))
}

/// What became of a requested precision: the error that is left, by axis, and what that saves.
pub(crate) fn precision_line(output: &OutputReport, report: &Report) -> Option<String> {
    let precision = output.precision.as_ref()?;
    let by_axis = |v: [f64; 3]| v.map(at_most).join(" ");
    let requested = report.options.get("precision").and_then(|text| text.as_str()).unwrap_or_default();
    let bits: f64 = precision.bits_dropped.iter().sum();
    let saved = match precision.saved {
        SavedBytes::Planes { bytes: n, .. } => format!("{}, {} before any compression", precision.saved, bytes(n)),
        other => other.to_string(),
    };
    Some(format!(
        "{}: precision {requested} is kept: errors by axis at most {}, root mean square {}, allowed {}; {bits:.1} bits of \
         position less per point; saved: {saved}",
        output.format,
        by_axis(precision.max),
        by_axis(precision.rms),
        by_axis(precision.allowed),
    ))
}

/// How far decoded positions are from those of the sources. Only what is the same is called unchanged.
fn positions(accuracy: &Accuracy) -> String {
    let total = &accuracy.total;
    let all_there = accuracy.integers.same == accuracy.integers.points && accuracy.merged.lattice == Some(0);
    if total.is_zero() && all_there {
        return "coordinates are unchanged".to_owned();
    }
    if total.is_rounding() && all_there {
        return format!("coordinates are unchanged to the rounding of doubles, at most {}", at_most(total.max_3d));
    }
    let by_axis = |v: [f64; 3]| v.map(at_most).join(" ");
    let mut text = format!(
        "decoded coordinates are off by at most {} (by axis {}), root mean square {}, mean {}",
        at_most(total.max_3d),
        by_axis(total.max),
        at_most(total.rms_3d),
        total.mean.map(three_digits).join(" "),
    );
    let (lattice, format) = (&accuracy.lattice, &accuracy.format);
    let parts = [(lattice, "by the lattice"), (format, "by the format")];
    let large: Vec<_> = parts.iter().filter(|(errors, _)| !errors.is_rounding()).collect();
    match large.as_slice() {
        [(_, by)] => text += &format!(", {by}"),
        _ => text += &format!(": {} by the lattice, {} by the format", at_most(lattice.max_3d), at_most(format.max_3d)),
    }
    text
}

fn metres(accuracy: &Accuracy) -> Option<String> {
    let total = accuracy.metres?.total;
    (!total.is_zero())
        .then(|| format!("in metres at most {} ({})", at_most(total.max_3d), total.max.map(at_most).join(" ")))
}

fn integers(accuracy: &Accuracy) -> Option<String> {
    let integers = accuracy.integers;
    if accuracy.total.is_zero() && integers.same == integers.points {
        return None;
    }
    match integers.points - integers.same {
        // integers of the lattice alone are no comfort where it moved the points
        0 => accuracy.lattice.is_rounding().then(|| "all integers come back".to_owned()),
        lost => Some(format!("integers of {} of {} do not come back", count(lost), plural(integers.points, "point"))),
    }
}

fn merged(accuracy: &Accuracy) -> Option<String> {
    let points = accuracy.merged.lattice.unwrap_or(0) + accuracy.merged.format.unwrap_or(0);
    (points > 0).then(|| format!("{} fell together with others", plural(points, "point")))
}

/// One step if all axes have the same.
fn steps(scale: &[f64; 3]) -> String {
    match scale {
        [x, y, z] if x == y && y == z => number(*x),
        _ => scale.map(number).join(" "),
    }
}
