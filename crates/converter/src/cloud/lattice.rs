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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reason::{Coarser, CoarserCause};

    #[test]
    fn a_step_is_held_back_by_the_extent_alone() {
        let axis = |basis, coarser, enough| AxisReason { basis, coarser, enough };
        let own = axis(LatticeBasis::Sources, None, None);
        let is_held_back = |z| {
            let reason = LatticeReason { axes: [own, own, z] };
            JobLattice { lattice: Lattice { scale: [1.0; 3], offset: [0.0; 3] }, reason }.is_held_back()
        };
        let coarser = Some(Coarser { factor: 2.0, cause: CoarserCause::Extent });
        assert!(is_held_back(axis(LatticeBasis::Sources, coarser, None)));
        assert!([LatticeBasis::Decimal, LatticeBasis::PowerOfTwo].iter().all(|b| is_held_back(axis(*b, None, None))));
        assert!(!is_held_back(own) && !is_held_back(axis(LatticeBasis::Decimal, None, Some(3.0))), "or by a request");
    }
}
