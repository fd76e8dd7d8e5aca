//! Records that came in no order of space, grouped by cells of the octree once all are in: in few steps, each of which
//! reads and writes long runs.

use std::collections::HashMap;

use pointmill_format::NodeKey;

use super::context::CellPart;
use crate::cloud::{CellHash, RecordFrame, Regrouper, Segments, Store, TREE_BITS, morton, position};
use crate::error::ConvertError;
use crate::runtime::Runtime;

/// Levels by which records are divided in a step: a batch then has about a hundred in each cell, even of a volume.
const STEP_LEVELS: u32 = 3;

/// Records of a piece of work.
const PIECE_POINTS: u64 = 1 << 20;

/// Means to group records.
pub(super) struct Grouper<'a> {
    pub(super) store: &'a Store,
    pub(super) frame: &'a RecordFrame,
    pub(super) wants_moments: bool,
    pub(super) rt: &'a Runtime<'a>,
}

/// Records by the Morton code of their cell, all cells of one level.
type Parts = HashMap<u64, CellPart, CellHash>;

impl Grouper<'_> {
    /// Groups all of `records` by the octree cells of `level`.
    pub(super) fn group(&self, records: &Segments, level: u32) -> Result<Vec<(NodeKey, CellPart)>, ConvertError> {
        let mut parts = Parts::default();
        parts.entry(0).or_default().segments = records.clone();
        let mut at = 0;
        while at < level {
            at = (at + STEP_LEVELS).min(level);
            parts = self.step(parts, at, self.wants_moments && at == level)?;
        }
        Ok(parts.into_iter().map(|(code, part)| (node(code, level), part)).collect())
    }

    /// Divides the parts of a coarser level into cells of `level`.
    fn step(&self, parts: Parts, level: u32, wants_moments: bool) -> Result<Parts, ConvertError> {
        let mut parts: Vec<(u64, CellPart)> = parts.into_iter().collect();
        parts.sort_unstable_by_key(|(code, _)| *code);
        let pieces = pieces(parts.iter().map(|(_, part)| &part.segments));
        let shift = TREE_BITS - level;
        let each = self.rt.in_parallel(
            pieces.len(),
            || (Regrouper::for_all(self.store, self.frame.stride), Parts::default()),
            |(regrouper, found), piece| {
                let mut sums = Parts::default();
                let code = |record: &[u8]| {
                    let code = morton::path(self.frame.tree(record), shift, level);
                    if wants_moments {
                        sums.entry(code).or_default().moments.add(self.frame.origin.job(position(record)));
                    }
                    code
                };
                regrouper.regroup(&pieces[piece], code, |code, segment| {
                    found.entry(code).or_default().segments.push(segment);
                })?;
                sums.into_iter().for_each(|(code, part)| found.entry(code).or_default().merge(part));
                Ok(())
            },
            |(_, found)| found,
        )?;
        let mut all = Parts::default();
        for (code, part) in each.into_iter().flatten() {
            all.entry(code).or_default().merge(part);
        }
        Ok(all)
    }
}

/// Pieces of about equal size; those that belong together stay side by side.
fn pieces<'s>(parts: impl Iterator<Item = &'s Segments>) -> Vec<Segments> {
    let mut pieces = Vec::new();
    let (mut open, mut points) = (Segments::default(), 0);
    for segment in parts.flatten() {
        for part in segment.split(PIECE_POINTS as u32) {
            open.push(part);
            points += u64::from(part.count);
            if points >= PIECE_POINTS {
                pieces.push(std::mem::take(&mut open));
                points = 0;
            }
        }
    }
    pieces.extend((!open.is_empty()).then_some(open));
    pieces
}

/// The node of a level with that Morton code.
fn node(code: u64, level: u32) -> NodeKey {
    let child = |key: NodeKey, l: u32| key.child((code >> (3 * l) & 7) as u8).unwrap_or(key);
    (0..level).rev().fold(NodeKey::ROOT, child)
}
