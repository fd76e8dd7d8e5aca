//! Potree 2.0. `docs/formats/potree2.md` is the only source of what is expected.
//!
//! # Tolerances
//! * Boxes and the tight box: 4 ulps of the cube's largest coordinate on the axis; everything else about positions is
//!   exact, on integers.
//! * Distances (spacing, seams, coverage): of datasets that state their sampling, two units of 31-bit fractions of the
//!   cube, or nothing but the last bits of doubles where steps are whole numbers of them; of others, one step of the
//!   lattice.
//! * Sides of the cube against each other: 10⁻⁹, relative, and two ulps of its largest coordinate; spacing: any
//!   from side / 1024 to side / 16 is usual.
//! * Attributes, counts, byte ranges, checksums: none.
//!
//! # Memory
//! Nodes are streamed. What stays is the table of nodes (about 300 bytes each), for every thread the points of the
//! inner nodes on the path from the root (some megabytes) and a node as a whole, and a cache of half of what is left of
//! [`Options::memory_bytes`]. Fewer threads work where all do not fit.

mod checks;
mod nodes;
mod records;
mod tree;

use std::path::Path;

use pointmill_format::bytes::{ByteSource as _, Folder, read_file};
use pointmill_format::potree2::{Dataset, Encoding, METADATA_FILE, Metadata, Node, OCTREE_FILE};
use pointmill_format::{DatasetKind, ErrorKind, ReadError};
use serde_json::Value;

use crate::accuracy::{self, Known, Side};
use crate::against::{Against, Context, Rules};
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::memory::{self, Budget};
use crate::octree::expect::Geometry;
use crate::octree::first_view;
use crate::octree::lattices::Lattices;
use crate::octree::look::Look;
use crate::octree::spacing::Sampling;
use crate::octree::tree::{NODE_BYTES, Tree, TreeNode};
use crate::options::{Options, ProgressFn};
use crate::outcome::Outcome;
use crate::report;
use crate::surfels::{self, Derived};
use nodes::Nodes;
use records::Records;

/// More JSON than this is not metadata.
const MAX_METADATA_BYTES: u64 = 16 << 20;

/// Checks the dataset in `folder`.
///
/// # Errors
/// As [`crate::validate`].
pub(crate) fn run(folder: &Path, options: &Options, progress: &ProgressFn<'_>) -> Result<Outcome, ReadError> {
    let mut budget = Budget::new(folder, options.memory_bytes)?;
    let source = Folder::new(folder);
    let findings = Findings::new(DatasetKind::Potree2, options.max_problems);
    if let Some(missing) = missing(&source) {
        return Ok(incomplete(&missing, findings));
    }
    let metadata_bytes = tree::size_of(&source, METADATA_FILE)?;
    if metadata_bytes <= MAX_METADATA_BYTES {
        budget.require(metadata_bytes * memory::JSON)?;
    }
    let mut dataset = match Dataset::open(folder) {
        Ok(dataset) => dataset,
        Err(error) if error.is_io() => return Err(error),
        Err(error) => return unreadable_metadata(folder, findings, &error),
    };
    checks::metadata::check(&read_json(folder)?.unwrap_or_default(), &findings);
    let metadata = dataset.metadata();
    let geometry = geometry(metadata);
    let report = report::find(folder, &findings)?;
    let derived = Derived::of(report.as_ref(), &findings);
    let rules = rules(metadata, derived.as_ref());
    let against = match options.against.as_slice() {
        [] => None,
        paths => Some(Against::open(paths, &options.open, rules.clone())?),
    };

    let mut tree = tree::walk(&source, metadata.first_chunk_size, &budget, &findings)?;
    budget.take(tree.nodes.len() as u64 * NODE_BYTES)?;
    checks::structure::check(&tree, metadata.points, metadata.depth, &findings);
    let octree_bytes = tree::size_of(&source, OCTREE_FILE)?;
    let record_len = (metadata.encoding == Encoding::Default).then(|| metadata.record_len() as u64);
    checks::payload_ranges::check(&mut tree, octree_bytes, record_len, &findings);

    dataset.set_max_node_bytes(budget.left());
    unmask(&dataset, &mut tree, &findings)?;
    let metadata = dataset.metadata();
    let own = metadata.extra.get("pointmill").unwrap_or(&Value::Null);
    let lattices = Lattices::new(metadata.lattice, own);
    let nodes = Nodes::new(&dataset, geometry, lattices, against.as_ref().map(|a| &a.sums), &findings);
    let look = Look {
        folder,
        nodes: &nodes,
        tree: &tree,
        geometry,
        sampling: Sampling::from_word(own["sampling"].as_str()),
        no_coverage: None,
        node_bytes: largest_node(&tree, metadata),
        options,
        progress,
        findings: &findings,
    };
    let walked = look.at_all(&mut budget)?;
    let quality = look.quality(&walked);
    let (seen, deviation) = nodes.finish();
    checks::ranges::check(metadata, &geometry, &seen, walked.unreadable == 0, &findings);
    note_what_was_skipped(metadata, options, &findings);
    let records = Records { dataset: &dataset, tree: &tree };
    let context = Context { records: &records, findings: &findings, progress, budget: &budget };
    let summary = match &against {
        Some(against) => Some(against.compare(&context)?),
        None => None,
    };
    let is_measured = walked.unreadable == 0 && tree.nodes.iter().all(|n| n.readable);
    let surfels = match &derived {
        Some(derived) => surfels::Task {
            derived,
            rules: &rules,
            points: metadata.points,
            unread: (!is_measured).then(|| "not all nodes could be read".into()),
            uncertain: None,
            is_octahedral: false,
            against: against.as_ref(),
            threads: walked.threads,
        }
        .check(&context)?,
        None => None,
    };
    let position = metadata.attributes.iter().find(|a| a.attribute.name == "position");
    let known = Known {
        points: metadata.points,
        projection: &metadata.projection,
        bounds: position.and_then(|p| bounds_of(&p.min, &p.max)),
        lattice: against.as_ref().and_then(Against::measured).map(|m| m.lattice),
        format: is_measured.then_some(Side { deviation, lost: 0, merged: Some(0) }),
    };
    report::check(report.as_ref(), (metadata.points, tree.nodes.len() as u64), &findings);
    let accuracy = accuracy::judge(report.as_ref(), &known, &findings);
    Ok(Outcome {
        encoding: Some(metadata.encoding.name()),
        points: metadata.points,
        nodes: tree.nodes.len() as u64,
        quality,
        first_view: first_view::measure(&tree, metadata_bytes, cube_over_extent(metadata)),
        against: summary,
        surfels,
        accuracy,
        ..Outcome::new(findings)
    })
}

/// What records of the dataset have, and what is compared with the sources.
fn rules(metadata: &Metadata, derived: Option<&Derived>) -> Rules {
    let attributes = metadata.attributes.iter().map(|a| a.attribute.clone());
    let attributes = attributes.filter(|a| a.name != "position").collect();
    let own = metadata.extra.get("pointmill").unwrap_or(&Value::Null);
    let mut rules = Rules::new(attributes, metadata.lattice, own);
    rules.has_no_wide_integers = true;
    rules.set_apart(Derived::names_of(derived));
    rules
}

/// Payloads that claim far more than they hold are found out before memory is shared out by what they claim.
fn unmask(dataset: &Dataset, tree: &mut Tree, findings: &Findings) -> Result<(), ReadError> {
    for node in tree.nodes.iter_mut().filter(|n| n.readable) {
        let named = Node::new(node.key, node.record);
        if !dataset.is_doubtful(&named) {
            continue;
        }
        match dataset.check_payload(&named) {
            Err(error) if matches!(error.kind(), ErrorKind::Broken) => {
                let expected = format!("{} points", node.record.points);
                findings.push(Finding::new(Check::Payloads, "payload", expected, error.what()).at(node.key));
                node.readable = false;
            }
            other => other?,
        }
    }
    Ok(())
}

/// Bytes of the largest node in memory: as stored, decompressed, as columns and as positions.
fn largest_node(tree: &Tree, metadata: &Metadata) -> u64 {
    let unpacked = if metadata.encoding == Encoding::Brotli { metadata.planar_len() } else { 0 };
    let point = (metadata.record_len() + unpacked + 2 * size_of::<[i32; 3]>()) as u64;
    let bytes = |node: &TreeNode| node.record.byte_size.saturating_add(u64::from(node.record.points) * point);
    tree.nodes.iter().filter(|n| n.readable).map(bytes).max().unwrap_or(0)
}

fn bounds_of(min: &[f64], max: &[f64]) -> Option<[[f64; 2]; 3]> {
    let bounds: Vec<[f64; 2]> = min.iter().zip(max).map(|(min, max)| [*min, *max]).collect();
    bounds.try_into().ok()
}

/// `metadata.json` as a JSON value; `None` if it is none.
fn read_json(folder: &Path) -> Result<Option<Value>, ReadError> {
    let path = folder.join(METADATA_FILE);
    match read_file(&path, MAX_METADATA_BYTES) {
        Ok(bytes) => Ok(serde_json::from_slice(&bytes).ok()),
        Err(error) if error.kind() == std::io::ErrorKind::FileTooLarge => Ok(None), // the reader's error says so
        Err(error) => Err(ReadError::io(&path, "reading", error)),
    }
}

/// The files of the dataset that are not there; `None` if all are.
fn missing(source: &Folder) -> Option<Vec<&'static str>> {
    let is_missing = |file: &&str| source.size(file).is_err_and(|e| e.kind() == std::io::ErrorKind::NotFound);
    let missing: Vec<_> = DatasetKind::Potree2.required_files().iter().copied().filter(is_missing).collect();
    (!missing.is_empty()).then_some(missing)
}

/// The outcome for a dataset without some of its files.
fn incomplete(missing: &[&'static str], findings: Findings) -> Outcome {
    let about = |file: &str| if file == OCTREE_FILE { Check::PayloadRanges } else { Check::Hierarchy };
    for check in Check::POTREE2.iter().filter(|c| missing.iter().all(|file| about(file) != **c)) {
        findings.skip(*check, format!("{} is missing", missing.join(" and ")));
    }
    for file in missing {
        findings.push(Finding::new(about(file), *file, "a file of the dataset", "no such file"));
    }
    Outcome::new(findings)
}

/// The outcome for a dataset whose metadata is invalid.
fn unreadable_metadata(folder: &Path, findings: Findings, error: &ReadError) -> Result<Outcome, ReadError> {
    for check in Check::POTREE2.iter().copied().filter(|c| *c != Check::Metadata) {
        findings.skip(check, "metadata.json cannot be used");
    }
    if let Some(json) = read_json(folder)? {
        checks::metadata::check(&json, &findings);
    }
    if findings.found(Check::Metadata) == 0 {
        findings.push(Finding::new(Check::Metadata, "metadata.json", "valid metadata", error.what()));
    }
    Ok(Outcome::new(findings))
}

fn note_what_was_skipped(metadata: &Metadata, options: &Options, findings: &Findings) {
    if metadata.encoding == Encoding::Default {
        findings.skip(Check::Order, "only BROTLI requires an order");
    }
    if metadata.attributes.iter().all(|a| a.histogram.is_none()) {
        findings.skip(Check::Histogram, "there are none");
    }
    if options.against.is_empty() {
        findings.skip(Check::Against, "no sources were given");
    }
}

/// Distances of datasets that do not state their sampling may be a step of the lattice less.
fn geometry(metadata: &Metadata) -> Geometry {
    let Metadata { lattice, cube, spacing, .. } = *metadata;
    Geometry { lattice, cube, spacing, rounding: lattice.scale.into_iter().fold(0.0, f64::max) }
}

/// How much longer the cube is than the box of the points.
fn cube_over_extent(metadata: &Metadata) -> Option<f64> {
    let position = metadata.attributes.iter().find(|a| a.attribute.name == "position")?;
    let extent = position.min.iter().zip(&position.max).map(|(min, max)| max - min).fold(0.0, f64::max);
    (extent > 0.0).then(|| (metadata.cube.max[0] - metadata.cube.min[0]) / extent)
}
