//! From a batch of columns to a block of records grouped by cell.

use std::sync::atomic::Ordering;

use pointmill_format::{Column, PointBatch, Positions};

use super::assemble::{Assembler, Assembly, Rows};
use super::axis::{Moved, SourceMap};
use super::columns::Part;
use super::context::{Collected, Context};
use super::loose::LOOSE_POINTS_PER_SEGMENT;
use super::partition::morton_of;
use super::visit::Visit;
use super::{exact, moved, ranges, select};
use crate::cloud::{BLOCK_BYTES, Group, Grouping, JobBounds, JobColumns, Segment, Stats};
use crate::error::ConvertError;
use crate::runtime::{Consumer, Reservation, Vectors, os_hints, vectorized};

/// A batch is taken in slices of this many points, whose columns stay in the second-level cache while they are
/// gathered cell by cell.
const SLICE_POINTS: usize = 8_192;

/// Points in no spatial order touch many cells; whole batches are then grouped at once, or the lists of segments would
/// grow as large as the points.
const MIN_POINTS_PER_SEGMENT: usize = 64;

/// One thread's part of the pass.
pub(super) struct Worker<'a> {
    pass: &'a Context<'a>,
    pub(super) stats: Stats,
    collected: Collected,
    room: Reservation,
    q: JobColumns,
    /// See [`exact::marks`]; empty if they are not needed.
    marks: Vec<u64>,
    /// To where points were seen from.
    directions: Vec<[f32; 3]>,
    change: [Vec<f64>; 3],
    selection: Vec<u32>,
    cells: Vec<u64>,
    grouping: Grouping,
    assembler: Assembler,
    /// The block that is being filled, and its records so far.
    open: Option<OpenBlock>,
    records: Vec<u8>,
}

struct OpenBlock {
    index: u32,
    group: Group,
}

impl<'a> Worker<'a> {
    pub(super) fn new(pass: &'a Context<'a>) -> Self {
        Self {
            pass,
            stats: Stats { relations: pass.relations(), ..Stats::new(&pass.intake.schema) },
            collected: Collected::default(),
            room: Reservation::new(pass.memory, Consumer::Cells),
            q: JobColumns::default(),
            marks: Vec::new(),
            directions: Vec::new(),
            change: Default::default(),
            selection: Vec::new(),
            cells: Vec::new(),
            grouping: Grouping::default(),
            assembler: Assembler::default(),
            open: None,
            records: Vec::new(),
        }
    }

    /// Hands over the last block and everything that was measured.
    pub(super) fn finish(mut self) -> Result<(Stats, Collected, Reservation), ConvertError> {
        self.close_block()?;
        Ok((self.stats, self.collected, self.room))
    }

    /// Takes one batch of a source: filter, lattice, ranges, cells, records.
    pub(super) fn take(&mut self, visit: &mut Visit<'_>, batch: &PointBatch) -> Result<(), ConvertError> {
        let filtered = select::select(self.pass.plan, visit, batch, &mut self.stats, &mut self.selection)?;
        visit.seen.read += batch.len() as u64;
        visit.note_changes(batch);
        let recast = visit.recast(batch);
        let columns = stored_columns(batch, &recast);
        if filtered {
            ranges::unfiltered_colour(self.pass, visit, &columns);
        }
        let kept = if filtered { self.selection.len() } else { batch.len() };
        if kept == 0 {
            return Ok(());
        }
        // Identity, if nothing was omitted: then the rows of a slice are consecutive.
        let selection = std::mem::take(&mut self.selection);
        let mut outcome = Ok(());
        let mut start = 0;
        while start < kept {
            let is_scattered = self.grouping.groups.len() * MIN_POINTS_PER_SEGMENT > self.grouping.order.len();
            let range = start..if is_scattered { kept } else { (start + SLICE_POINTS).min(kept) };
            start = range.end;
            let rows = if filtered { Rows::Selected(&selection[range]) } else { Rows::Consecutive(range) };
            outcome = self.take_slice(visit, batch, &columns, &rows, is_scattered);
            if outcome.is_err() {
                break;
            }
        }
        self.selection = selection;
        if !self.pass.misled.load(Ordering::Relaxed) {
            let selection = filtered.then_some(&self.selection[..]);
            ranges::add(self.pass, visit, &columns, batch.len(), selection, &mut self.stats);
        }
        outcome
    }

    fn take_slice(
        &mut self,
        visit: &mut Visit<'_>,
        batch: &PointBatch,
        columns: &[&Column],
        rows: &Rows<'_>,
        is_scattered: bool,
    ) -> Result<(), ConvertError> {
        let bounds = self.quantize(visit, batch, rows);
        self.stats.bounds.union(&bounds);
        if !self.pass.partition.holds(&bounds) {
            self.pass.misled.store(true, Ordering::Relaxed);
        }
        if self.pass.misled.load(Ordering::Relaxed) {
            return Ok(()); // the pass will be repeated with the bounds that this one finds
        }
        if self.pass.intake.mark.is_some() {
            let (own, job) = (visit.lattice(), &self.pass.lattice);
            exact::marks(&visit.map, own, job, batch, &self.q, |i| rows.row(i), &mut self.marks);
        }
        if let Some(scanners) = &visit.scanners {
            scanners.directions(batch, rows, &self.q, &self.pass.lattice, &mut self.directions);
        }
        let points = self.q.len();
        self.stats.points += points as u64;
        visit.seen.kept += points as u64;
        let is_loose = self.group(is_scattered);
        let (block, start) = self.room_for(visit.group, points)?;
        let assembly = Assembly {
            schema: &self.pass.intake.schema,
            origin: self.pass.partition.origin(),
            q: &self.q,
            parts: Part::of(columns, &visit.intake.columns, &self.pass.intake.schema),
            rows,
            marks: self.pass.intake.mark.map(|at| (at, &self.marks[..])),
            directions: visit.scanners.as_ref().and(self.pass.intake.directed()).map(|at| (at, &self.directions[..])),
        };
        let written = self.records.len();
        self.records.resize(written + points * assembly.schema.stride, 0);
        let records = &mut self.records[written..];
        self.assembler.put(&assembly, &self.grouping.places, records, &mut self.stats.checksum);
        if let Some(relations) = &mut self.stats.relations {
            relations.add(records, assembly.schema.stride);
        }
        if is_loose {
            let cells = self.grouping.groups.iter().map(|(cell, count)| (morton_of(*cell), *count));
            self.collected.leave(Segment { block, start, count: points as u32 }, cells);
        } else {
            self.note_segments(block, start);
        }
        Ok(())
    }

    /// Puts the points in order of their cells; true if they stay as they are instead: no cells are known, or too many are
    /// touched.
    fn group(&mut self, is_scattered: bool) -> bool {
        let points = self.q.len();
        if !self.pass.partition.has_cells() {
            self.grouping.keep(points);
            return true;
        }
        self.pass.partition.cells(&self.q, &mut self.cells);
        self.grouping.count(&self.cells);
        let is_loose = is_scattered && self.grouping.groups.len() * LOOSE_POINTS_PER_SEGMENT > points;
        if is_loose {
            self.grouping.leave();
        } else {
            self.grouping.arrange(morton_of);
        }
        is_loose
    }

    /// The block that takes the next `points` records of a group, and the number of records it has.
    fn room_for(&mut self, group: Group, points: usize) -> Result<(u32, u32), ConvertError> {
        let stride = self.pass.intake.schema.stride;
        let is_full = self.records.len() + points * stride > BLOCK_BYTES;
        if is_full || self.open.as_ref().is_some_and(|b| b.group != group) {
            self.close_block()?;
        }
        if self.records.capacity() < BLOCK_BYTES {
            self.records = os_hints::buffer(BLOCK_BYTES);
        }
        let index = match &self.open {
            Some(block) => block.index,
            None => {
                let index = self.pass.store.open(group.0)?;
                self.open = Some(OpenBlock { index, group });
                index
            }
        };
        Ok((index, (self.records.len() / stride) as u32))
    }

    fn close_block(&mut self) -> Result<(), ConvertError> {
        self.room.resize(self.collected.bytes())?;
        match self.open.take() {
            Some(block) => self.pass.store.fill(block.index, &mut self.records),
            None => Ok(()),
        }
    }

    /// Puts the positions of some rows on the job lattice, measures how far they move, and returns their bounds there.
    fn quantize(&mut self, visit: &mut Visit<'_>, batch: &PointBatch, rows: &Rows<'_>) -> JobBounds {
        let map = visit.map;
        let mut bounds = JobBounds::EMPTY;
        let mut moved = [Moved::By(0.0); 3];
        for (a, moved) in moved.iter_mut().enumerate() {
            let (q, change) = (&mut self.q.0[a], &mut self.change[a]);
            q.clear();
            change.clear();
            *moved = quantize_axis(&map, a, &batch.positions, rows, q, change);
            (bounds.min[a], bounds.max[a]) = extent(Vectors::best(), q);
        }
        let points = self.q.len();
        let axes = std::array::from_fn(|a| match moved[a] {
            Moved::By(by) => Ok(by),
            Moved::Each => Err(&self.change[a][..]),
        });
        self.stats.change.add(points, axes);
        if let Some(own) = visit.lattice() {
            self.stats.integers_lost += moved::integers_lost(&axes, own, points);
        }
        if !self.stats.moves {
            self.stats.moves = moved::is_more_than_rounding(&axes, &self.q, &bounds, &self.pass.lattice);
        }
        let is_world = visit.lattice().is_none();
        for a in (0..3).filter(|a| visit.claims[*a]) {
            let rounding = if is_world { self.pass.rounding(a, &bounds) } else { 0.0 };
            if axes[a].is_err_and(|column| column.iter().any(|v| v.abs() > rounding)) {
                visit.seen.off_grid[a] = true;
            }
        }
        bounds
    }

    fn note_segments(&mut self, block: u32, mut start: u32) {
        let mut first = 0;
        for &(cell, count) in &self.grouping.groups {
            let rows = &self.grouping.order[first..first + count as usize];
            self.collected.add(morton_of(cell), Segment { block, start, count }, |moments| {
                if self.pass.wants_moments {
                    moments.add_rows(&self.q, rows);
                }
            });
            first += count as usize;
            start += count;
        }
    }
}

/// The columns of a batch as they are stored; `recast`: those that are not as they were read.
pub(crate) fn stored_columns<'b>(batch: &'b PointBatch, recast: &'b [(usize, Column)]) -> Vec<&'b Column> {
    let mut columns: Vec<&Column> = batch.columns.iter().collect();
    recast.iter().for_each(|(i, column)| columns[*i] = column);
    columns
}

vectorized! {
    /// The smallest and the largest coordinate.
    fn extent(q: &[i64]) -> (i64, i64) = extent_anyhow;
}

#[inline(always)]
fn extent_anyhow(q: &[i64]) -> (i64, i64) {
    q.iter().fold((i64::MAX, i64::MIN), |(min, max), v| (min.min(*v), max.max(*v)))
}

/// Puts an axis of some rows on the lattice of the pass; appends to `q`, and to `change` if coordinates move by different amounts.
pub(crate) fn quantize_axis(
    map: &SourceMap,
    a: usize,
    positions: &Positions,
    rows: &Rows<'_>,
    q: &mut Vec<i64>,
    change: &mut Vec<f64>,
) -> Moved {
    match (positions, rows) {
        (Positions::Quantized(p), Rows::Consecutive(r)) => map.axes[a].map_integers(&p[a][r.clone()], q, change),
        (Positions::World(p), Rows::Consecutive(r)) => map.axes[a].map_world(&p[a][r.clone()], q, change),
        (Positions::Quantized(p), Rows::Selected(s)) => {
            let chosen: Vec<i32> = s.iter().map(|i| p[a][*i as usize]).collect();
            map.axes[a].map_integers(&chosen, q, change)
        }
        (Positions::World(p), Rows::Selected(s)) => {
            let chosen: Vec<f64> = s.iter().map(|i| p[a][*i as usize]).collect();
            map.axes[a].map_world(&chosen, q, change)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_set_of_instructions_finds_the_same_extent() {
        let mut random = pointmill_testkit::Random::new(9);
        for count in [0, 1, 7, 1001] {
            let q: Vec<i64> = (0..count).map(|_| random.next_u64() as i64 >> 9).collect();
            let expected = (q.iter().copied().min(), q.iter().copied().max());
            let expected = (expected.0.unwrap_or(i64::MAX), expected.1.unwrap_or(i64::MIN));
            for vectors in Vectors::all() {
                assert_eq!(extent(vectors, &q), expected, "{vectors:?}");
            }
        }
    }
}
