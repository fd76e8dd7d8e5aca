//! Whether what a job has kept of a unit can be of this run. Its checksums say that it is as it was written, not by whom; and the
//! places that it names are looked up without being asked for again.

use super::context::{CellPart, Collected, Context};
use crate::cloud::{SafeBlock, Segment, SourceStats, Stats};

/// A unit as it was found, its blocks counted from its first.
pub(super) struct Found<'a> {
    pub(super) stats: &'a Stats,
    pub(super) collected: &'a Collected,
    pub(super) seen: &'a [(u32, SourceStats)],
    pub(super) blocks: &'a [SafeBlock],
    /// Not all points are there.
    pub(super) misled: bool,
}

impl Found<'_> {
    /// True if every place that it names is there, and what it counts can be.
    pub(super) fn can_be_of(&self, context: &Context<'_>) -> bool {
        let schema = &context.intake.schema;
        let is_source = |(source, seen): &(u32, SourceStats)| {
            (*source as usize) < context.sources.all.len() && seen.can_be_of(schema)
        };
        self.stats.can_be_of(schema) && self.seen.iter().all(is_source) && self.holds_records(context)
    }

    fn holds_records(&self, context: &Context<'_>) -> bool {
        let Collected { cells, loose, census, segments } = self.collected;
        let (sources, stride, level) =
            (context.sources.all.len(), context.intake.schema.stride, context.partition.level);
        let records: Option<Vec<u32>> = self.blocks.iter().map(|block| block.records(stride, sources)).collect();
        let Some(records) = records else { return false };
        let is_there = |segment: &Segment| {
            let records = records.get(segment.block as usize);
            segment.count > 0 && records.is_some_and(|records| segment.end() <= u64::from(*records))
        };
        let lists = || cells.values().map(|part| &part.segments).chain([loose]);
        if !lists().flatten().all(is_there) {
            return false;
        }
        let all: u128 = lists().map(|list| u128::from(list.points())).sum();
        let points = u64::try_from(all).unwrap_or(u64::MAX);
        let is_cell = |(code, part): (&u64, &CellPart)| {
            let moments = &part.moments;
            code >> (3 * level) == 0
                && (!context.wants_moments || moments.can_be_of(part.segments.points(), &self.stats.bounds))
        };
        cells.iter().all(is_cell)
            && (self.misled || points == self.stats.points)
            && points <= self.stats.points
            && *segments <= points
            && census.can_be_of(if context.partition.has_cells() { points } else { 0 }, level)
    }
}
