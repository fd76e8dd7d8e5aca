//! The outcome of a validation as text. No figure is computed here.

use std::fmt::Write as _;
use std::path::Path;

use pointmill_validate::{Accuracy, DatasetKind, FirstView, LeafQuality, LevelQuality, Outcome, SurfelSummary};

use super::quantities::{at_most, count, plural, three_digits};
use crate::printable::printable;

/// What a validation found: checks, quality by level, problems.
pub(crate) fn outcome(dataset: &Path, outcome: &Outcome, verbose: bool) -> String {
    let mut out = printable(&dataset.to_string_lossy()).into_owned();
    let nodes = match (outcome.format, outcome.nodes) {
        (DatasetKind::Batches, 1) => "1 batch".to_owned(),
        (DatasetKind::Batches, n) => format!("{} batches", count(n)),
        (_, n) => plural(n, "node"),
    };
    let points = plural(outcome.points, "point");
    let _ = writeln!(out, ": {} {}, {points} in {nodes}", outcome.format, outcome.encoding.unwrap_or_default());
    for check in &outcome.checks {
        let verdict = match (check.ok, &check.skipped) {
            (false, _) => "BROKEN",
            (true, Some(_)) if check.checked > 0 => "in part",
            (true, Some(_)) => "skipped",
            (true, None) => "ok",
        };
        let detail = match (&check.skipped, check.ok) {
            (Some(why), _) => printable(why).into_owned(),
            (None, true) => format!("{} checked", count(check.checked)),
            (None, false) => format!("{} checked, {} found", count(check.checked), count(check.found)),
        };
        let _ = writeln!(out, "  {verdict:<8} {:<17} {} ({detail})", check.name.name(), check.promise);
    }
    if let Some(against) = &outcome.against {
        let (expected, found) = (count(against.points_expected), count(against.points_found));
        let sources = plural(against.sources as u64, "scan");
        let _ = writeln!(out, "  {sources}: {expected} points expected, {found} found");
        if !against.attributes_not_in_dataset.is_empty() {
            let names = against.attributes_not_in_dataset.join(", ");
            let _ = writeln!(out, "  not compared, because the dataset does not have them: {}", printable(&names));
        }
    }
    out.push_str(&outcome.surfels.as_ref().map(surfels).unwrap_or_default());
    out.push_str(&accuracy(&outcome.accuracy));
    out.push_str(&outcome.first_view.as_ref().map(first_view).unwrap_or_default());
    out.push_str(&quality(&outcome.quality, verbose));
    out.push_str(&outcome.leaves.as_ref().map(leaves).unwrap_or_default());
    out + &problems(outcome)
}

/// How far attributes that the conversion has computed are from those that were computed again.
fn surfels(surfels: &SurfelSummary) -> String {
    let largest = [
        ("normals", surfels.largest_angle, " degrees"),
        ("curvatures", surfels.largest_curvature, ""),
        ("radii", surfels.largest_radius, " of them"),
    ];
    let largest = largest.into_iter().filter_map(|(what, off, unit)| Some((what, at_most(off?), unit)));
    let largest: Vec<String> = largest.map(|(what, off, unit)| format!("{what} off by {off}{unit}")).collect();
    let (points, ambiguous) = (plural(surfels.points, "point"), count(surfels.ambiguous));
    let found = if largest.is_empty() { "nothing to compare".into() } else { largest.join(", ") + " at most" };
    format!("  {points} computed again, {ambiguous} of them with more than one plane that fits: {found}\n")
}

/// Errors of decoded positions, as far as they were measured.
fn accuracy(accuracy: &Accuracy) -> String {
    let mut out = String::new();
    let parts = [("lattice against the scans", &accuracy.lattice), ("decoded against the lattice", &accuracy.format)];
    for (what, errors) in parts.into_iter().filter_map(|(what, errors)| Some((what, errors.as_ref()?))) {
        let by_axis = errors.max.map(at_most).join(" ");
        let (max, rms) = (at_most(errors.max_3d), at_most(errors.rms_3d));
        let mean = errors.mean.map(three_digits).join(" ");
        let _ = writeln!(out, "  {what}: at most {max} (by axis {by_axis}), root mean square {rms}, mean {mean}");
    }
    if let Some(integers) = accuracy.integers {
        let lost = integers.points - integers.same;
        let _ = writeln!(out, "  integers of {} of {} do not come back", count(lost), plural(integers.points, "point"));
    }
    out
}

/// How much there is to load at first, and what would be ideal.
fn first_view(view: &FirstView) -> String {
    let cube =
        view.cube_over_extent.map_or_else(String::new, |ratio| format!("cube {ratio:.2} × the longest extent, "));
    format!(
        "  first view: {} in the root (good: 10,000 to 25,000), {cube}first hierarchy chunk {}; {} after {}: {}, {}\n",
        plural(view.root_points, "point"),
        plural(view.first_chunk_bytes, "byte"),
        plural(view.points, "point"),
        plural(view.requests, "request"),
        plural(view.nodes, "node"),
        plural(view.bytes, "byte"),
    )
}

/// Per cent, rounded so that only none is 0 and only all is 100; `–` of nothing.
fn share(part: u64, of: u64) -> String {
    match (part, of) {
        (_, 0) => "–".to_owned(),
        (0, _) => "0 %".to_owned(),
        (part, of) if part == of => "100 %".to_owned(),
        (part, of) => format!("{:.2} %", (100.0 * part as f64 / of as f64).clamp(0.01, 99.99)),
    }
}

/// Distances relative to the spacing of the level; `–` where there is nothing to measure.
fn quality(levels: &[LevelQuality], verbose: bool) -> String {
    let mut out = String::new();
    if levels.is_empty() {
        return out;
    }
    let _ = writeln!(
        out,
        "  level   nodes        points     spacing  nearest: min  median  close: inside   across  within: 1      1.5   \
         largest hole"
    );
    let ratio = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.3}"));
    for l in levels {
        let _ = writeln!(
            out,
            "  {:>5} {:>7} {:>13} {:>11.5} {:>13} {:>7} {:>14} {:>8} {:>10} {:>8} {:>14}",
            l.level,
            count(l.nodes),
            count(l.points),
            l.spacing,
            ratio(l.nearest_min),
            ratio(l.nearest_median),
            share(l.close_inside, l.sampled),
            share(l.close_across, l.sampled),
            share(l.offered_within_1, l.offered),
            share(l.below_within_1_5, l.below),
            if l.largest_hole.is_some_and(|hole| hole >= 4.0) { "≥ 4".to_owned() } else { ratio(l.largest_hole) },
        );
    }
    if verbose {
        out.push_str(
            "  Distances are relative to the spacing of the level. Nearest: from a point of an inner node to the next of that\n  \
             node, median: to the next of the level. Close: points of inner nodes with one of the same node, of another\n  \
             node, nearer than 0.999 spacings. Within 1: points of the next level with one drawn so near; within 1.5: points\n  \
             of all deeper levels; largest hole: the distance of the one that is farthest from any drawn.\n",
        );
    }
    out
}

/// Sizes of the leaves of a binary tree.
fn leaves(leaves: &LeafQuality) -> String {
    if leaves.leaves == 0 {
        return String::new();
    }
    let LeafQuality { points_min, points_mean, points_max, depth, volume, largest_error, largest_bound, .. } = leaves;
    format!(
        "  {} of {} to {} points, {} on average, down to depth {depth}; volume of their boxes {volume:.0}\n  \
         maximum position error {largest_error:.1e}, allowed {largest_bound:.1e}\n",
        if leaves.leaves == 1 { "1 leaf".to_owned() } else { format!("{} leaves", count(leaves.leaves)) },
        count(*points_min),
        count(*points_max),
        count(points_mean.round() as u64),
    )
}

/// One problem per line.
pub(crate) fn problems(outcome: &Outcome) -> String {
    let mut out = String::new();
    outcome.problems.iter().for_each(|problem| out.extend([&*printable(&problem.to_string()), "\n"]));
    let errors: u64 = outcome.checks.iter().map(|check| check.found + check.warnings).sum();
    let hidden = errors.saturating_sub(outcome.problems.len() as u64);
    if hidden > 0 {
        let _ = writeln!(out, "and {} more", count(hidden));
    }
    out
}
