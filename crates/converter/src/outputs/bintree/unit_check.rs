//! Whether what a unit has left can be of its task: the nodes are a tree with its points, and the bytes belong to their leaves.

use pointmill_format::Aabb;
use pointmill_format::bintree::{MAX_DEPTH, Node, NodeKind};

use super::files::{Leaf, Place};
use super::subtree::Built;
use super::upper::Task;
use crate::job::Said;

/// True if it can be of the task. `stride`: bytes of a point; `is_packed`: all leaves are in one file.
pub(super) fn can_be_of(said: &Said<Place, Built>, task: &Task, stride: u64, is_packed: bool) -> bool {
    let Built { nodes, ledger, deviations, lost } = &said.came_to;
    let points = task.points();
    let Some(leaves) = leaves(nodes, task, is_packed.then_some(stride)) else { return false };
    let in_place = || said.in_place.iter().flatten();
    let mut parts: Vec<(&Place, u64)> = said.belong.iter().map(|(place, bytes)| (place, *bytes)).collect();
    parts.extend(in_place().map(|(place, at)| (place, at.bytes)));
    let is_part = |(place, bytes): &(&Place, u64)| bytes.is_multiple_of(stride) && place.is_in(&leaves, bytes / stride);
    if !parts.iter().all(is_part) {
        return false;
    }
    parts.sort_unstable_by_key(|(place, _)| place.first_point());
    // each where the one before ends: all points, and none twice
    let end = parts
        .iter()
        .try_fold(task.start, |next, (place, bytes)| (place.first_point() == next).then_some(next + bytes / stride));
    end == Some(task.start + points)
        && in_place().all(|(place, at)| place.offset(stride, is_packed) == at.offset)
        && ledger.can_be_of(points)
        && [deviations.points, lost.points, lost.merged].iter().all(|count| *count <= points)
}

/// The leaves in order, if the nodes are a tree in preorder with the points of the task. `stride`: if leaves are in one file.
fn leaves(nodes: &[Node], task: &Task, stride: Option<u64>) -> Option<Vec<Leaf>> {
    if sum(nodes)? != task.points() {
        return None;
    }
    let (mut leaves, mut start) = (Vec::new(), task.start);
    // of nodes that have not come yet, the next last: the path, and where it is to be
    let mut coming = vec![(task.path.clone(), 0)];
    for (index, node) in nodes.iter().enumerate() {
        let (path, _) = coming.pop().filter(|(path, at)| *at == index && path.len() <= MAX_DEPTH)?;
        if let Some(high) = node.high() {
            let child = |is_high: bool| [&path[..], &[is_high]].concat();
            coming.extend([(child(true), high as usize), (child(false), index + 1)]);
            continue;
        }
        let byte = stride.map(|stride| start * stride);
        if !matches!(node.kind, NodeKind::Leaf { start, .. } if start == byte) {
            return None;
        }
        leaves.push(Leaf { path, start, points: node.count });
        start += node.count;
    }
    coming.is_empty().then_some(leaves)
}

/// Points of nodes in preorder, if those above have as many as those below them, and the box around theirs.
fn sum(nodes: &[Node]) -> Option<u64> {
    let mut roots: Vec<(u64, Aabb)> = Vec::new();
    for node in nodes.iter().rev() {
        let is_sound = match node.kind {
            // an offset from the center, which lies between the extremes, is rounded to the same side of it
            NodeKind::Leaf { center, .. } => is_finite(&node.bounds) && node.bounds.contains(center),
            NodeKind::Inner { .. } | NodeKind::Degenerate { .. } => {
                let [(low, low_box), (high, high_box)] = [roots.pop()?, roots.pop()?];
                low.checked_add(high) == Some(node.count) && low_box.union(&high_box) == node.bounds
            }
        };
        if !is_sound {
            return None;
        }
        roots.push((node.count, node.bounds));
    }
    roots.pop().filter(|_| roots.is_empty()).map(|(points, _)| points)
}

fn is_finite(bounds: &Aabb) -> bool {
    bounds.min.iter().chain(&bounds.max).all(|v| v.is_finite())
}
