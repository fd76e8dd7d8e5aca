//! What all threads of a pass share.

use std::collections::HashMap;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use pointmill_format::{Aabb, Lattice};

use super::lattice::ulp;
use super::partition::Partition;
use crate::cloud::{CellHash, Intake, JobBounds, Moments, Segments, SourceStats, Store};
use crate::plan::Plan;
use crate::sources::Sources;

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
    pub(super) plan: &'a Plan,
    pub(super) sources: &'a Sources,
    pub(super) intake: &'a Intake,
    /// Points outside are outliers, which are dropped.
    pub(super) far_cut: Option<Aabb>,
    /// By source: what was seen of it by threads that have left it.
    pub(super) seen: Mutex<Vec<SourceStats>>,
    /// The lattice of the pass.
    pub(super) lattice: Lattice,
    pub(super) partition: Partition,
    pub(super) store: Store,
    pub(super) wants_moments: bool,
    /// True once a point did not fit the partition: from then on only bounds are wanted.
    pub(super) misled: AtomicBool,
}

impl Context<'_> {
    /// What the arithmetic of doubles may move world coordinates within `bounds` by.
    pub(super) fn rounding(&self, axis: usize, bounds: &JobBounds) -> f64 {
        let world = |q: i64| (q as f64 * self.lattice.scale[axis] + self.lattice.offset[axis]).abs();
        let far = world(bounds.min[axis]).max(world(bounds.max[axis])).max(self.lattice.offset[axis].abs());
        8.0 * ulp(far)
    }
}

/// The parts of cells that were seen, by packed cell.
pub(super) type CellParts = HashMap<u64, CellPart, CellHash>;

/// One thread's part of a cell.
#[derive(Debug, Default)]
pub(super) struct CellPart {
    pub(super) segments: Segments,
    pub(super) moments: Moments,
}
