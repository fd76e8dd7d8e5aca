//! What the headers say, put together: all scans and the union of their attributes. Nothing changes it later.

mod bytes;
mod crs;
mod decimals;
mod divisor;
mod open_scans;
mod opener;
mod probe;
mod recast;
mod same;
mod schema;
mod shared;
mod source;
mod survey;
mod union;

use std::sync::{Arc, Mutex};

use pointmill_format::{Aabb, Scan};

pub(crate) use crs::resolve_all as resolve_crs_of_all;
pub use crs::{ResolvedCrs, resolve_crs};
pub(crate) use decimals::tidy_product;
pub(crate) use recast::{Recast, doubled};
pub(crate) use schema::{MARK_BYTES, POSITION_BYTES, Schema};
pub(crate) use source::Source;
#[cfg(test)]
pub(crate) use source::Stored;
pub(crate) use survey::{Fineness, far_out, intersection, single_step};
pub(crate) use union::Layout;

use self::divisor::Divisors;
use self::open_scans::OpenScans;
use self::opener::Opener;
use self::probe::{Outcome, Probe, Probed};
use self::shared::Shared;
use self::union::Union;
use crate::error::{ConvertError, InputFault};
use crate::plan::Plan;
use crate::runtime::{Events, Workers};
use crate::warning::Warning;

/// Threads that read headers: more only wait for the disk.
const MOST_THREADS: usize = 32;

/// Everything known before the first point is decoded.
pub(crate) struct Sources {
    /// In order of path.
    pub(crate) all: Vec<Source>,
    /// The union of the attributes of all scans.
    pub(crate) attributes: Schema,
    /// Where the columns of scans are among them: once for all scans that have the same.
    pub(crate) layouts: Vec<Layout>,
    /// Points in the pieces of all scans.
    pub(crate) points_declared: u64,
    /// Points declared by headers but not there.
    pub(crate) points_missing: u64,
    pub(crate) warnings: Vec<Warning>,
    open: OpenScans,
}

impl Sources {
    /// Looks at the headers of all inputs of the plan, in order of path, on its threads.
    pub(crate) fn open(plan: &Plan, events: &dyn Events) -> Result<Self, ConvertError> {
        let mut paths = plan.inputs.clone();
        paths.sort();
        paths.dedup();
        let mut warnings = Vec::new();
        if !plan.other_files.is_empty() {
            warnings.push(Warning::OtherFiles { files: plan.other_files.clone() });
        }
        bytes::check(plan, bytes::least_bytes(&paths), paths.len())?;
        let workers = Workers::start(plan.threads.min(paths.len()).min(MOST_THREADS), events)?;
        let open = OpenScans::new(Opener::new(plan, workers.threads), plan.threads);
        let probe = Probe { open: &open, unreadable: plan.unreadable, shared: Mutex::new(Shared::default()) };
        let outcomes = probe.all(&paths, &workers)?;
        drop(probe);
        let mut found = Vec::with_capacity(outcomes.len());
        for outcome in outcomes {
            match outcome {
                Outcome::Open(mut probed) => {
                    warnings.append(&mut probed.warnings);
                    found.push(*probed);
                }
                Outcome::Skipped(warning) => warnings.push(warning),
            }
        }
        if found.is_empty() {
            return Err(InputFault::NoneReadable.into());
        }
        let sources = Self::combine(found, open, warnings)?;
        bytes::check(plan, sources.bytes(), paths.len())?;
        sources.warnings.iter().for_each(|w| events.warning(w));
        Ok(sources)
    }

    fn combine(found: Vec<Probed>, open: OpenScans, mut warnings: Vec<Warning>) -> Result<Self, ConvertError> {
        let union = Union::of(found.iter().map(|probed| &probed.attributes));
        warnings.extend(union.warnings);
        let (mut points_declared, mut points_missing, mut first_unit) = (0u64, 0u64, 0);
        let mut all = Vec::with_capacity(found.len());
        for (index, (probed, layout)) in found.into_iter().zip(union.layout_of).enumerate() {
            points_declared = points_declared.saturating_add(probed.points);
            points_missing = points_missing.saturating_add(probed.points_missing);
            if let Some(scan) = probed.scan {
                open.keep(index, scan)?;
            }
            all.push(Source { layout, first_unit, ..probed.source });
            first_unit += u64::from(all[index].pieces);
        }
        let divisors = Divisors::of(&all, &open)?;
        settle_fineness(&mut all, &divisors);
        let (attributes, layouts) = (union.schema, union.layouts);
        Ok(Self { all, attributes, layouts, points_declared, points_missing, warnings, open })
    }

    /// The scan of a source, open.
    ///
    /// # Errors
    /// The file cannot be opened again, or was changed since its header was read.
    pub(crate) fn scan(&self, source: usize) -> Result<Arc<dyn Scan>, ConvertError> {
        self.open.get(source, &self.all[source])
    }

    /// The number of pieces of all scans.
    pub(crate) fn pieces(&self) -> usize {
        self.all.last().map_or(0, |last| (last.first_unit + u64::from(last.pieces)) as usize)
    }

    /// The source of the piece with that number among those of all scans, and which of its pieces it is.
    pub(crate) fn piece(&self, number: usize) -> (usize, usize) {
        // sources without pieces begin where the next one does
        let source = self.all.partition_point(|s| s.first_unit <= number as u64).saturating_sub(1);
        (source, number - self.all.get(source).map_or(0, |s| s.first_unit as usize))
    }

    /// What the headers claim (or a sample shows) of where the points are, cut by the filter; a hint.
    pub(crate) fn bounds_hint(&self, cut: Option<&Aabb>) -> Option<Aabb> {
        let extents = self.all.iter().filter_map(|s| s.extent.as_ref());
        let all = extents.fold(Aabb::EMPTY, |all, e| all.union(&e.bounds));
        let hint = match cut {
            Some(cut) if !all.is_empty() => intersection(&all, cut),
            _ => all,
        };
        (!hint.is_empty()).then_some(hint)
    }
}

#[cfg(test)]
impl Sources {
    /// Sources whose headers alone matter.
    pub(crate) fn of_headers(all: Vec<Source>) -> Self {
        let open = OpenScans::new(Opener::new(&Plan::new(Vec::new(), "out".into()), 1), 1);
        let attributes = Schema::new(Vec::new());
        let (layouts, warnings) = (Vec::new(), Vec::new());
        Self { all, attributes, layouts, points_declared: 0, points_missing: 0, warnings, open }
    }
}

/// Takes the coarser grids that integers were found to lie on. Neighbours that store coordinates alike share how.
fn settle_fineness(sources: &mut [Source], divisors: &Divisors) {
    let mut last: Option<Arc<source::Stored>> = None;
    for source in sources {
        let mut stored = (*source.stored).clone();
        if let Some(lattice) = &stored.lattice {
            stored.fineness = divisors.fineness(lattice);
        }
        let same = last.filter(|last| **last == stored);
        let stored = same.unwrap_or_else(|| Arc::new(stored));
        source.stored = Arc::clone(&stored);
        last = Some(stored);
    }
}
