//! COPC. `docs/formats/copc.md` is the only source of what is expected.
//!
//! # Tolerances
//! * Boxes: closed, and 4 ulps of the largest coordinate on the axis; on integers. In files of other programs points that are
//!   a step outside are a warning: coordinates are rounded after the node was chosen.
//! * Bounds of the header: half a step, and 4 ulps; in files of other programs a step is a warning.
//! * Spacing, seams, coverage: measured in all files, judged in those that name pointmill as their writer. Two units of 31-bit
//!   fractions of the cube where the sampling is stated, else a step.
//! * Everything else: none.
//!
//! # Memory
//! Nodes are streamed. What stays is the table of nodes (about 300 bytes each), the chunk table while it is looked at, and what
//! the [walk](crate::octree::walk) takes.

mod boxes;
mod chunks;
mod feed;
mod front;
mod header;
mod info;
mod nodes;
mod pages;
mod records;
mod seen;

use std::path::Path;
use std::sync::Mutex;

use pointmill_format::copc::{Dataset, Info};
use pointmill_format::octree::Octree as _;
use pointmill_format::{AttributeType, DatasetKind, Lattice, ReadError};
use serde_json::Value;

use crate::accuracy::{self, Known, Side};
use crate::against::rules::Conversion;
use crate::against::{Against, Context, Rules};
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::memory::Budget;
use crate::octree::expect::Geometry;
use crate::octree::first_view;
use crate::octree::lattices::Lattices;
use crate::octree::look::Look;
use crate::octree::spacing::Sampling;
use crate::octree::tree::{NODE_BYTES, Tree};
use crate::options::{Options, ProgressFn};
use crate::outcome::{AgainstSummary, Outcome};
use crate::report;
use crate::surfels::{self, Derived};
use feed::Records;
use front::Front;
use nodes::Nodes;
use pages::Pages;
use seen::{Judged, Seen};

/// What is judged by how a file says that its nodes were sampled.
const NEIGHBOURHOODS: [Check; 3] = [Check::Spacing, Check::Seams, Check::Coverage];

/// Checks the file at `path`.
///
/// # Errors
/// As [`crate::validate`].
pub(crate) fn run(path: &Path, options: &Options, progress: &ProgressFn<'_>) -> Result<Outcome, ReadError> {
    let mut budget = Budget::new(path, options.memory_bytes)?;
    let findings = Findings::new(DatasetKind::Copc, options.max_problems);
    let Some(front) = Front::read(path, &budget, &findings)? else {
        return Ok(unusable(findings, None));
    };
    header::check(&front, &findings);
    records::check(&front, &findings);
    let info = info::check(&front, &findings);
    let mut dataset = match (Dataset::open(path), info) {
        (Ok(dataset), Some(_)) => dataset,
        (Err(error), _) if error.is_io() => return Err(error),
        (result, _) => return Ok(unusable(findings, result.err().as_ref())),
    };
    let Some(info) = info else { return Ok(unusable(findings, None)) };
    let own = front.own();
    let report = report::find(path, &findings)?;
    let derived = Derived::of(report.as_ref(), &findings);
    let rules = rules(&dataset, &own, derived.as_ref());
    let against = match options.against.as_slice() {
        [] => None,
        paths => Some(Against::open(paths, &options.open, rules.clone())?),
    };

    let mut tree = Pages::new(path, &front, &budget, &findings).walk(&info)?;
    budget.take(tree.nodes.len() as u64 * NODE_BYTES)?;
    count(&tree, &front, &findings);
    chunks::check(&mut tree, &front, path, &budget, &findings)?;

    dataset.set_max_node_bytes(budget.left());
    let (geometry, shift) = geometry(&info, dataset.lattice());
    let nodes = Nodes {
        dataset: &dataset,
        info: &info,
        geometry,
        shift,
        lattices: Lattices::new(dataset.lattice(), &own),
        sums: against.as_ref().map(|a| &a.sums),
        is_ours: front.is_ours(),
        findings: &findings,
        seen: Mutex::new(Seen::new(&dataset.info().attributes)),
        deviations: Default::default(),
    };
    // what is not judged is measured all the same
    let seen_by_look = Findings::new(DatasetKind::Copc, options.max_problems);
    let look = Look {
        folder: path,
        nodes: &nodes,
        tree: &tree,
        geometry,
        sampling: Sampling::from_word(own["sampling"].as_str()),
        no_coverage: None,
        node_bytes: largest_node(&tree, &dataset),
        options,
        progress,
        findings: if front.is_ours() { &findings } else { &seen_by_look },
    };
    let walked = look.at_all(&mut budget)?;
    let quality = look.quality(&walked);
    if !front.is_ours() {
        findings.absorb(Check::Payloads, &seen_by_look);
        NEIGHBOURHOODS.into_iter().for_each(|c| findings.skip(c, "only pointmill promises anything of it"));
    }
    let (seen, deviation) = nodes.finish();
    let is_complete = walked.unreadable == 0 && tree.nodes.iter().all(|n| n.readable);
    let stored = Geometry { lattice: dataset.lattice(), ..geometry };
    let attributes = &dataset.info().attributes;
    let judged = Judged { front: &front, info: &info, geometry: &stored, attributes, is_complete, findings: &findings };
    judged.hold(&seen);
    let records = Records { dataset: &dataset, tree: &tree };
    let context = Context { records: &records, findings: &findings, progress, budget: &budget };
    let summary = compare(against.as_ref(), &context)?;

    let points = tree.nodes.iter().map(|n| u64::from(n.record.points)).sum();
    let surfels = match &derived {
        Some(derived) => surfels::Task {
            derived,
            rules: &rules,
            points,
            unread: (!is_complete).then(|| "not all nodes could be read".into()),
            uncertain: None,
            is_octahedral: false,
            against: against.as_ref(),
            threads: walked.threads,
        }
        .check(&context)?,
        None => None,
    };
    let known = Known {
        points,
        projection: dataset.crs().wkt.as_deref().unwrap_or_default(),
        bounds: Some(front.bounds()),
        lattice: against.as_ref().and_then(Against::measured).map(|m| m.lattice),
        format: is_complete.then_some(Side { deviation, lost: 0, merged: Some(0) }),
    };
    report::check(report.as_ref(), (points, tree.nodes.len() as u64), &findings);
    let accuracy = accuracy::judge(report.as_ref(), &known, &findings);
    Ok(Outcome {
        encoding: Some("laz"),
        points: front.points(),
        nodes: tree.nodes.len() as u64,
        quality,
        first_view: first_view::measure(&tree, front.points_start(), cube_over_extent(&front, &info)),
        against: summary,
        surfels,
        accuracy,
        ..Outcome::new(findings)
    })
}

/// The outcome for a file that no reader opens.
fn unusable(findings: Findings, error: Option<&ReadError>) -> Outcome {
    let looked_at = [Check::Header, Check::Records, Check::OctreeInfo];
    for check in Check::COPC.iter().copied().filter(|c| !looked_at.contains(c)) {
        findings.skip(check, "the file cannot be opened");
    }
    if looked_at.iter().all(|check| findings.found(*check) == 0) {
        let found = error.map_or_else(|| "none".to_owned(), ReadError::what);
        findings.push(Finding::new(Check::Header, "header and records", "those of a COPC file", found));
    }
    Outcome::new(findings)
}

/// What records of the file have, and what is compared with the sources.
fn rules(dataset: &Dataset, own: &Value, derived: Option<&Derived>) -> Rules {
    let mut rules = Rules::new(dataset.info().attributes.clone(), dataset.lattice(), own);
    // every record has all fields of its point format, whatever the sources have
    let written = own["attributes"].as_array();
    let is_written = |name: &str| written.is_none_or(|names| names.iter().any(|n| n == name));
    let stored = dataset.info().attributes.iter();
    for ((attribute, conversion), stored) in rules.attributes.iter().zip(&mut rules.conversions).zip(stored) {
        if !is_written(&stored.name) {
            *conversion = Conversion::NotWritten;
        } else if attribute.name == "scan angle" && attribute.ty == AttributeType::Int16 {
            *conversion = Conversion::FineAngle;
        }
    }
    rules.set_apart(Derived::names_of(derived));
    rules
}

fn compare(against: Option<&Against>, context: &Context<'_>) -> Result<Option<AgainstSummary>, ReadError> {
    let Some(against) = against else {
        context.findings.skip(Check::Against, "no sources were given");
        return Ok(None);
    };
    against.compare(context).map(Some)
}

/// The points of all nodes against the header.
fn count(tree: &Tree, front: &Front, findings: &Findings) {
    findings.checked(Check::PointCount, tree.nodes.len() as u64);
    let sum: u64 = tree.nodes.iter().map(|n| u64::from(n.record.points)).sum();
    if sum != front.points() {
        findings.push(Finding::new(Check::PointCount, "points", sum, front.points()));
    }
}

/// The geometry on the lattice of the file whose 0 is the corner of the cube, or the next step below; and how many steps that is
/// from the 0 of the file.
fn geometry(info: &Info, lattice: Lattice) -> (Geometry, [i64; 3]) {
    let cube = info.cube();
    let shift = [0, 1, 2].map(|a| {
        let steps = (cube.min[a] - lattice.offset[a]) / lattice.scale[a];
        // a corner that is a point of the lattice but for rounding is that point
        let near = (steps - steps.round()).abs() * lattice.scale[a] < 1e-3 * lattice.scale[a];
        (if near { steps.round() } else { steps.floor() }) as i64
    });
    let Lattice { scale, offset } = lattice;
    let corner = [0, 1, 2].map(|a| shift[a] as f64 * scale[a] + offset[a]);
    let rounding = scale.into_iter().fold(0.0, f64::max);
    (Geometry { lattice: Lattice { scale, offset: corner }, cube, spacing: info.spacing, rounding }, shift)
}

/// Bytes of the largest node in memory: as stored, as columns and as positions.
fn largest_node(tree: &Tree, dataset: &Dataset) -> u64 {
    let columns: usize = dataset.info().attributes.iter().map(|a| a.size()).sum();
    let point = (columns + 2 * size_of::<[i32; 3]>()) as u64;
    let bytes = |points: u32, size: u64| size.saturating_add(u64::from(points) * point);
    let readable = tree.nodes.iter().filter(|n| n.readable);
    readable.map(|n| bytes(n.record.points, n.record.byte_size)).max().unwrap_or(0)
}

/// How much longer the cube is than the box of the points.
fn cube_over_extent(front: &Front, info: &Info) -> Option<f64> {
    let extent = front.bounds().into_iter().map(|[min, max]| max - min).fold(0.0, f64::max);
    (extent > 0.0).then(|| 2.0 * info.half_size / extent)
}
