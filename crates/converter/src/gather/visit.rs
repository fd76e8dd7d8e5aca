//! A source while a thread reads it: there may be very many sources, so nothing of this is kept for all of them.

use std::sync::Arc;

use pointmill_format::{AxisGrid, Lattice, Scan, ScanInfo};

use super::axis::SourceMap;
use super::context::Context;
use super::cut::Cut;
use super::origins::Origins;
use crate::cloud::{Group, LayoutIntake, SourceStats};
use crate::error::ConvertError;
use crate::sources::{Fineness, Source};

/// What a thread needs of the source that it reads, and what it has seen of it.
pub(super) struct Visit<'a> {
    pub(super) index: usize,
    pub(super) scan: Arc<dyn Scan>,
    pub(super) intake: &'a LayoutIntake,
    /// Sources whose records may be in the same blocks.
    pub(super) group: Group,
    /// From its coordinates to the lattice of the pass.
    pub(super) map: SourceMap,
    /// The filter's box.
    pub(super) cut: Option<Cut>,
    /// Points outside are outliers, which are dropped.
    pub(super) far_cut: Option<Cut>,
    pub(super) origins: Origins,
    /// Axes on which every point has to prove the claim that a grid holds it.
    pub(super) claims: [bool; 3],
    pub(super) seen: SourceStats,
}

impl<'a> Visit<'a> {
    /// Opens the source with that index, where it is not open.
    pub(super) fn begin(pass: &Context<'a>, index: usize) -> Result<Self, ConvertError> {
        let source = &pass.sources.all[index];
        let scan = pass.sources.scan(index)?;
        let info = scan.info();
        Ok(Self {
            index,
            intake: pass.intake.of(source),
            group: pass.intake.group(index, source),
            map: SourceMap::new(info.lattice.as_ref(), &pass.lattice),
            cut: pass.plan.filter.bounds.map(|bounds| Cut::new(&bounds, info)),
            far_cut: pass.far_cut.map(|bounds| Cut::new(&bounds, info)),
            origins: Origins::of(info),
            claims: claims(source, &pass.lattice),
            seen: SourceStats::default(),
            scan,
        })
    }

    pub(super) fn info(&self) -> &ScanInfo {
        self.scan.info()
    }

    /// The lattice of its integers.
    pub(super) fn lattice(&self) -> Option<&Lattice> {
        self.info().lattice.as_ref()
    }

    /// Adds what was seen to what is known of the source.
    pub(super) fn end(self, pass: &Context<'_>) -> Result<(), ConvertError> {
        let mut known = pass.seen.lock().map_err(|_| ConvertError::Internal("a worker thread failed".into()))?;
        known[self.index].merge(&self.seen);
        Ok(())
    }
}

/// The axes on which the points of a source have to prove a claim: a lattice that does not hold the claimed grid moves
/// them anyway.
fn claims(source: &Source, lattice: &Lattice) -> [bool; 3] {
    std::array::from_fn(|a| {
        let job = AxisGrid { step: lattice.scale[a], offset: lattice.offset[a] };
        matches!(source.stored.fineness[a], Fineness::Grid { grid, is_claim: true } if job.holds(&grid))
    })
}
