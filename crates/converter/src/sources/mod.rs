//! What the headers say, put together: open scans and the union of their attributes. Nothing changes it later.

mod crs;
mod decimals;
mod divisor;
mod recast;
mod schema;
mod survey;
mod union;

use pointmill_format::{Aabb, Advice, ErrorKind, ReadError, Scan};

pub(crate) use crs::resolve_all as resolve_crs_of_all;
pub use crs::{ResolvedCrs, resolve_crs};
pub(crate) use decimals::tidy_product;
pub(crate) use recast::{Recast, doubled};
pub(crate) use schema::{MARK_BYTES, POSITION_BYTES, Schema};
#[cfg(test)]
pub(crate) use survey::Extent;
pub(crate) use survey::{Fineness, Survey, far_out, intersection, single_step};
pub(crate) use union::{Placed, Union};

use self::divisor::Divisors;
use crate::error::{ConvertError, InputFault};
use crate::plan::{OnFault, Plan};
use crate::runtime::Events;
use crate::warning::{Warning, reason_of};

/// The description of one file may take this part of the memory while it is opened.
const DESCRIPTION_SHARE: u64 = 4;

/// A scan, and where its columns are among all attributes.
pub(crate) struct Source {
    pub(crate) scan: Box<dyn Scan>,
    /// Where each of its columns is in [`Sources::attributes`], and how it gets there.
    pub(crate) columns: Vec<Placed>,
    /// Where its points are, and how finely they are stored, as far as is known before they are read.
    pub(crate) survey: Survey,
}

/// Everything known before the first point is decoded.
pub(crate) struct Sources {
    /// In order of path.
    pub(crate) all: Vec<Source>,
    /// The union of the attributes of all scans.
    pub(crate) attributes: Schema,
    /// Points in the pieces of all scans.
    pub(crate) points_declared: u64,
    /// Points declared by headers but not there.
    pub(crate) points_missing: u64,
    pub(crate) warnings: Vec<Warning>,
}

impl Sources {
    /// Opens all inputs of the plan, in order of path.
    pub(crate) fn open(plan: &Plan, events: &dyn Events) -> Result<Self, ConvertError> {
        let mut paths = plan.inputs.clone();
        paths.sort();
        paths.dedup();
        let mut warnings = Vec::new();
        if !plan.other_files.is_empty() {
            warnings.push(Warning::OtherFiles { files: plan.other_files.clone() });
        }
        warnings.extend(plan.skipped_inputs.iter().map(|(path, why)| Warning::InputSkipped {
            path: path.clone(),
            error: format!("{}: {why}", path.display()),
        }));
        let mut scans: Vec<Box<dyn Scan>> = Vec::new();
        let mut points_missing = 0u64;
        let mut options = plan.open.clone();
        options.description_bytes.get_or_insert(plan.memory_bytes / DESCRIPTION_SHARE);
        for path in &paths {
            let opened = pointmill_format::open_scan(path, &options);
            match opened.and_then(|scan| Ok((missing_points(&*scan, plan.unreadable)?, scan))) {
                Ok((missing, scan)) => {
                    let noticed = scan.info().warnings.iter();
                    warnings.extend(noticed.map(|w| Warning::Scan { path: path.clone(), warning: w.clone() }));
                    points_missing = points_missing.saturating_add(missing);
                    scans.push(scan);
                }
                Err(error) if plan.unreadable == OnFault::Skip && !matches!(error.kind(), ErrorKind::Unsupported) => {
                    warnings.push(Warning::InputSkipped { path: path.clone(), error: reason_of(&error) });
                }
                Err(error) => return Err(error.into()),
            }
        }
        if scans.is_empty() {
            return Err(InputFault::NoneReadable.into());
        }
        let sources = Self::combine(scans, points_missing, warnings);
        sources.warnings.iter().for_each(|w| events.warning(w));
        Ok(sources)
    }

    fn combine(scans: Vec<Box<dyn Scan>>, points_missing: u64, mut warnings: Vec<Warning>) -> Self {
        let infos: Vec<_> = scans.iter().map(|s| s.info()).collect();
        let union = Union::of(&infos);
        warnings.extend(union.warnings);
        let points_declared = scans.iter().flat_map(|s| s.pieces()).map(|p| p.points).sum();
        let divisors = Divisors::of(&scans);
        let sources = scans.into_iter().zip(union.columns).map(|(scan, columns)| {
            let survey = Survey::of(&*scan, Some(&divisors));
            Source { scan, columns, survey }
        });
        Self { all: sources.collect(), attributes: union.schema, points_declared, points_missing, warnings }
    }

    /// What the headers claim (or a sample shows) of where the points are, cut by the filter; a hint.
    pub(crate) fn bounds_hint(&self, cut: Option<&Aabb>) -> Option<Aabb> {
        let extents = self.all.iter().filter_map(|s| s.survey.extent.as_ref());
        let all = extents.fold(Aabb::EMPTY, |all, e| all.union(&e.bounds));
        let hint = match cut {
            Some(cut) if !all.is_empty() => intersection(&all, cut),
            _ => all,
        };
        (!hint.is_empty()).then_some(hint)
    }
}

/// Points that the header declares and the file does not hold; an error if the policy says so.
fn missing_points(scan: &dyn Scan, policy: OnFault) -> Result<u64, ReadError> {
    let info = scan.info();
    let found: u64 = scan.pieces().iter().map(|p| p.points).sum();
    let missing = info.points_declared.saturating_sub(found);
    if missing > 0 && policy == OnFault::Fail {
        let fault = pointmill_format::Fault::PointsMissing { declared: info.points_declared, found };
        return Err(ReadError::broken(&info.path, info.file_bytes, fault).advise(Advice::SkipUnreadable));
    }
    Ok(missing)
}
