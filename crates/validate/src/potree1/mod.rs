//! Potree 1.x. `docs/formats/potree1.md` is the only source of what is expected.
//!
//! # Tolerances
//! * Boxes and the tight box: a step of stored positions, and 4 ulps of the cube's largest coordinate on the axis.
//! * Distances (spacing, seams, coverage): of datasets that state their sampling, two units of 31-bit fractions of the
//!   cube; of others, two steps on each axis: writers truncate, and corners of nodes are no whole steps.
//! * Sides of the cube against each other: 10⁻⁹, relative, and two ulps of its largest coordinate.
//! * Counts, files, attributes: none.
//!
//! # Memory
//! Nodes are streamed. What stays is the table of files and of nodes (about 400 bytes each), and what the
//! [walk](crate::octree::walk) takes.

mod expect;
mod files;
mod index;
mod metadata;
mod nodes;
mod records;
mod steps;
mod store;
mod structure;

use std::path::Path;
use std::sync::Mutex;

use pointmill_format::bytes::try_resize;
use pointmill_format::octree::Octree as _;
use pointmill_format::potree1::{Dataset, METADATA_FILE, Metadata, NodeFiles};
use pointmill_format::{Aabb, DatasetKind, NodeKey, ReadError};
use serde_json::Value;

use crate::accuracy::{self, Known, Side};
use crate::against::{Against, Context};
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::memory::{self, Budget};
use crate::octree::first_view;
use crate::octree::look::Look;
use crate::octree::spacing::Sampling;
use crate::octree::tree::{NODE_BYTES, Tree};
use crate::options::{Options, ProgressFn};
use crate::outcome::Outcome;
use crate::report;
use crate::surfels::{self, Derived};
use expect::Names;
use files::Files;
use index::Index;
use nodes::Nodes;
use records::{Normals, Records};
use steps::Steps;
use store::Store;

/// More JSON than this is not metadata.
const MAX_METADATA_BYTES: u64 = 256 << 20;

/// Checks the dataset in `folder`, or in the archive that it is.
///
/// # Errors
/// As [`crate::validate`].
pub(crate) fn run(folder: &Path, options: &Options, progress: &ProgressFn<'_>) -> Result<Outcome, ReadError> {
    let mut budget = Budget::new(folder, options.memory_bytes)?;
    let store = Store::open(folder, &mut budget)?;
    let findings = Findings::new(DatasetKind::Potree1, options.max_problems);
    let bytes = metadata_bytes(&store, folder, &budget)?;
    let json: Option<Value> = serde_json::from_slice(&bytes).ok();
    let mut dataset = match Dataset::open(folder) {
        Ok(dataset) => dataset,
        Err(error) if error.is_io() => return Err(error),
        Err(error) => return Ok(unreadable(json.as_ref(), findings, &error)),
    };
    metadata::check(json.as_ref(), &findings);
    let own = dataset.metadata().extra.get("pointmill").cloned().unwrap_or(Value::Null);
    let steps = steps_of(dataset.metadata(), &own);
    let geometry = steps.geometry(dataset.metadata().spacing);
    let report = report::find(folder, &findings)?;
    let derived = Derived::of(report.as_ref(), &findings);
    let (mut rules, columns) = records::rules(&dataset, &steps, &own, Normals::IfExact);
    rules.set_apart(Derived::names_of(derived.as_ref()));
    let against = match options.against.as_slice() {
        [] => None,
        paths => Some(Against::open(paths, &options.open, rules)?),
    };

    let tree = tree(&store, &dataset, &mut budget, &findings)?;
    dataset.set_max_node_bytes(budget.left());
    let metadata = dataset.metadata();
    let most_points = own["maxNodePoints"].as_u64();
    let nodes = Nodes {
        dataset: &dataset,
        most_points,
        geometry,
        steps: &steps,
        sums: against.as_ref().map(|a| (&a.sums, &columns)),
        findings: &findings,
        seen: Mutex::new(Aabb::EMPTY),
        deviations: Default::default(),
    };
    let look = Look {
        folder,
        nodes: &nodes,
        tree: &tree,
        geometry,
        sampling: Sampling::from_word(own["sampling"].as_str()),
        no_coverage: most_points.map(|_| "nodes hold so many points at most: what finds no room is drawn further down"),
        node_bytes: largest_node(&tree, &dataset),
        options,
        progress,
        findings: &findings,
    };
    let walked = look.at_all(&mut budget)?;
    let quality = look.quality(&walked);
    let (seen, deviation) = nodes.finish();
    let is_complete = walked.unreadable == 0 && tree.nodes.iter().all(|n| n.readable);
    nodes::tight_box(&dataset, &geometry, &seen, is_complete, &findings);
    if metadata.files != NodeFiles::Bin {
        findings.skip(Check::Coordinates, "LAS files have coordinates of their own");
    }
    let (dataset, tree, steps) = (&dataset, &tree, &steps);
    let summary = match &against {
        Some(against) => {
            let records = &Records { dataset, tree, steps, columns: &columns };
            let summary = against.compare(&Context { records, findings: &findings, progress, budget: &budget })?;
            if !steps.is_stated() {
                let why = "positions are not compared: cloud.js does not state the lattice of the run";
                findings.note(Check::Against, why);
            }
            Some(summary)
        }
        None => {
            findings.skip(Check::Against, "no sources were given");
            None
        }
    };

    let points = tree.nodes.iter().map(|n| u64::from(n.record.points)).sum();
    let surfels = match &derived {
        Some(derived) => {
            let (rules, columns) = records::rules(dataset, steps, &own, Normals::Always);
            let task = surfels::Task {
                derived,
                rules: &rules,
                points,
                unread: (!is_complete).then(|| "not all nodes could be read".into()),
                uncertain: (!steps.is_stated()).then(|| "cloud.js does not state the lattice of the run".into()),
                is_octahedral: metadata.files == NodeFiles::Bin && !records::has_floats(dataset),
                against: against.as_ref(),
                threads: walked.threads,
            };
            let records = &Records { dataset, tree, steps, columns: &columns };
            task.check(&Context { records, findings: &findings, progress, budget: &budget })?
        }
        None => None,
    };
    let known = Known {
        points,
        projection: &metadata.projection,
        bounds: metadata.tight_box.map(|b| [0, 1, 2].map(|a| [b.min[a], b.max[a]])),
        lattice: against.as_ref().filter(|_| steps.is_stated()).and_then(Against::measured).map(|m| m.lattice),
        format: (is_complete && steps.is_stated()).then_some(Side { deviation, lost: 0, merged: Some(0) }),
    };
    report::check(report.as_ref(), (points, tree.nodes.len() as u64), &findings);
    let accuracy = accuracy::judge(report.as_ref(), &known, &findings);
    Ok(Outcome {
        encoding: Some(encoding(metadata)),
        points: metadata.points.unwrap_or(points),
        nodes: tree.nodes.len() as u64,
        quality,
        first_view: first_view::measure(tree, bytes.len() as u64, cube_over_extent(metadata)),
        against: summary,
        surfels,
        accuracy,
        ..Outcome::new(findings)
    })
}

/// `cloud.js`.
fn metadata_bytes(store: &Store, folder: &Path, budget: &Budget) -> Result<Vec<u8>, ReadError> {
    let size = store.size(METADATA_FILE)?;
    if size > MAX_METADATA_BYTES {
        let error = std::io::ErrorKind::FileTooLarge.into();
        return Err(ReadError::io(folder.join(METADATA_FILE), "reading", error));
    }
    budget.require(size * memory::JSON)?;
    let mut bytes = Vec::new();
    try_resize(&mut bytes, size).map_err(|e| ReadError::io(folder.join(METADATA_FILE), "reading", e))?;
    store.read_at(METADATA_FILE, 0, &mut bytes, "reading")?;
    Ok(bytes)
}

/// The outcome for a dataset whose metadata is invalid.
fn unreadable(json: Option<&Value>, findings: Findings, error: &ReadError) -> Outcome {
    for check in Check::POTREE1.iter().copied().filter(|c| *c != Check::Cloud) {
        findings.skip(check, "cloud.js cannot be used");
    }
    if json.is_some() {
        metadata::check(json, &findings);
    }
    if findings.found(Check::Cloud) == 0 {
        findings.push(Finding::new(Check::Cloud, METADATA_FILE, "valid metadata", error.what()));
    }
    Outcome::new(findings)
}

fn steps_of(metadata: &Metadata, own: &Value) -> Steps {
    let scale = (metadata.files == NodeFiles::Bin).then_some(metadata.scale);
    Steps::new(metadata.cube, scale, metadata.scale, own)
}

/// The tree by index and files.
fn tree(store: &Store, dataset: &Dataset, budget: &mut Budget, findings: &Findings) -> Result<Tree, ReadError> {
    let metadata = dataset.metadata();
    let names = Names {
        octree_dir: metadata.octree_dir.clone(),
        step: metadata.step,
        extension: metadata.files.extension(),
        has_folders: metadata.minor >= 5,
    };
    let files = Files::look(store, &names, budget, findings)?;
    let list = metadata.nodes.as_ref().filter(|_| !files.indexes.contains_key(&NodeKey::ROOT));
    let indexed = match list {
        Some(list) => index::listed(list, findings),
        None => Index { store, names: &names, files: &files, budget, findings }.walk()?,
    };
    budget.take(indexed.len() as u64 * NODE_BYTES)?;
    structure::tree(&indexed, &files, dataset, findings)
}

/// Bytes of the largest node in memory: as stored, as columns and as positions.
fn largest_node(tree: &Tree, dataset: &Dataset) -> u64 {
    let columns: usize = dataset.info().attributes.iter().map(|a| a.size()).sum();
    let point = (columns + 2 * size_of::<[i32; 3]>() + size_of::<[i64; 3]>()) as u64;
    let bytes = |points: u32, size: u64| size.saturating_add(u64::from(points) * point);
    let readable = tree.nodes.iter().filter(|n| n.readable);
    readable.map(|n| bytes(n.record.points, n.record.byte_size)).max().unwrap_or(0)
}

/// What files of nodes are, as a word.
fn encoding(metadata: &Metadata) -> &'static str {
    metadata.files.extension().trim_start_matches('.')
}

/// How much longer the cube is than the box of the points.
fn cube_over_extent(metadata: &Metadata) -> Option<f64> {
    let extent = metadata.tight_box?.extent().into_iter().fold(0.0, f64::max);
    (extent > 0.0).then(|| (metadata.cube.max[0] - metadata.cube.min[0]) / extent)
}
