//! The mean-split binary tree: upper splits from exact sums of cells, everything below in memory, leaves where they belong.
//!
//! 1. [`upper`] splits nodes that are too large for memory. A node is a list of cells whose sums and extremes are known
//!    from the one pass over the inputs, so axis and plane are exact without reading a point; only cells that the plane
//!    crosses are read, and divided.
//! 2. [`subtree`] takes what is small enough into memory, and partitions it down to leaves, one subtree a thread.
//! 3. [`leaf`] puts the points of a leaf in order and encodes them; [`files`] puts the bytes at their place, which is
//!    known from the number of points before them.
//!
//! Planes come from exact integers, so the tree is the same for any order of points, number of threads and memory.

mod files;
mod leaf;
mod order;
mod rule;
mod subtree;
mod upper;

use std::io::BufWriter;
use std::panic::AssertUnwindSafe;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use pointmill_format::bintree::{Header, INDEX_FILE, IndexWriter, Layout, Node, NodeKind};
use pointmill_format::{Aabb, Lattice};

use self::files::Leaves;
use self::leaf::Columns;
use self::subtree::{Builder, Built};
use self::upper::Upper;
use crate::build::chunk::Accounts;
use crate::convert::Run;
use crate::describe::name_of;
use crate::error::ConvertError;
use crate::plan::BintreeSettings;
use crate::report::{OutputReport, TreeReport};
use crate::write::dataset::StagedDataset;

/// Tasks of this size keep all threads busy to the end, and few cells are cut above them.
const MAX_TASK_POINTS: u64 = 2_000_000;

/// So many files are slow to write, to copy and to list.
const MANY_FILES: usize = 20_000;

/// Builds and writes the dataset.
pub(crate) fn write(
    run: &Run<'_>,
    settings: &BintreeSettings,
    staged: &StagedDataset,
) -> Result<OutputReport, ConvertError> {
    let columns = Columns::choose(run)?;
    let bytes_per_point = Builder::bytes_per_point(run.job.schema.stride, &columns.record, settings.capacity);
    let task_points = run.budget.task_points(bytes_per_point, MAX_TASK_POINTS);
    let upper = upper::split(run, settings, task_points)?;
    for task in &upper.tasks {
        run.budget.check_task(task.points(), task_points, bytes_per_point)?;
    }
    let leaves = Leaves::new(settings.layout, columns.record.stride(), staged)?;
    let built = build(run, settings, &columns, &upper, &leaves)?;
    let leaf_bytes = leaves.finish(run.pool)?;

    let mut accounts = Accounts::default();
    built.iter().for_each(|b| accounts.merge(&b.accounts));
    run.account(accounts.unaltered())?;
    let nodes = assemble(&upper, built);
    let index_bytes = write_index(run, settings, &columns, &nodes, staged)?;
    let told = describe(&nodes);
    let mut warnings = Vec::new();
    let leaves = nodes.iter().filter(|n| n.is_leaf()).count();
    if settings.layout == Layout::Files && leaves > MANY_FILES {
        warnings.push(format!("{leaves} files, one a leaf: --layout packed puts them into one"));
    }
    Ok(OutputReport {
        points: nodes.first().map_or(0, |root| root.count),
        attributes: columns.names(),
        attributes_dropped: columns.dropped,
        bytes: leaf_bytes + index_bytes,
        checksum: accounts.unaltered().to_string(),
        tree: told.0,
        details: told.1,
        warnings,
        ..OutputReport::default()
    })
}

/// Builds all subtrees, in parallel; they come back in order.
fn build(
    run: &Run<'_>,
    settings: &BintreeSettings,
    columns: &Columns,
    upper: &Upper,
    leaves: &Leaves,
) -> Result<Vec<Built>, ConvertError> {
    let next = AtomicUsize::new(0);
    let failed: Mutex<Option<(usize, ConvertError)>> = Mutex::new(None);
    let done: Mutex<Vec<Option<Built>>> = Mutex::new((0..upper.tasks.len()).map(|_| None).collect());
    run.pool.broadcast(|_| {
        let mut builder = Builder::new(run, settings, columns, leaves);
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(task) = upper.tasks.get(index) else { break };
            if failed.lock().is_ok_and(|f| f.is_some()) {
                break;
            }
            let result = if run.events.stop_requested() {
                Err(ConvertError::Interrupted)
            } else {
                let build = AssertUnwindSafe(|| builder.build(task));
                std::panic::catch_unwind(build)
                    .unwrap_or_else(|_| Err(ConvertError::Internal(format!("building subtree {index} failed"))))
            };
            match (result, done.lock(), failed.lock()) {
                (Ok(built), Ok(mut done), _) => done[index] = Some(built),
                (Err(error), _, Ok(mut failed)) if failed.as_ref().is_none_or(|(i, _)| index < *i) => {
                    *failed = Some((index, error));
                }
                _ => {}
            }
            run.events.advance(task.points());
        }
    });
    if let Ok(Some((_, error))) = failed.into_inner() {
        return Err(error);
    }
    let done = done.into_inner().unwrap_or_default();
    let lost = || ConvertError::Internal("a subtree was not built".into());
    done.into_iter().map(|b| b.ok_or_else(lost)).collect()
}

/// A node above the subtrees, until what is below it is complete.
struct Open {
    node: usize,
    waits_for_high: bool,
}

/// Puts the upper nodes and the subtrees together, in preorder.
fn assemble(upper: &Upper, built: Vec<Built>) -> Vec<Node> {
    let mut nodes: Vec<Node> =
        Vec::with_capacity(upper.splits.len() + built.iter().map(|b| b.nodes.len()).sum::<usize>());
    let mut open: Vec<Open> = Vec::new();
    let mut built = built.into_iter();
    for entry in &upper.splits {
        if let Some(split) = entry {
            open.push(Open { node: nodes.len(), waits_for_high: false });
            let kind = NodeKind::Inner { axis: split.axis, split: split.plane, high: 0 };
            nodes.push(Node { bounds: Aabb::EMPTY, count: split.points, kind });
            continue;
        }
        let first = nodes.len();
        let Some(subtree) = built.next() else { break };
        nodes.extend(subtree.nodes.into_iter().map(|node| moved(node, first as u32)));
        let mut bounds = nodes.get(first).map_or(Aabb::EMPTY, |n| n.bounds);
        // Whatever is complete now gives its box to the node above.
        while let Some(top) = open.last_mut() {
            let above = &mut nodes[top.node].bounds;
            *above = above.union(&bounds);
            bounds = *above;
            if !top.waits_for_high {
                top.waits_for_high = true;
                let next = nodes.len() as u32;
                if let NodeKind::Inner { high, .. } = &mut nodes[top.node].kind {
                    *high = next;
                }
                break;
            }
            open.pop();
        }
    }
    nodes
}

/// A node of a subtree whose first node gets the index `by`.
fn moved(mut node: Node, by: u32) -> Node {
    if let NodeKind::Inner { high, .. } | NodeKind::Degenerate { high } = &mut node.kind {
        *high += by;
    }
    node
}

fn write_index(
    run: &Run<'_>,
    settings: &BintreeSettings,
    columns: &Columns,
    nodes: &[Node],
    staged: &StagedDataset,
) -> Result<u64, ConvertError> {
    let Run { plan, job, facts, .. } = *run;
    let Lattice { scale, offset } = job.lattice;
    let header = Header {
        generator: format!("pointmill {}", env!("CARGO_PKG_VERSION")),
        name: name_of(plan),
        points: nodes.first().map_or(0, |root| root.count),
        capacity: u64::from(settings.capacity),
        layout: settings.layout,
        split: settings.split,
        origin: nodes.first().map_or([0.0; 3], |root| root.bounds.min.map(f64::floor)),
        projection: facts.crs.projection.clone(),
        lattice: Lattice { scale, offset },
        pointmill: facts.own_key(plan, job, &columns.dropped),
        record: columns.record.clone(),
    };
    let (file, path) = staged.create(INDEX_FILE)?;
    let fail = |e| ConvertError::io(&path, "writing the index", e);
    let mut index = IndexWriter::new(BufWriter::with_capacity(1 << 20, file), &header).map_err(fail)?;
    for node in nodes {
        index.node(node).map_err(fail)?;
    }
    let file = index.finish().map_err(fail)?.into_inner().map_err(|e| fail(e.into_error()))?;
    file.sync_all().map_err(fail)?;
    Ok(file.metadata().map_err(fail)?.len())
}

/// Counts by depth, and the figures that the choice of a splitting rule is judged by.
fn describe(nodes: &[Node]) -> (TreeReport, serde_json::Map<String, serde_json::Value>) {
    let mut tree = TreeReport { nodes: nodes.len() as u64, ..TreeReport::default() };
    let (mut leaves, mut smallest, mut volume, mut degenerate) = (0u64, u64::MAX, 0.0, 0u64);
    let mut depth_of = vec![0usize; nodes.len()];
    for (i, node) in nodes.iter().enumerate() {
        let depth = depth_of[i];
        if let Some(high) = node.high() {
            for child in [i + 1, high as usize] {
                if let Some(d) = depth_of.get_mut(child) {
                    *d = depth + 1;
                }
            }
            degenerate += u64::from(matches!(node.kind, NodeKind::Degenerate { .. }));
        }
        if tree.nodes_per_level.len() <= depth {
            tree.nodes_per_level.resize(depth + 1, 0);
            tree.points_per_level.resize(depth + 1, 0);
        }
        tree.nodes_per_level[depth] += 1;
        if node.is_leaf() {
            tree.points_per_level[depth] += node.count;
            tree.largest_leaf = tree.largest_leaf.max(node.count);
            smallest = smallest.min(node.count);
            leaves += 1;
            volume += node.bounds.extent().iter().product::<f64>();
        }
    }
    tree.depth = tree.nodes_per_level.len().saturating_sub(1) as u32;
    let points: u64 = tree.points_per_level.iter().sum();
    let details = serde_json::json!({
        "leaves": leaves,
        "smallest_leaf": if leaves == 0 { 0 } else { smallest },
        "mean_leaf": points as f64 / leaves.max(1) as f64,
        "leaf_volume": volume,
        "degenerate_nodes": degenerate,
    });
    (tree, details.as_object().cloned().unwrap_or_default())
}
