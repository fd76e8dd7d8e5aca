//! Records grouped by cells of the octree once all are in: those of a cube that nobody promised, and those that came in no
//! order of space.

use pointmill_format::NodeKey;

use super::context::{CellPart, CellParts, Collected};
use crate::cloud::{Moments, RecordFrame, Regrouper, Segments, Sifted, Store, TREE_BITS, morton, node, position};
use crate::error::ConvertError;
use crate::runtime::{Consumer, Reservation, Runtime};

/// Levels by which records are divided in a step: a batch then has about a hundred in each cell, even of a volume.
const STEP_LEVELS: u32 = 3;

/// Records of a piece of work.
const PIECE_POINTS: u64 = 1 << 20;

/// Batches with fewer points in a cell stay as they are, until all records are in and can be grouped together.
pub(super) const LOOSE_POINTS_PER_SEGMENT: usize = 32;

/// Means to group records.
pub(super) struct Grouper<'a> {
    pub(super) store: &'a Store,
    pub(super) frame: &'a RecordFrame,
    pub(super) wants_moments: bool,
    pub(super) rt: &'a Runtime<'a>,
}

impl Grouper<'_> {
    /// Does with records in the order in which they were read what could not be done then, as the cube was not known: they
    /// are counted by cells of `level`, and grouped by these where batches have enough in a cell.
    pub(super) fn sift(&self, records: &Segments, level: u32) -> Result<(Collected, Reservation), ConvertError> {
        let pieces = pieces(std::iter::once(records));
        let each = self.rt.in_parallel(
            pieces.len(),
            || {
                let room = Reservation::new(&self.rt.memory, Consumer::Cells);
                (Regrouper::for_all(self.store, self.frame.stride, records.points()), Collected::default(), room)
            },
            |(regrouper, found, room), piece| {
                let code = |record: &[u8]| morton::path(self.frame.tree(record), TREE_BITS - level, level);
                regrouper.sift(&pieces[piece], LOOSE_POINTS_PER_SEGMENT, code, |sifted| match sifted {
                    Sifted::Group { code, segment, records } => {
                        found.add(code, segment, |moments| self.add_moments(moments, records));
                    }
                    Sifted::Loose { segment, codes } => found.leave(segment, codes.iter().copied()),
                })?;
                room.resize(found.bytes())
            },
            |(_, found, room)| (found, room),
        )?;
        let (mut all, mut room) = (Collected::default(), Reservation::new(&self.rt.memory, Consumer::Cells));
        for (found, taken) in each {
            all.merge(found);
            room.merge(taken);
        }
        Ok((all, room))
    }

    /// Groups all of `records` by the octree cells of `level`, in few steps, each of which reads and writes long runs.
    pub(super) fn group(&self, records: &Segments, level: u32) -> Result<Vec<(NodeKey, CellPart)>, ConvertError> {
        let mut parts = CellParts::default();
        parts.entry(0).or_default().segments = records.clone();
        let mut at = 0;
        while at < level {
            at = (at + STEP_LEVELS).min(level);
            parts = self.step(parts, at, self.wants_moments && at == level)?;
        }
        Ok(parts.into_iter().map(|(code, part)| (node(code, level), part)).collect())
    }

    /// Divides the parts of a coarser level into cells of `level`.
    fn step(&self, parts: CellParts, level: u32, wants_moments: bool) -> Result<CellParts, ConvertError> {
        let mut parts: Vec<(u64, CellPart)> = parts.into_iter().collect();
        parts.sort_unstable_by_key(|(code, _)| *code);
        let pieces = pieces(parts.iter().map(|(_, part)| &part.segments));
        let points = parts.iter().map(|(_, part)| part.segments.points()).sum();
        let each = self.rt.in_parallel(
            pieces.len(),
            || (Regrouper::for_all(self.store, self.frame.stride, points), CellParts::default()),
            |(regrouper, found), piece| {
                let code = |record: &[u8]| morton::path(self.frame.tree(record), TREE_BITS - level, level);
                regrouper.sift(&pieces[piece], 0, code, |sifted| {
                    if let Sifted::Group { code, segment, records } = sifted {
                        let part: &mut CellPart = found.entry(code).or_default();
                        part.segments.push(segment);
                        if wants_moments {
                            self.add_moments(&mut part.moments, records);
                        }
                    }
                })
            },
            |(_, found)| found,
        )?;
        let mut all = CellParts::default();
        for (code, part) in each.into_iter().flatten() {
            all.entry(code).or_default().merge(part);
        }
        Ok(all)
    }

    fn add_moments(&self, moments: &mut Moments, records: &[u8]) {
        if self.wants_moments {
            let points = records.chunks_exact(self.frame.stride).map(|record| self.frame.origin.job(position(record)));
            points.for_each(|q| moments.add(q));
        }
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
