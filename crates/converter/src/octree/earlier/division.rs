//! The units of an earlier tree, found again: which nodes were their roots follows from the points in each node, its own, those
//! below it, and those that the nodes above have taken.

use pointmill_format::NodeKey;

use super::nodes::{EarlierNodes, Scratch};
use crate::cloud::{TreePoint, morton};
use crate::error::ConvertError;
use crate::octree::list::{List, Writer};
use crate::octree::raise::Points;
use crate::octree::unit::Shared;
use crate::runtime::{Consumer, Reservation};

/// A subtree that one thread has built, or a node above subtrees.
pub(super) struct EarlierUnit {
    pub(super) key: NodeKey,
    /// In its cube.
    pub(super) points: u64,
    pub(super) is_above: bool,
    /// Those of its points that nodes above have taken, in no order.
    pub(super) taken: List,
}

/// The subtrees of at most `unit_points` and the nodes above, in no order. `None`: there is no memory for it.
pub(super) fn divide(
    nodes: &EarlierNodes<'_>,
    unit_points: u64,
    shared: &Shared<'_>,
) -> Result<Option<Vec<EarlierUnit>>, ConvertError> {
    let mut room = Reservation::new(&shared.rt.memory, Consumer::Work);
    let (mut units, mut scratch, mut records) = (Vec::new(), Scratch::default(), Vec::new());
    let (lists, stride) = (&shared.lists, shared.lists.stride);
    let mut open = vec![(NodeKey::ROOT, List::empty())];
    while let Some((key, taken)) = open.pop() {
        let all = nodes.points(key) + taken.count();
        if all <= unit_points {
            units.push(EarlierUnit { key, points: all, is_above: false, taken });
            continue;
        }
        shared.rt.check_stop()?;
        let here = nodes.own_points(key) + taken.count();
        if !room.try_resize(2 * here * stride as u64) {
            return Ok(None);
        }
        records.clear();
        nodes.records(key, &mut scratch, &mut records)?;
        lists.each(&taken, |piece| {
            records.extend_from_slice(piece);
            Ok(true)
        })?;
        let tree = |record: &[u8]| shared.plan.cloud.frame.tree(record);
        if !nodes.has_children(key) && is_one_place(records.chunks_exact(stride).map(tree)) {
            units.push(EarlierUnit { key, points: all, is_above: false, taken });
            continue;
        }
        let mut parts: Vec<Writer> = (0..8).map(|_| Writer::new(here)).collect();
        for record in records.chunks_exact(stride) {
            parts[usize::from(morton::child_index(tree(record), key.level))].push(record, lists)?;
        }
        for (child, part) in (0..8).filter_map(|c| key.child(c)).zip(parts) {
            let part = part.finish(lists)?;
            if nodes.points(child) + part.count() > 0 {
                open.push((child, part));
            }
        }
        units.push(EarlierUnit { key, points: all, is_above: true, taken });
    }
    Ok(Some(units))
}

/// True if all points share one place.
pub(super) fn is_one_place(mut points: impl Iterator<Item = TreePoint>) -> bool {
    let first = points.next();
    points.all(|point| Some(point) == first)
}
