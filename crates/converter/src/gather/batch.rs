//! From a batch of columns to a block of records grouped by cell.

use std::collections::HashMap;
use std::sync::atomic::Ordering;

use pointmill_format::{Aabb, Column, PointBatch, Positions, with_column};

use super::columns::Part;
use super::store::BLOCK_BYTES;
use super::{Pass, Segment, Segments, Stats};
use crate::axis::SourceMap;
use crate::error::ConvertError;
use crate::grid::LatticeBounds;
use crate::os_hints;
use crate::plan::{OnFault, RgbDepth};
use crate::schema::{POSITION_BYTES, as_doubles};

/// Records are put together in tiles that stay in the first-level cache while one column after the other is written.
const TILE_POINTS: usize = 512;

/// A batch is taken in slices of this many points, whose columns stay in the second-level cache while they are
/// gathered cell by cell.
const SLICE_POINTS: usize = 8_192;

/// Points in no spatial order touch many cells; whole batches are then grouped at once, or the lists of segments would
/// grow as large as the points.
const MIN_POINTS_PER_SEGMENT: usize = 64;

/// One thread's part of the pass.
pub(crate) struct Worker<'a> {
    pass: &'a Pass<'a>,
    pub(crate) stats: Stats,
    segments: Segments,
    q: [Vec<i64>; 3],
    selection: Vec<u32>,
    cells: Vec<u64>,
    grouping: Grouping,
    /// The block that is being filled, and its records so far.
    open: Option<OpenBlock>,
    records: Vec<u8>,
}

struct OpenBlock {
    index: u32,
    source: usize,
}

impl<'a> Worker<'a> {
    pub(crate) fn new(pass: &'a Pass<'a>) -> Self {
        Self {
            pass,
            stats: Stats::new(&pass.job.schema, pass.job.sources.len()),
            segments: Segments::default(),
            q: Default::default(),
            selection: Vec::new(),
            cells: Vec::new(),
            grouping: Grouping::default(),
            open: None,
            records: Vec::new(),
        }
    }

    /// Hands over the last block and everything that was learnt.
    pub(crate) fn finish(mut self) -> Result<(Stats, Segments), ConvertError> {
        self.close_block()?;
        Ok((self.stats, self.segments))
    }

    /// Takes one batch of `source`: filter, lattice, ranges, cells, records.
    pub(crate) fn take(&mut self, source: usize, batch: &PointBatch) -> Result<(), ConvertError> {
        let filtered = self.select(source, batch)?;
        self.stats.sources[source].read += batch.len() as u64;
        let stored;
        let batch = match self.as_stored(batch) {
            Some(other) => {
                stored = other;
                &stored
            }
            None => batch,
        };
        if filtered {
            self.unfiltered_colour(source, batch);
        }
        let kept = if filtered { self.selection.len() } else { batch.len() };
        if kept == 0 {
            return Ok(());
        }
        // Identity, if nothing was left out: then the rows of a slice are consecutive.
        let selection = std::mem::take(&mut self.selection);
        let mut outcome = Ok(());
        let mut start = 0;
        while start < kept {
            let is_scattered = self.grouping.groups.len() * MIN_POINTS_PER_SEGMENT > self.grouping.order.len();
            let range = start..if is_scattered { kept } else { (start + SLICE_POINTS).min(kept) };
            start = range.end;
            let rows = if filtered { Rows::Selected(&selection[range]) } else { Rows::Consecutive(range) };
            outcome = self.take_slice(source, batch, &rows);
            if outcome.is_err() {
                break;
            }
        }
        self.selection = selection;
        if !self.pass.misled.load(Ordering::Relaxed) {
            self.ranges(source, batch, filtered);
        }
        outcome
    }

    /// The batch with columns of the types that are stored, if these differ from what was read.
    fn as_stored(&mut self, batch: &PointBatch) -> Option<PointBatch> {
        let mut stored: Option<PointBatch> = None;
        for (i, column) in batch.columns.iter().enumerate() {
            if let Some((doubles, rounded)) = as_doubles(column) {
                stored.get_or_insert_with(|| batch.clone()).columns[i] = doubles;
                self.stats.rounded_values += rounded;
            }
        }
        stored
    }

    fn take_slice(&mut self, source: usize, batch: &PointBatch, rows: &Rows<'_>) -> Result<(), ConvertError> {
        let bounds = quantize(&self.pass.job.sources[source].map, batch, rows, &mut self.q, &mut self.stats);
        self.stats.bounds.union(&bounds);
        if !self.pass.partition.holds(&bounds) {
            self.pass.misled.store(true, Ordering::Relaxed);
        }
        if self.pass.misled.load(Ordering::Relaxed) {
            return Ok(()); // the pass will be repeated with the bounds that this one finds
        }
        let points = self.q[0].len();
        self.stats.points += points as u64;
        self.stats.sources[source].kept += points as u64;
        self.pass.partition.cells(&self.q, &mut self.cells);
        self.grouping.group(&self.cells);
        let (block, start) = self.room_for(source, points)?;
        self.assemble(source, batch, rows);
        self.note_segments(block, start);
        Ok(())
    }

    /// The block that takes the next `points` records of `source`, and the number of records it has.
    fn room_for(&mut self, source: usize, points: usize) -> Result<(u32, u32), ConvertError> {
        let stride = self.pass.job.schema.stride;
        let is_full = self.records.len() + points * stride > BLOCK_BYTES;
        if is_full || self.open.as_ref().is_some_and(|b| b.source != source) {
            self.close_block()?;
        }
        if self.records.capacity() < BLOCK_BYTES {
            self.records = os_hints::buffer(BLOCK_BYTES);
        }
        let index = match &self.open {
            Some(block) => block.index,
            None => {
                let index = self.pass.store.open(source as u32)?;
                self.open = Some(OpenBlock { index, source });
                index
            }
        };
        Ok((index, (self.records.len() / stride) as u32))
    }

    fn close_block(&mut self) -> Result<(), ConvertError> {
        match self.open.take() {
            Some(block) => self.pass.store.fill(block.index, &mut self.records),
            None => Ok(()),
        }
    }

    /// Fills `selection` with the points that pass the filter; false if all do.
    fn select(&mut self, source: usize, batch: &PointBatch) -> Result<bool, ConvertError> {
        let scan = &self.pass.job.sources[source].scan;
        let filter = &self.pass.plan.filter;
        let stats = &mut self.stats;
        let bounds = world_bounds(scan.info().lattice.as_ref(), &batch.positions);
        stats.sources[source].bounds = stats.sources[source].bounds.union(&bounds);
        let all_inside = filter.bounds.is_none_or(|b| b.contains(bounds.min) && b.contains(bounds.max));
        let all_finite = match &batch.positions {
            Positions::Quantized(_) => true,
            Positions::World(p) => p.iter().all(|axis| axis.iter().all(|v| v.is_finite())),
        };
        if filter.every < 2 && all_inside && filter.classes.is_none() && all_finite {
            return Ok(false);
        }
        let class_column = scan.info().attributes.iter().position(|a| a.name == "classification");
        let classes = class_column.map(|c| &batch.columns[c]).filter(|_| filter.classes.is_some()).map(whole_numbers);
        let world = |i: usize| -> [f64; 3] {
            match (&batch.positions, scan.info().lattice.as_ref()) {
                (Positions::Quantized(p), Some(l)) => {
                    std::array::from_fn(|a| f64::from(p[a][i]) * l.scale[a] + l.offset[a])
                }
                (Positions::Quantized(p), None) => std::array::from_fn(|a| f64::from(p[a][i])),
                (Positions::World(p), _) => std::array::from_fn(|a| p[a][i]),
            }
        };
        self.selection.clear();
        for i in 0..batch.len() {
            if filter.every > 1 && !(batch.first_point + i as u64).is_multiple_of(filter.every) {
                stats.thinned += 1;
                continue;
            }
            let p = world(i);
            if !p.iter().all(|v| v.is_finite()) {
                if self.pass.plan.invalid == OnFault::Fail {
                    return Err(ConvertError::Input(format!(
                        "{}: point {} has no finite position; pass --invalid skip to leave such points out",
                        scan.info().path.display(),
                        batch.first_point + i as u64
                    )));
                }
                stats.invalid += 1;
            } else if filter.bounds.is_some_and(|b| !b.contains(p)) {
                stats.outside_bounds += 1;
            } else if filter
                .classes
                .as_ref()
                .is_some_and(|c| !c.iter().any(|c| i64::from(*c) == classes.as_ref().map_or(0, |v| v[i])))
            {
                stats.other_class += 1;
            } else {
                self.selection.push(i as u32);
            }
        }
        Ok(self.selection.len() < batch.len())
    }

    /// What colour values mean is a fact of the whole file: points that are left out tell it as well.
    fn unfiltered_colour(&mut self, source: usize, batch: &PointBatch) {
        let job = self.pass.job;
        let places = &job.sources[source].columns;
        let Some(rgb) = job.schema.rgb() else { return };
        let colour = batch.columns.iter().zip(places).find(|(_, place)| **place == Some(rgb));
        if let Some((column, _)) = colour {
            self.stats.sources[source].rgb_unfiltered.include(column, None);
        }
    }

    fn ranges(&mut self, source: usize, batch: &PointBatch, filtered: bool) {
        let selection = filtered.then_some(&self.selection[..]);
        let job = self.pass.job;
        let rgb = job.schema.rgb();
        let columns = &job.sources[source].columns;
        for (column, place) in batch.columns.iter().zip(columns) {
            let Some(place) = *place else { continue };
            if Some(place) == rgb {
                self.stats.sources[source].rgb.include(column, selection);
            } else {
                self.stats.ranges[place].include(column, selection);
            }
            if job.schema.attributes[place].name == "classification"
                && let Column::UInt8(values) = column
            {
                match selection {
                    Some(s) => s.iter().for_each(|i| self.stats.classes[usize::from(values[*i as usize])] += 1),
                    None => count_classes(values, &mut self.stats.classes),
                }
            }
        }
        for place in (0..job.schema.attributes.len()).filter(|p| !columns.contains(&Some(*p))) {
            // What this source does not have is stored as zeros.
            if Some(place) == rgb {
                self.stats.sources[source].rgb.add(0.0);
            } else {
                self.stats.ranges[place].add(0.0);
            }
            if job.schema.attributes[place].name == "classification" {
                let kept = selection.map_or(batch.len(), <[u32]>::len);
                self.stats.classes[0] += kept as u64;
            }
        }
    }

    /// Builds the records in the order of their cells.
    fn assemble(&mut self, source: usize, batch: &PointBatch, slice: &Rows<'_>) {
        let schema = &self.pass.job.schema;
        let stride = schema.stride;
        let order = &self.grouping.order;
        let base = self.pass.partition.base();
        let start = self.records.len();
        self.records.resize(start + order.len() * stride, 0);
        let parts = Part::of(&batch.columns, &self.pass.job.sources[source].columns, schema);
        let mut rows = [0u32; TILE_POINTS];
        for (tile, order) in self.records[start..].chunks_mut(TILE_POINTS * stride).zip(order.chunks(TILE_POINTS)) {
            for (record, &i) in tile.chunks_exact_mut(stride).zip(order) {
                let i = i as usize;
                let x = (self.q[0][i] - base[0]) as i32;
                let y = (self.q[1][i] - base[1]) as i32;
                let z = (self.q[2][i] - base[2]) as i32;
                if let Some(position) = record.first_chunk_mut::<POSITION_BYTES>() {
                    position[..4].copy_from_slice(&x.to_le_bytes());
                    position[4..8].copy_from_slice(&y.to_le_bytes());
                    position[8..].copy_from_slice(&z.to_le_bytes());
                }
            }
            let rows = &mut rows[..order.len()];
            match slice {
                Rows::Consecutive(range) => {
                    rows.iter_mut().zip(order).for_each(|(row, i)| *row = range.start as u32 + i);
                }
                Rows::Selected(chosen) => {
                    rows.iter_mut().zip(order).for_each(|(row, i)| *row = chosen[*i as usize]);
                }
            }
            for part in &parts {
                part.put(tile, stride, rows);
            }
            self.stats.checksum.add_all(tile, stride);
        }
    }

    fn note_segments(&mut self, block: u32, mut start: u32) {
        let mut first = 0;
        for &(cell, count) in &self.grouping.groups {
            let part = self.segments.entry(cell).or_default();
            part.segments.push(Segment { block, start, count });
            if self.pass.wants_moments {
                part.moments.add_rows(&self.q, &self.grouping.order[first..first + count as usize]);
            }
            first += count as usize;
            start += count;
        }
    }
}

/// Classes of any type as whole numbers; what is none is no class, −1.
#[allow(clippy::unnecessary_cast)] // one body for every type of column
fn whole_numbers(column: &Column) -> Vec<i64> {
    with_column!(column, v => v.iter().map(|v| if (*v as i64) as f64 == *v as f64 { *v as i64 } else { -1 }).collect())
}

/// Four tables, so that runs of one class do not wait for the same counter.
fn count_classes(values: &[u8], into: &mut [u64]) {
    let mut tables = [[0u32; 256]; 4];
    let (quads, rest) = values.as_chunks::<4>();
    for quad in quads {
        for (table, v) in tables.iter_mut().zip(quad) {
            table[usize::from(*v)] += 1;
        }
    }
    rest.iter().for_each(|v| tables[0][usize::from(*v)] += 1);
    for (class, count) in into.iter_mut().enumerate() {
        *count += tables.iter().map(|t| u64::from(t[class])).sum::<u64>();
    }
}

/// Rows of a batch that are taken together.
enum Rows<'a> {
    Consecutive(std::ops::Range<usize>),
    Selected(&'a [u32]),
}

/// Puts the positions of some rows on the job lattice and returns their bounds there.
fn quantize(
    map: &SourceMap,
    batch: &PointBatch,
    rows: &Rows<'_>,
    q: &mut [Vec<i64>; 3],
    stats: &mut Stats,
) -> LatticeBounds {
    let mut bounds = LatticeBounds::EMPTY;
    for a in 0..3 {
        q[a].clear();
        let (max, squares) = match (&batch.positions, rows) {
            (Positions::Quantized(p), Rows::Consecutive(r)) => map.axes[a].map_integers(&p[a][r.clone()], &mut q[a]),
            (Positions::World(p), Rows::Consecutive(r)) => map.axes[a].map_world(&p[a][r.clone()], &mut q[a]),
            (Positions::Quantized(p), Rows::Selected(s)) => {
                let chosen: Vec<i32> = s.iter().map(|i| p[a][*i as usize]).collect();
                map.axes[a].map_integers(&chosen, &mut q[a])
            }
            (Positions::World(p), Rows::Selected(s)) => {
                let chosen: Vec<f64> = s.iter().map(|i| p[a][*i as usize]).collect();
                map.axes[a].map_world(&chosen, &mut q[a])
            }
        };
        stats.change.max[a] = stats.change.max[a].max(max);
        stats.change.sum_of_squares[a] += squares;
        bounds.min[a] = q[a].iter().copied().min().unwrap_or(i64::MAX);
        bounds.max[a] = q[a].iter().copied().max().unwrap_or(i64::MIN);
    }
    bounds
}

fn world_bounds(lattice: Option<&pointmill_format::Lattice>, positions: &Positions) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    for a in 0..3 {
        let (min, max) = match positions {
            Positions::Quantized(p) => {
                let (scale, offset) = lattice.map_or((1.0, 0.0), |l| (l.scale[a], l.offset[a]));
                let (Some(min), Some(max)) = (p[a].iter().min(), p[a].iter().max()) else { continue };
                (f64::from(*min) * scale + offset, f64::from(*max) * scale + offset)
            }
            Positions::World(p) => p[a]
                .iter()
                .filter(|v| v.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v))),
        };
        bounds.min[a] = min;
        bounds.max[a] = max;
    }
    bounds
}

/// Hashes packed cells. They come from the grid, not from an adversary, and one multiplication spreads them.
#[derive(Debug, Default, Clone, Copy)]
pub(crate) struct CellHasher(u64);

pub(crate) type CellHash = std::hash::BuildHasherDefault<CellHasher>;

impl std::hash::Hasher for CellHasher {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|b| self.write_u64(u64::from(*b)));
    }

    #[inline]
    fn write_u64(&mut self, v: u64) {
        let p = u128::from(self.0 ^ v) * 0x9e37_79b9_7f4a_7c15;
        self.0 = (p as u64) ^ (p >> 64) as u64;
    }

    #[inline]
    fn finish(&self) -> u64 {
        self.0
    }
}

/// Groups points by cell: a counting sort over the few cells that a batch touches.
#[derive(Default)]
pub(crate) struct Grouping {
    /// Indices of the points, cell by cell.
    pub(crate) order: Vec<u32>,
    /// Packed cell and number of points, in the order of `order`.
    pub(crate) groups: Vec<(u64, u32)>,
    local: HashMap<u64, u32, CellHash>,
    ids: Vec<u32>,
    seen: Vec<(u64, u32)>,
    starts: Vec<u32>,
}

impl Grouping {
    pub(crate) fn group(&mut self, cells: &[u64]) {
        self.local.clear();
        self.seen.clear();
        self.ids.clear();
        let (mut last, mut id) = (None, 0);
        for &cell in cells {
            // Neighbours in a scan mostly share their cell.
            if last != Some(cell) {
                last = Some(cell);
                id = *self.local.entry(cell).or_insert_with(|| {
                    self.seen.push((cell, 0));
                    (self.seen.len() - 1) as u32
                });
            }
            self.ids.push(id);
            self.seen[id as usize].1 += 1;
        }
        // Cells next to each other in space lie next to each other in the block.
        let mut by_cell: Vec<u32> = (0..self.seen.len() as u32).collect();
        by_cell.sort_unstable_by_key(|&id| super::partition::morton_of(self.seen[id as usize].0));
        self.starts.clear();
        self.starts.resize(self.seen.len(), 0);
        self.groups.clear();
        let mut start = 0;
        for &id in &by_cell {
            self.starts[id as usize] = start;
            self.groups.push(self.seen[id as usize]);
            start += self.seen[id as usize].1;
        }
        self.order.clear();
        self.order.resize(cells.len(), 0);
        for (i, &id) in self.ids.iter().enumerate() {
            let at = &mut self.starts[id as usize];
            self.order[*at as usize] = i as u32;
            *at += 1;
        }
    }
}

/// Says what the colour values of a source mean.
pub(crate) fn is_eight_bit(policy: RgbDepth, source: &super::stats::SourceStats) -> bool {
    let deepest = source.rgb.max.iter().chain(&source.rgb_unfiltered.max);
    match policy {
        RgbDepth::Eight => true,
        RgbDepth::Sixteen => false,
        RgbDepth::Auto => !source.rgb.is_empty() && deepest.into_iter().all(|v| *v <= 255.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn grouping_keeps_every_point_once_and_cells_together_in_input_order() {
        let mut g = Grouping::default();
        g.group(&[7, 7, 3, 7, 1, 3]);
        let mut seen = 0;
        for &(cell, count) in &g.groups {
            let members = &g.order[seen..seen + count as usize];
            assert!(members.is_sorted());
            assert!(members.iter().all(|i| [7, 7, 3, 7, 1, 3][*i as usize] == cell));
            seen += count as usize;
        }
        assert_eq!(seen, 6);
        assert_eq!(g.groups.len(), 3);
    }
}
