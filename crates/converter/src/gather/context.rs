//! What all threads of a pass share.

use std::collections::HashMap;
use std::ops::Deref;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::census::Counts;
use super::lattice::ulp;
use super::partition::Partition;
use super::visit::Reading;
use crate::cloud::{CellHash, JobBounds, Moments, Relations, Segment, Segments, Store};
use crate::plan::AttributeChoice;
use crate::runtime::Pool;

/// Bytes of a list of segments beside the segments themselves.
const SEGMENTS_BYTES: usize = 64;

/// A thread lists the records of that many cells; those of others stay as they are.
const MOST_CELLS: usize = 1 << 16;

/// What the outputs need of the cloud beside attributes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Demand {
    /// Sums and extremes of the cells.
    pub(crate) moments: bool,
    /// How many outputs take each record once.
    pub(crate) uses: u32,
}

/// What all threads of a pass share.
pub(super) struct Context<'a> {
    pub(super) reading: Reading<'a>,
    pub(super) partition: Partition,
    pub(super) store: Arc<Store>,
    pub(super) memory: &'a Arc<Pool>,
    pub(super) wants_moments: bool,
    /// Its number.
    pub(super) pass: u32,
    /// True once a point could not be stored: from then on only bounds are wanted.
    pub(super) misled: AtomicBool,
}

impl<'a> Deref for Context<'a> {
    type Target = Reading<'a>;

    fn deref(&self) -> &Reading<'a> {
        &self.reading
    }
}

impl Context<'_> {
    /// Attributes that follow from others, if they are to be left out: nothing of them is known yet.
    pub(super) fn relations(&self) -> Option<Relations> {
        (self.plan.attributes == AttributeChoice::Scene).then(|| Relations::new(&self.intake.schema))
    }

    pub(super) fn is_misled(&self) -> bool {
        self.misled.load(Ordering::Relaxed)
    }

    /// Notes that a point could not be stored, if so.
    pub(super) fn note_misled(&self, misled: bool) {
        self.misled.fetch_or(misled, Ordering::Relaxed);
    }

    /// What the arithmetic of doubles may move world coordinates within `bounds` by.
    pub(super) fn rounding(&self, axis: usize, bounds: &JobBounds) -> f64 {
        let world = |q: i64| (q as f64 * self.lattice.scale[axis] + self.lattice.offset[axis]).abs();
        let far = world(bounds.min[axis]).max(world(bounds.max[axis])).max(self.lattice.offset[axis].abs());
        8.0 * ulp(far)
    }
}

/// The parts of cells of one level that were seen, by Morton code.
pub(super) type CellParts = HashMap<u64, CellPart, CellHash>;

/// One thread's part of a cell.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct CellPart {
    pub(super) segments: Segments,
    pub(super) moments: Moments,
}

impl CellPart {
    /// Adds what another thread has of the cell.
    pub(super) fn merge(&mut self, other: Self) {
        self.segments.append(other.segments);
        self.moments.merge(&other.moments);
    }
}

/// Where the records of a pass are.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Collected {
    pub(super) cells: CellParts,
    /// Records in no order of space, to be grouped once all are in.
    pub(super) loose: Segments,
    pub(super) census: Counts,
    /// Segments that were added to the cells.
    pub(super) segments: u64,
}

impl Collected {
    /// Adds records of a cell; `moments` adds them to what is known of the cell's.
    pub(super) fn add(&mut self, cell: u64, segment: Segment, moments: impl FnOnce(&mut Moments)) {
        self.census.add(cell, u64::from(segment.count));
        self.segments += 1;
        let is_full = self.cells.len() >= MOST_CELLS;
        match if is_full { self.cells.get_mut(&cell) } else { Some(self.cells.entry(cell).or_default()) } {
            Some(part) => {
                part.segments.push(segment);
                moments(&mut part.moments);
            }
            None => self.loose.push(segment),
        }
    }

    /// Adds records that stay as they are, and how many of them each cell has.
    pub(super) fn leave(&mut self, segment: Segment, cells: impl Iterator<Item = (u64, u32)>) {
        self.loose.push(segment);
        cells.for_each(|(cell, points)| self.census.add(cell, u64::from(points)));
    }

    /// The same of blocks that have got numbers greater by `by`.
    pub(super) fn shift(&mut self, by: u32) {
        self.cells.values_mut().for_each(|part| part.segments.shift(by));
        self.loose.shift(by);
    }

    /// The same of blocks that have got numbers smaller by `by`.
    pub(super) fn shift_back(&mut self, by: u32) {
        self.shift(by.wrapping_neg());
    }

    /// All records, in order of block.
    pub(super) fn everything(self) -> Segments {
        let mut all = self.loose;
        self.cells.into_values().for_each(|part| all.append(part.segments));
        all.sort();
        all
    }

    /// Memory that all of it takes, bytes, about.
    pub(super) fn bytes(&self) -> u64 {
        // a table is up to half empty, and so is a list that grows
        let cells = self.cells.capacity() * (size_of::<(u64, CellPart)>() + 1 + SEGMENTS_BYTES);
        cells as u64 + 2 * self.segments * size_of::<Segment>() as u64 + self.loose.bytes() + self.census.bytes()
    }

    /// Adds what another thread has collected.
    pub(super) fn merge(&mut self, other: Self) {
        if self.cells.is_empty() && self.loose.is_empty() {
            *self = other; // its table is not made twice
            return;
        }
        other.cells.into_iter().for_each(|(cell, part)| self.cells.entry(cell).or_default().merge(part));
        self.loose.append(other.loose);
        self.census.merge(other.census);
        self.segments += other.segments;
    }
}
