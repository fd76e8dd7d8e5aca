//! How reports, estimates and validations look to people, and the words that all commands share. No figure is worked
//! out here.

use std::fmt::Write as _;
use std::path::Path;

use pointmill_converter::{Estimate, OutputReport, Plan, Report};
use pointmill_format::{Attribute, Crs};
use pointmill_validate::{Format, LeafQuality, LevelQuality, Outcome};
use serde_json::Value;

use crate::convert::points_left_out;
use crate::quantities::{bytes, count, number, numbers, plural, rate, seconds};

/// The summary of a run, line by line.
pub(crate) fn report(report: &Report, plan: &Plan, verbose: bool) -> Vec<String> {
    let mut lines: Vec<String> = report.outputs.iter().map(|output| output_line(output, plan)).collect();
    let per_second = report.points.read as f64 / report.seconds.max(1e-9);
    let memory = report.peak_memory_bytes.map_or_else(String::new, |peak| format!(", peak memory {}", bytes(peak)));
    let temporary = match report.temp_bytes {
        0 => String::new(),
        n => format!(", temporary files {}", bytes(n)),
    };
    lines.push(format!("{}, {}{memory}{temporary}", seconds(report.seconds), rate(per_second)));
    lines.extend(points_lines(report));
    lines.push(coordinates_line(report));
    for output in &report.outputs {
        lines.extend(dropped_line(output, report.outputs.len() > 1));
    }
    if verbose {
        lines.extend(details(report));
    }
    lines
}

/// What was made.
fn output_line(output: &OutputReport, plan: &Plan) -> String {
    let parts = match output.details.get("batches").and_then(Value::as_u64) {
        Some(n) => batches(n),
        None => {
            let tree = &output.tree;
            format!("{}, {}", plural(tree.nodes, "node"), plural(u64::from(tree.depth) + 1, "level"))
        }
    };
    let place = plan.output.join(&output.folder);
    // joining nothing leaves a separator at the end
    let place = if output.folder.is_empty() { &plan.output } else { &place };
    format!("{}: {} in {parts}, {}", place.display(), plural(output.points, "point"), bytes(output.bytes))
}

/// "1 batch", "7 batches".
pub(crate) fn batches(n: u64) -> String {
    if n == 1 { "1 batch".to_owned() } else { format!("{} batches", count(n)) }
}

/// Attributes that are not in an output, those of one reason together.
fn dropped_line(output: &OutputReport, name_it: bool) -> Option<String> {
    let mut reasons: Vec<(&str, Vec<&str>)> = Vec::new();
    for dropped in &output.attributes_dropped {
        match reasons.iter_mut().find(|(why, _)| *why == dropped.why) {
            Some((_, names)) => names.push(&dropped.name),
            None => reasons.push((&dropped.why, vec![&dropped.name])),
        }
    }
    let of = if name_it { format!(" of {}", output.format) } else { String::new() };
    let told = reasons.iter().map(|(why, names)| format!("{} ({why})", names.join(", ")));
    (!reasons.is_empty()).then(|| format!("attributes left out{of}: {}", told.collect::<Vec<_>>().join("; ")))
}

fn points_lines(report: &Report) -> Vec<String> {
    let p = &report.points;
    let from = plural(report.inputs.len() as u64, "scan");
    if points_left_out(report) == 0 {
        return vec![format!("all {} of {from} are in the dataset", plural(p.read, "point"))];
    }
    let causes = [
        (p.outside_bounds, "outside --bounds"),
        (p.other_class, "of other classes than --class"),
        (p.thinned, "thinned out by --every"),
        (p.duplicates_dropped, "duplicates, dropped"),
        (p.invalid, "without a valid position"),
        (p.unreadable, "lost, because parts of the inputs cannot be decoded"),
    ];
    let causes = causes.iter().filter(|(n, _)| *n > 0).map(|(n, why)| format!("{} {why}", count(*n)));
    vec![format!("of {} in {from}, left out: {}", plural(p.read, "point"), causes.collect::<Vec<_>>().join(", "))]
}

fn coordinates_line(report: &Report) -> String {
    let change = &report.coordinate_change;
    let step = numbers(&report.grid.scale);
    if change.max.iter().all(|v| *v == 0.0) {
        return format!("coordinates are unchanged, step {step}");
    }
    // 0.07 read as a double and 7 steps of 0.01 differ in the last bits
    let farthest =
        report.inputs.iter().filter_map(|i| i.bounds_measured).flatten().fold(0.0f64, |far, v| far.max(v.abs()));
    if change.max.iter().zip(&report.grid.scale).all(|(max, step)| *max <= (step * 1e-6).min(farthest * 1e-15)) {
        return format!("coordinates are unchanged but for the rounding of doubles, step {step}");
    }
    format!(
        "coordinates moved by at most {} (root mean square {}), step {step}",
        numbers(&change.max),
        numbers(&change.rms)
    )
}

fn details(report: &Report) -> Vec<String> {
    let mut lines = vec![format!("grid: {}", report.grid.why), format!("attributes: {}", report.attributes.join(", "))];
    for input in &report.inputs {
        let read = plural(input.points_read, "point");
        lines.push(format!("input {}: {}, {read}, {}", input.path.display(), input.format, or_none(&input.crs)));
    }
    for phase in &report.phases {
        lines.push(format!("phase {}: {}, {}", phase.name, seconds(phase.seconds), rate(phase.points_per_second)));
    }
    for (level, points) in report.tree.points_per_level.iter().enumerate() {
        let nodes = report.tree.nodes_per_level.get(level).copied().unwrap_or(0);
        lines.push(format!("level {level}: {} in {}", plural(*points, "point"), plural(nodes, "node")));
    }
    lines.push(format!("checksum in {} out {}", report.checksum_in, report.checksum_out));
    lines
}

/// What a run would do.
pub(crate) fn estimate(estimate: &Estimate, plan: &Plan) -> String {
    let mut t = Table::default();
    t.row("inputs", plural(estimate.inputs.len() as u64, "scan"));
    t.row("points", format!("{} (as the headers say)", count(estimate.points)));
    t.row("bounds", estimate.bounds.map_or_else(|| "unknown".to_owned(), |b| corners(&b[..3], &b[3..])));
    t.row("CRS", or_none(&estimate.crs));
    t.row("step", format!("{}, {}", numbers(&estimate.grid.scale), estimate.grid.why));
    t.row("cube side", number(estimate.grid.cube_side));
    t.row("attributes", estimate.attributes.join(", "));
    t.row("bytes a point", estimate.bytes_per_point.to_string());
    t.row("memory", format!("{} of {} allowed", bytes(estimate.memory_bytes), bytes(plan.memory_bytes)));
    t.row("temporary", bytes(estimate.temp_bytes));
    t.row("output", format!("{} in {}", bytes(estimate.output_bytes), plan.output.display()));
    if plan.output.exists() {
        let advice = if plan.overwrite { "will be replaced" } else { "needs --overwrite to be replaced" };
        t.row("exists", advice);
    }
    estimate.warnings.iter().for_each(|w| t.row("warning", w));
    t.0
}

/// What a validation found: checks, quality by level, problems.
pub(crate) fn outcome(dataset: &Path, outcome: &Outcome, verbose: bool) -> String {
    let mut out = printable(&dataset.to_string_lossy());
    let nodes = match (outcome.format, outcome.nodes) {
        (Format::Batches, 1) => "1 batch".to_owned(),
        (Format::Batches, n) => format!("{} batches", count(n)),
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
            (Some(why), _) => why.clone(),
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
            let _ = writeln!(out, "  not compared, for the dataset does not have them: {}", printable(&names));
        }
    }
    out.push_str(&quality(&outcome.quality, verbose));
    out.push_str(&outcome.leaves.as_ref().map(leaves).unwrap_or_default());
    out + &problems(outcome)
}

/// Distances over the spacing of the level; `–` where there is nothing to measure.
fn quality(levels: &[LevelQuality], verbose: bool) -> String {
    let mut out = String::new();
    if levels.is_empty() {
        return out;
    }
    let _ = writeln!(
        out,
        "  level   nodes        points     spacing  nearest: min   mean   largest hole   seam: min   close"
    );
    let ratio = |v: Option<f64>| v.map_or_else(|| "–".to_owned(), |v| format!("{v:.3}"));
    for l in levels {
        let _ = writeln!(
            out,
            "  {:>5} {:>7} {:>13} {:>11.5} {:>13} {:>6} {:>14} {:>11} {:>7}",
            l.level,
            count(l.nodes),
            count(l.points),
            l.spacing,
            ratio(l.nearest_min),
            ratio(l.nearest_mean),
            if l.largest_hole.is_some_and(|hole| hole >= 4.0) { "≥ 4".to_owned() } else { ratio(l.largest_hole) },
            ratio(l.seam_min),
            count(l.seam_close)
        );
    }
    if verbose {
        out.push_str(
            "  Distances are over the spacing of the level. Nearest: from a point of an inner node to the next of that\n  \
             node. Largest hole: from a point of a deeper level to the next one drawn. Seam: between inner nodes; close:\n  \
             points that have one of another node nearer than the spacing.\n",
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
         positions are off by {largest_error:.1e} at most, {largest_bound:.1e} is allowed\n",
        if leaves.leaves == 1 { "1 leaf".to_owned() } else { format!("{} leaves", count(leaves.leaves)) },
        count(*points_min),
        count(*points_max),
        count(points_mean.round() as u64),
    )
}

/// One problem a line.
pub(crate) fn problems(outcome: &Outcome) -> String {
    let mut out = String::new();
    outcome.problems.iter().for_each(|problem| out += &(printable(&problem.to_string()) + "\n"));
    let errors: u64 = outcome.checks.iter().map(|check| check.found + check.warnings).sum();
    let hidden = errors.saturating_sub(outcome.problems.len() as u64);
    if hidden > 0 {
        let _ = writeln!(out, "and {} more", count(hidden));
    }
    out
}

/// A column: its name, type, and range where it is known.
pub(crate) fn attribute_line(attribute: &Attribute, ranges: Option<&[[f64; 2]]>) -> String {
    let times = if attribute.elements > 1 { format!(" × {}", attribute.elements) } else { String::new() };
    let mut line = format!("{:<22} {}{times}", attribute.name, attribute.ty.potree_name());
    if attribute.scale.iter().any(|s| *s != 1.0) || attribute.offset.iter().any(|o| *o != 0.0) {
        let _ = write!(line, " · {} + {}", numbers(&attribute.scale), numbers(&attribute.offset));
    }
    if let Some(no_data) = &attribute.no_data {
        let _ = write!(line, ", {} is unknown", numbers(no_data));
    }
    for [min, max] in ranges.unwrap_or_default().iter().filter(|r| r[0] <= r[1]) {
        let _ = write!(line, ", {} to {}", number(*min), number(*max));
    }
    line
}

/// The coordinate reference system in a few words.
pub(crate) fn crs(crs: &Crs) -> String {
    let codes = [crs.epsg, crs.vertical_epsg].into_iter().flatten().map(|code| format!("EPSG:{code}"));
    let codes = codes.collect::<Vec<_>>().join(" + ");
    let name = crs.wkt.as_deref().map(|wkt| wkt.split('"').nth(1).unwrap_or("no name"));
    match name {
        Some(name) if codes.is_empty() => format!("WKT {name}"),
        Some(name) => format!("WKT {name}, {codes}"),
        None => or_none(&codes).to_owned(),
    }
}

/// Lower and upper corner of a box.
pub(crate) fn corners(min: &[f64], max: &[f64]) -> String {
    format!("{} … {}", numbers(min), numbers(max))
}

pub(crate) fn or_none(text: &str) -> &str {
    if text.is_empty() { "no CRS" } else { text }
}

/// Lines of a word and what there is to say about it.
#[derive(Default)]
pub(crate) struct Table(pub(crate) String);

impl Table {
    /// A table about a file or folder.
    pub(crate) fn about(path: &Path) -> Self {
        Self(printable(&path.to_string_lossy()) + "\n")
    }

    /// Adds a line.
    pub(crate) fn row(&mut self, word: &str, text: impl AsRef<str>) {
        let _ = writeln!(self.0, "  {word:<13} {}", printable(text.as_ref()));
    }
}

/// Control characters out of a file (a CRS, an attribute's name) never reach the terminal.
fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
