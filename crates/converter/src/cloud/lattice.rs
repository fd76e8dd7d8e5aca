//! The lattice of a run, and why it is that one.

use pointmill_format::Lattice;

use crate::reason::{AxisReason, LatticeBasis, LatticeReason};

/// The lattice of a run.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct JobLattice {
    pub(crate) lattice: Lattice,
    pub(crate) reason: LatticeReason,
}

impl JobLattice {
    /// True if the extent of the cloud decided the step of an axis.
    pub(crate) fn is_held_back(&self) -> bool {
        let by_extent = |basis| matches!(basis, LatticeBasis::Decimal | LatticeBasis::PowerOfTwo);
        let is_held_back = |axis: &AxisReason| axis.coarser.is_some() || by_extent(axis.basis);
        self.reason.axes.iter().any(|axis| axis.enough.is_none() && is_held_back(axis))
    }
}
