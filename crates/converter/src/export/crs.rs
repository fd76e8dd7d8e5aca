//! The coordinate reference system of the points of a file.

use pointmill_format::Crs;
use pointmill_format::scan::las::write::{CrsKind, CrsRecords};

use crate::error::ConvertError;
use crate::plan::{ExportFormat, Plan};
use crate::sources::{ResolvedCrs, Sources, given_crs, resolve_crs_of_all};
use crate::warning::Warning;

/// The system of all points together, for people and as records. `wants_wkt`: of points that WKT is to describe alone.
pub(super) fn of(
    plan: &Plan,
    format: ExportFormat,
    wants_wkt: bool,
    sources: &Sources,
    warnings: &mut Vec<Warning>,
) -> Result<(ResolvedCrs, CrsRecords), ConvertError> {
    let mut ignored = Vec::new();
    let resolved = resolve_crs_of_all(plan, &sources.all, &mut ignored)?;
    // notes on what viewers can use are none for files
    warnings.extend(ignored.into_iter().filter(|warning| matches!(warning, Warning::DifferentCrs { .. })));
    let text = plan.open.maps.as_ref().and_then(|maps| maps.target()).or(plan.crs.as_deref());
    let declared = match text {
        Some(text) => given_crs(text.trim()),
        None if resolved.label.is_empty() => None,
        None => sources.all.iter().map(|source| &*source.crs).find(|crs| **crs != Crs::default()).cloned(),
    };
    let declared = match (declared, resolved.wkt_text()) {
        (Some(Crs { wkt: None, .. }), Some(text)) if wants_wkt => Some(Crs::new(Some(text.into_owned()), None, None)),
        (declared, _) => declared,
    };
    let kind = if resolved.is_geocentric {
        CrsKind::Geocentric
    } else if resolved.is_geographic() {
        CrsKind::Geographic
    } else {
        CrsKind::Projected
    };
    let is_code = |code: u32| u16::try_from(code).is_ok();
    let says_it = declared.as_ref().is_some_and(|crs| crs.wkt.is_some() || crs.epsg.is_some_and(is_code));
    let records = declared.map(|crs| CrsRecords::new(&crs, kind)).unwrap_or_default();
    let has_place = match format {
        ExportFormat::Ply => true,
        ExportFormat::Csv => false,
        ExportFormat::Las | ExportFormat::Laz => says_it,
    };
    if !has_place && !resolved.label.is_empty() {
        warnings.push(Warning::CrsNotWritten { label: resolved.label.clone() });
    }
    Ok((resolved, records))
}
