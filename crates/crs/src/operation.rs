//! The way from one system to another, or why there is none that is exact.

use pointmill_format::Aabb;
use proj_core::{
    AreaOfInterest, Bounds, CoordinateOperationMetadata, OperationMatchKind, SelectionOptions, SkippedOperationReason,
    Transform,
};

use crate::projection::Projection;
use crate::system::{HeightReference, System};

/// The name that the library gives to "no change of datum".
const NO_CHANGE: &str = "Identity";

/// How points get from one system to another.
#[derive(Debug)]
pub(crate) struct Way {
    pub(crate) projection: Projection,
    /// The change of datum on the way, for people, if there is one: "ETRS89 to WGS 84 (1), right within 1 m".
    pub(crate) datum_change: Option<String>,
}

/// The way from one system to another for points inside `area` (coordinates of `from`; `None`: not known).
///
/// # Errors
/// Why there is none that is exact, one line: other datums and no published parameters, or a grid is needed.
pub(crate) fn way(from: &System, to: &System, area: Option<&Aabb>) -> Result<Way, String> {
    if let Some(other) = [from, to].into_iter().find(|system| system.has_other_meridian()) {
        return Err(format!("{} has a prime meridian other than Greenwich", other.name()));
    }
    // bounds may be wrong, and where the datum stays they do not matter
    let anywhere = build(from, to, SelectionOptions::default());
    let options = options(from, area);
    let mut transform = match anywhere {
        Ok(transform) if is_no_change(&transform) => transform,
        _ => build(from, to, options.clone())?,
    };
    if is_no_change(&transform) && is_other_datum(from, to) {
        let null = published(&transform, from, to).ok_or_else(|| unknown_change(from, to))?;
        let Some(id) = null.id else { return Err(unknown_change(from, to)) };
        transform = build(from, to, options.with_operation(id))?;
    }
    let datum_change = check(&transform, from, to)?;
    let projection =
        Projection { transform, from_north_first: from.is_north_first(), to_north_first: to.is_north_first() };
    Ok(Way { projection, datum_change })
}

fn options(from: &System, area: Option<&Aabb>) -> SelectionOptions {
    let options = SelectionOptions::default();
    let Some(b) = area.filter(|_| !from.is_geocentric()) else { return options };
    let (x, y) = if from.is_north_first() { (1, 0) } else { (0, 1) };
    // what lies beyond the poles is no place: it must not keep the others from theirs
    let least = if from.unit().is_none() { [-180.0, -90.0] } else { [f64::NEG_INFINITY; 2] };
    let inside = |v: f64, axis: usize| v.max(least[axis]).min(-least[axis]);
    let corner = |c: [f64; 3]| [inside(c[0], 0), inside(c[1], 1)];
    let (min, max) = (corner(b.min), corner(b.max));
    let bounds = Bounds::new(min[x], min[y], max[x], max[y]);
    options.with_area_of_interest(AreaOfInterest::source_crs_bounds(bounds))
}

fn build(from: &System, to: &System, options: SelectionOptions) -> Result<Transform, String> {
    let (a, b) = (&from.definition, &to.definition);
    let has_ellipsoidal = |s: &System| s.heights() == HeightReference::Ellipsoid;
    let result = if has_ellipsoidal(from) && has_ellipsoidal(to) {
        proj_wkt::transform_from_crs_strings_with_selection_options(a, b, options)
    } else {
        proj_wkt::transform_from_crs_strings_horizontal_with_selection_options(a, b, options)
    };
    result.map_err(|e| format!("there is no exact way from {} to {} ({e})", from.name(), to.name()))
}

fn is_no_change(transform: &Transform) -> bool {
    let operation = transform.selected_operation();
    operation.id.is_none() && operation.name == NO_CHANGE
}

fn is_other_datum(from: &System, to: &System) -> bool {
    from.datum() != to.datum()
}

fn unknown_change(from: &System, to: &System) -> String {
    format!("no parameters are known for the change of datum from {} to {}", from.name(), to.name())
}

/// Of datums that the library takes as the same: the published operation that says so.
fn published<'a>(transform: &'a Transform, from: &System, to: &System) -> Option<&'a CoordinateOperationMetadata> {
    let skipped = transform.selection_diagnostics().skipped_operations.iter();
    let in_question = skipped.filter(|s| s.reason == SkippedOperationReason::LessPreferred).map(|s| &s.metadata);
    let exact = in_question.filter(|m| !m.uses_grids && !m.deprecated && is_between(m, from, to));
    let accuracy = |m: &CoordinateOperationMetadata| m.accuracy.map_or(f64::INFINITY, |a| a.meters);
    exact.filter(|m| m.accuracy.is_some()).min_by(|a, b| accuracy(a).total_cmp(&accuracy(b)))
}

/// True if the operation is published for these two datums, not for others that are taken as the same.
fn is_between(operation: &CoordinateOperationMetadata, from: &System, to: &System) -> bool {
    let Some(published) = operation.id.and_then(proj_core::lookup_operation) else { return false };
    let datums = [published.source_datum_epsg, published.target_datum_epsg];
    let wanted = [Some(from.datum()), Some(to.datum())];
    datums == wanted || datums == [wanted[1], wanted[0]]
}

/// The change of datum on the way, for people.
fn check(transform: &Transform, from: &System, to: &System) -> Result<Option<String>, String> {
    let (operation, diagnostics) = (transform.selected_operation(), transform.selection_diagnostics());
    if is_no_change(transform) {
        return Ok(None);
    }
    if diagnostics.selected_match_kind == OperationMatchKind::Custom {
        return Ok(Some("the shift to WGS 84 that the definition declares".to_owned()));
    }
    if let Some(grid) = &diagnostics.missing_required_grid {
        let file = grid.rsplit(' ').next().unwrap_or(grid);
        return Err(format!("the change of datum from {} to {} needs the grid {file}", from.name(), to.name()));
    }
    if operation.uses_grids {
        return Err(format!("the change of datum from {} to {} needs a grid", from.name(), to.name()));
    }
    // withdrawn operations still rank by their accuracy: one of them leads from NAD83(HARN) to WGS 84, and is wrong
    let is_sound = !operation.deprecated && !operation.approximate && !diagnostics.approximate;
    match operation.accuracy {
        Some(accuracy) if is_sound && is_between(operation, from, to) => {
            Ok(Some(format!("{}, right within {} m", operation.name, accuracy.meters)))
        }
        _ => Err(unknown_change(from, to)),
    }
}
