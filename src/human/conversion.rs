//! Reports of runs and estimates as text. No figure is computed here.

use std::fs;
use std::path::Path;

use pointmill_converter::{DropReason, Estimate, OutputReport, Plan, Report, TakenOver};
use pointmill_format::DatasetKind;
use serde_json::Value;

use crate::datasets;
use crate::flags;

use super::accuracy;
use super::quantities::{bytes, count, number, numbers, plural, rate, seconds};
use super::text::{Table, batches, corners, or_none};

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
    if report.recalled_points > 0 {
        let built = match report.recalled_units {
            0 => String::new(),
            n => format!(", {} built", plural(n, "unit")),
        };
        lines.push(format!("{} had been read before{built}", plural(report.recalled_points, "point")));
    }
    lines.extend(report.outputs.iter().filter_map(taken_over_line));
    lines.extend(points_lines(report));
    lines.extend(colours_line(report));
    lines.extend(report.outputs.iter().map(|output| accuracy::line(output, report)));
    lines.extend(report.outputs.iter().filter_map(|output| accuracy::precision_line(output, report)));
    for output in &report.outputs {
        lines.extend(dropped_line(output, report.outputs.len() > 1));
    }
    if verbose {
        lines.extend(details(report));
    }
    lines
}

/// What was written.
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

/// What a dataset that scans were added to kept of itself.
fn taken_over_line(output: &OutputReport) -> Option<String> {
    let TakenOver { nodes, points, why_not, .. } = output.taken_over?;
    let (of, points) = (plural(output.tree.nodes, "node"), plural(points, "point"));
    Some(match why_not {
        Some(why) => format!("all built anew: {why}"),
        None => format!("{} of {of} copied from the dataset, with {points}", count(nodes)),
    })
}

/// Colours that are not stored as they were read. Some formats have 8 bits in any case.
fn colours_line(report: &Report) -> Option<String> {
    let is_wide = |format: &str| ![DatasetKind::Batches, DatasetKind::Potree1].map(DatasetKind::name).contains(&format);
    let has_wide = |o: &OutputReport| is_wide(&o.format) && o.attributes.iter().any(|a| a == "rgb");
    let depths: Vec<u8> = report.inputs.iter().filter_map(|input| input.rgb_depth).collect();
    let narrow = depths.iter().filter(|depth| **depth == 8).count() as u64;
    let of = plural(depths.len() as u64, "scan");
    (narrow > 0 && report.outputs.iter().any(has_wide))
        .then(|| format!("colours of 8 bits in {} of {of} with colour, stored times 257", count(narrow)))
}

/// Attributes that are not in an output, those of one reason together.
fn dropped_line(output: &OutputReport, name_it: bool) -> Option<String> {
    let mut reasons: Vec<(&DropReason, Vec<&str>)> = Vec::new();
    for dropped in &output.attributes_dropped {
        match reasons.iter_mut().find(|(why, _)| **why == dropped.why) {
            Some((_, names)) => names.push(&dropped.name),
            None => reasons.push((&dropped.why, vec![&dropped.name])),
        }
    }
    let of = if name_it { format!(" of {}", output.format) } else { String::new() };
    let each = reasons.iter().map(|(why, names)| format!("{} ({})", names.join(", "), flags::drop_reason(why)));
    (!reasons.is_empty()).then(|| format!("attributes not written{of}: {}", each.collect::<Vec<_>>().join("; ")))
}

fn points_lines(report: &Report) -> Vec<String> {
    let p = &report.points;
    let duplicates = duplicates_dropped(report);
    let from = plural(report.inputs.len() as u64, "scan");
    if points_not_written(report) == 0 {
        return vec![format!("all {} of {from} written", plural(p.read, "point"))];
    }
    let causes = [
        (p.outside_bounds, "outside the bounds"),
        (p.outliers, "far from all others"),
        (p.other_class, "by class"),
        (p.thinned, "by thinning"),
        (duplicates, "as duplicates"),
        (p.invalid, "without a valid position"),
        (p.at_origin, "at the scanner's origin"),
        (p.unreadable, "unreadable"),
    ];
    let causes = causes.iter().filter(|(n, _)| *n > 0).map(|(n, why)| format!("{} {why}", count(*n)));
    vec![format!(
        "points not written, of {} in {from}: {}",
        plural(p.read, "point"),
        causes.collect::<Vec<_>>().join(", ")
    )]
}

fn details(report: &Report) -> Vec<String> {
    let mut lines = vec![format!("grid: {}", report.grid.why)];
    for input in &report.inputs {
        let read = plural(input.points_read, "point");
        lines.push(format!("input {}: {}, {read}, {}", input.path.display(), input.format, or_none(&input.crs)));
    }
    for phase in &report.phases {
        lines.push(format!("phase {}: {}, {}", phase.name, seconds(phase.seconds), rate(phase.points_per_second)));
    }
    for output in &report.outputs {
        lines.push(format!("{} attributes: {}", output.format, output.attributes.join(", ")));
        for (level, points) in output.tree.points_per_level.iter().enumerate() {
            let nodes = output.tree.nodes_per_level.get(level).copied().unwrap_or(0);
            let (points, nodes) = (plural(*points, "point"), plural(nodes, "node"));
            lines.push(format!("{} level {level}: {points} in {nodes}", output.format));
        }
        lines.push(format!("{} checksum {} of {}", output.format, output.checksum, report.checksum_in));
    }
    lines
}

/// The estimate of a run.
pub(crate) fn estimate(estimate: &Estimate, plan: &Plan) -> String {
    let mut t = Table::default();
    t.row("inputs", plural(estimate.inputs.len() as u64, "scan"));
    t.row("points", format!("{} (from the headers)", count(estimate.points)));
    t.row("bounds", estimate.bounds.map_or_else(|| "unknown".to_owned(), |b| corners(&b[..3], &b[3..])));
    t.row("CRS", or_none(&estimate.crs));
    t.row("step", format!("{}, {}", numbers(&estimate.grid.scale), estimate.grid.why));
    t.row("cube side", number(estimate.grid.cube_side));
    t.row("attributes", estimate.attributes.join(", "));
    for choice in &estimate.choices {
        let value = choice.value.as_deref().unwrap_or("known once the points are read");
        let name = if choice.output.is_empty() { &choice.setting } else { &choice.output };
        let setting = if choice.output.is_empty() { String::new() } else { format!("{}: ", choice.setting) };
        t.row(name, format!("{setting}{value}, {}", choice.why));
    }
    t.row("bytes/point", estimate.bytes_per_point.to_string());
    let memory = format!(
        "{}, limit {}, at least {} needed",
        bytes(estimate.memory_bytes),
        bytes(plan.memory_bytes),
        bytes(estimate.least_memory_bytes)
    );
    t.row("memory", memory);
    t.row("temporary", bytes(estimate.temp_bytes));
    t.row("output", format!("{} in {}", bytes(estimate.output_bytes), plan.output.display()));
    if let Some(standing) = standing(&plan.output, plan.overwrite) {
        t.row("exists", standing);
    }
    estimate.warnings.iter().for_each(|w| t.row("warning", flags::warning_line(w)));
    t.0
}

/// What becomes of an output that is there already; `None`: nothing is there, or an empty folder.
fn standing(output: &Path, overwrite: bool) -> Option<&'static str> {
    let is_empty = || fs::read_dir(output).is_ok_and(|mut entries| entries.next().is_none());
    if fs::symlink_metadata(output).is_err() || is_empty() {
        return None;
    }
    let is_dataset = DatasetKind::detect(output).is_some() || !datasets::inside(output).is_empty();
    Some(match (is_dataset, overwrite) {
        (false, _) => "it is no dataset and is not replaced; choose another output",
        (true, true) => "it will be replaced",
        (true, false) => "requires --overwrite",
    })
}

/// Points read that are not in the dataset.
fn points_not_written(report: &Report) -> u64 {
    let p = &report.points;
    p.outside_bounds
        + p.outliers
        + p.other_class
        + p.thinned
        + duplicates_dropped(report)
        + p.invalid
        + p.at_origin
        + p.unreadable
}

/// Only octrees drop duplicates, all of them the same.
fn duplicates_dropped(report: &Report) -> u64 {
    report.outputs.iter().map(|o| o.duplicates_dropped).max().unwrap_or(0)
}
