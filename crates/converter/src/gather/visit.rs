//! A source while a thread reads it: there may be very many sources, so nothing of this is kept for all of them.

use std::sync::{Arc, Mutex};

use pointmill_format::{Aabb, AxisGrid, Column, Lattice, PointBatch, Scan, ScanInfo};

use super::axis::SourceMap;
use super::cut::Cut;
use super::origins::Origins;
use super::views::Scanners;
use crate::cloud::{Group, Intake, LayoutIntake, SourceStats};
use crate::error::ConvertError;
use crate::plan::Plan;
use crate::sources::{Fineness, Recast, Source, Sources};

/// What threads share that read sources.
pub(crate) struct Reading<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) sources: &'a Sources,
    pub(crate) intake: &'a Intake,
    /// Points outside are outliers, which are dropped.
    pub(crate) far_cut: Option<Aabb>,
    /// By source: what was seen of it by threads that have left it.
    pub(crate) seen: Mutex<Vec<SourceStats>>,
    /// The lattice of the pass.
    pub(crate) lattice: Lattice,
}

impl<'a> Reading<'a> {
    /// Nothing was seen yet.
    pub(crate) fn new(
        plan: &'a Plan,
        sources: &'a Sources,
        intake: &'a Intake,
        far_cut: Option<Aabb>,
        lattice: Lattice,
    ) -> Self {
        let seen = Mutex::new(vec![SourceStats::default(); sources.all.len()]);
        Self { plan, sources, intake, far_cut, seen, lattice }
    }

    /// By source, what was seen of it.
    pub(crate) fn take_seen(&self) -> Result<Vec<SourceStats>, ConvertError> {
        let mut seen = self.seen.lock().map_err(|_| ConvertError::Internal("a worker thread failed".into()))?;
        Ok(std::mem::take(&mut seen))
    }

    /// Takes what was seen of the sources that were read since this was asked last, and their numbers.
    pub(super) fn take_touched(&self) -> Result<Vec<(u32, SourceStats)>, ConvertError> {
        let nothing = SourceStats::default();
        let mut seen = self.seen.lock().map_err(|_| ConvertError::Internal("a worker thread failed".into()))?;
        let touched = (0..).zip(seen.iter_mut()).filter(|(_, seen)| **seen != nothing);
        Ok(touched.map(|(source, seen)| (source, std::mem::take(seen))).collect())
    }
}

/// What a thread needs of the source that it reads, and what it has seen of it.
pub(crate) struct Visit<'a> {
    pub(crate) index: usize,
    pub(crate) scan: Arc<dyn Scan>,
    pub(crate) intake: &'a LayoutIntake,
    /// Sources whose records may be in the same blocks.
    pub(super) group: Group,
    /// From its coordinates to the lattice of the pass.
    pub(crate) map: SourceMap,
    /// The filter's box.
    pub(super) cut: Option<Cut>,
    /// Points outside are outliers, which are dropped.
    /// Of that, what is in any of these; empty: all.
    pub(super) regions: Vec<Cut>,
    pub(super) far_cut: Option<Cut>,
    pub(super) origins: Origins,
    /// Where its points were seen from, if normals are to point there.
    pub(super) scanners: Option<Scanners>,
    /// Axes on which every point has to prove the claim that a grid holds it.
    pub(super) claims: [bool; 3],
    pub(crate) seen: SourceStats,
}

impl<'a> Visit<'a> {
    /// Opens the source with that index, where it is not open.
    pub(crate) fn begin(pass: &Reading<'a>, index: usize) -> Result<Self, ConvertError> {
        let source = &pass.sources.all[index];
        let scan = pass.sources.scan(index)?;
        let info = scan.info();
        Ok(Self {
            index,
            intake: pass.intake.of(source),
            group: pass.intake.group(index, source),
            map: SourceMap::new(info.lattice.as_ref(), &pass.lattice),
            cut: pass.plan.filter.bounds.map(|bounds| Cut::new(&bounds, info)),
            regions: pass.plan.filter.regions.iter().map(|bounds| Cut::new(bounds, info)).collect(),
            far_cut: pass.far_cut.map(|bounds| Cut::new(&bounds, info)),
            origins: Origins::of(info),
            scanners: pass.intake.wants_directions(source).then(|| Scanners::of(info)).flatten(),
            claims: claims(source, &pass.lattice),
            seen: SourceStats::default(),
            scan,
        })
    }

    pub(crate) fn info(&self) -> &ScanInfo {
        self.scan.info()
    }

    /// The lattice of its integers.
    pub(crate) fn lattice(&self) -> Option<&Lattice> {
        self.info().lattice.as_ref()
    }

    /// Adds what the reader could not keep.
    pub(crate) fn note_changes(&mut self, batch: &PointBatch) {
        for (column, changes) in batch.changes() {
            if let Some(place) = self.intake.columns[column] {
                self.seen.count_changes(place, changes);
            }
        }
    }

    /// The columns that are not stored as they were read, by index.
    pub(crate) fn recast(&mut self, batch: &PointBatch) -> Vec<(usize, Column)> {
        let Self { intake, seen, .. } = self;
        let recast = |(i, recast): &(usize, Recast)| {
            let (column, changes) = recast.apply(&batch.columns[*i]);
            if let Some(place) = intake.columns[*i] {
                seen.count_changes(place, &changes);
            }
            (*i, column)
        };
        intake.recasts.iter().map(recast).collect()
    }

    /// Adds what was seen to what is known of the source.
    pub(crate) fn end(self, pass: &Reading<'_>) -> Result<(), ConvertError> {
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
