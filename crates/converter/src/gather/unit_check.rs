//! Whether what a job has kept of a unit can be of this run. Its checksums say that it is as it was written, not by whom; and the
//! places that it names are looked up without being asked for again.

use std::ops::Range;

use super::context::{CellPart, Collected, Context};
use super::read_unit::Kept;
use crate::cloud::{Segment, SourceStats};

impl Kept {
    /// True if it can be what this run would make of these pairs: every place that it names is there, and so is what it counts.
    pub(super) fn can_be_of(&self, context: &Context<'_>, pairs: &Range<usize>) -> bool {
        let schema = &context.intake.schema;
        let is_source = |(source, seen): &(u32, SourceStats)| {
            (*source as usize) < context.sources.all.len() && seen.can_be_of(schema)
        };
        self.pairs == *pairs
            && self.stats.can_be_of(schema)
            && self.seen.iter().all(is_source)
            && self.has_segments(context.intake.schema.stride)
            && self.has_points(context)
    }

    /// True if every segment is within a block.
    fn has_segments(&self, stride: usize) -> bool {
        let records: Option<Vec<u32>> = self.blocks.iter().map(|block| block.records(stride)).collect();
        let is_there = |segment: &Segment| {
            let block = records.as_ref().and_then(|records| records.get(segment.block as usize));
            segment.count > 0 && block.is_some_and(|records| segment.end() <= u64::from(*records))
        };
        let Collected { cells, loose, .. } = &self.collected;
        records.is_some() && cells.values().map(|part| &part.segments).chain([loose]).flatten().all(is_there)
    }

    /// True if segments, cells and the census have the points of the unit; not all of them once the pass was misled.
    fn has_points(&self, context: &Context<'_>) -> bool {
        let Collected { cells, loose, census, segments } = &self.collected;
        let level = context.partition.level;
        let is_cell = |(code, part): (&u64, &CellPart)| {
            let moments = &part.moments;
            code >> (3 * level) == 0
                && (!context.wants_moments || moments.can_be_of(part.segments.points(), &self.stats.bounds))
        };
        let lists = cells.values().map(|part| &part.segments).chain([loose]);
        let points: u128 = lists.map(|list| u128::from(list.points())).sum();
        let Ok(points) = u64::try_from(points) else { return false };
        (points == self.stats.points || self.misled && points < self.stats.points)
            && cells.iter().all(is_cell)
            && *segments <= points
            && census.can_be_of(if context.partition.has_cells() { points } else { 0 }, level)
    }
}
