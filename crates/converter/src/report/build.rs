//! Puts the account of a run together.

use std::collections::HashMap;
use std::sync::Arc;

use pointmill_format::{Aabb, Crs, DatasetKind};
use serde_json::{Map, Value, json};

use super::types::{
    AttributeReport, DerivedReport, GridReport, InputReport, MissingValues, OtherFilesReport, OutputReport,
    PhaseReport, PointsReport, Report, SharedPlaceReport,
};
use crate::cloud::{Cloud, Cube, Derived, JobLattice, SharedPlace};
use crate::error::ConvertError;
use crate::memory;
use crate::plan::{
    AttributeChoice, Derive, DeriveNormals, Filter, Neighbourhood, Orient, OriginPoints, Plan, ScaleChoice,
};
use crate::reason::GridReason;
use crate::runtime::{Phase, PhaseTime};
use crate::sources::{Source, Sources, resolve_crs};

/// What a run has to show for itself, beside the cloud.
pub(crate) struct Account {
    pub(crate) settings: Map<String, Value>,
    pub(crate) other_files: OtherFilesReport,
    pub(crate) outputs: Vec<OutputReport>,
    /// Written to temporary files.
    pub(crate) temp_bytes: u64,
    /// That did not have to be read again.
    pub(crate) recalled_points: u64,
    pub(crate) recalled_units: u64,
    pub(crate) phases: Vec<PhaseTime>,
    /// Wall seconds in all.
    pub(crate) seconds: f64,
}

/// The account of a run.
///
/// # Errors
/// Points that do not add up.
pub(crate) fn report(mut cloud: Cloud<'_>, account: Account) -> Result<Report, ConvertError> {
    let Account { settings, other_files, outputs, temp_bytes, recalled_points, recalled_units, phases, seconds } =
        account;
    let mut warnings = std::mem::take(&mut cloud.warnings);
    cloud.cells = Vec::new();
    warnings.extend(outputs.iter().flat_map(|o| &o.warnings).cloned());
    let (cloud, stats) = (&cloud, &cloud.stats);
    Ok(Report {
        version: env!("CARGO_PKG_VERSION").into(),
        options: settings,
        inputs: input_reports(cloud.sources, Some(cloud)),
        other_files,
        attributes: attribute_reports(cloud),
        derived: cloud.derived.map(derived),
        grid: grid_report(&cloud.lattice, cloud.is_lossless, &cloud.frame.cube),
        points: points_report(cloud, &outputs)?,
        shared_places: cloud.shared_places.iter().map(shared_place).collect(),
        checksum_in: stats.checksum.to_string(),
        temp_bytes,
        recalled_points,
        recalled_units,
        output_bytes: outputs.iter().map(|o| o.bytes).sum(),
        warnings,
        outputs,
        phases: phases.iter().map(|p| phase_report(p, cloud.points())).collect(),
        seconds,
        peak_memory_bytes: memory::peak_resident_bytes(),
    })
}

/// Counts, and the proof that they add up.
fn points_report(cloud: &Cloud<'_>, outputs: &[OutputReport]) -> Result<PointsReport, ConvertError> {
    let stats = &cloud.stats;
    let points = PointsReport {
        read: stats.sources.iter().map(|s| s.read).sum(),
        kept: stats.points,
        outside_bounds: stats.outside_bounds,
        outliers: stats.outliers,
        other_class: stats.other_class,
        thinned: stats.thinned,
        invalid: stats.invalid,
        at_origin: stats.origin_skipped,
        unreadable: stats.unreadable.saturating_add(cloud.sources.points_missing),
    };
    let filtered = points.outside_bounds
        + points.outliers
        + points.other_class
        + points.thinned
        + points.invalid
        + points.at_origin;
    let is_whole = |o: &OutputReport| o.points + o.duplicates_dropped == points.kept;
    if points.read == points.kept + filtered && outputs.iter().all(is_whole) {
        return Ok(points);
    }
    Err(ConvertError::Internal(format!("the points do not add up: {points:?}")))
}

fn derived(derived: Derived) -> DerivedReport {
    let Derived { points, kept_normals, without_normal, kept_radii, without_radius } = derived;
    DerivedReport { points, kept_normals, without_normal, kept_radii, without_radius }
}

fn shared_place(place: &SharedPlace) -> SharedPlaceReport {
    SharedPlaceReport { position: place.position, points: place.points }
}

fn phase_report(time: &PhaseTime, points: u64) -> PhaseReport {
    let points = if matches!(time.phase, Phase::Read | Phase::Derive | Phase::Build) { points } else { 0 };
    let points_per_second = if time.seconds > 0.0 { points as f64 / time.seconds } else { 0.0 };
    PhaseReport { name: time.phase.name().into(), seconds: time.seconds, points, points_per_second }
}

/// The inputs as the headers (and, once they were read, the points) describe them.
pub(crate) fn input_reports(sources: &Sources, cloud: Option<&Cloud<'_>>) -> Vec<InputReport> {
    let flat = |b: Aabb| [b.min[0], b.min[1], b.min[2], b.max[0], b.max[1], b.max[2]];
    // systems that scans share are resolved once
    let mut labels: HashMap<*const Crs, Arc<str>> = HashMap::new();
    let report = |(i, source): (usize, &Source)| {
        let seen = cloud.map(|c| &c.stats.sources[i]);
        let coloured = cloud.filter(|c| c.intake.of(source).has(c.schema().rgb()));
        let label = labels.entry(Arc::as_ptr(&source.crs)).or_insert_with(|| resolve_crs(&source.crs).label.into());
        InputReport {
            path: Arc::clone(&source.path),
            format: Arc::clone(&source.format),
            points_declared: source.points_declared,
            points_read: seen.map_or(0, |s| s.read),
            points_at_origin: seen.map_or(0, |s| s.at_origin),
            bounds_declared: source.bounds_declared.map(flat),
            bounds_measured: seen.map(|s| s.bounds).filter(|b| !b.is_empty()).map(flat),
            resolution: source.stored.steps(&seen.map(|s| s.bounds).or(source.bounds_declared).unwrap_or(Aabb::EMPTY)),
            crs: Arc::clone(label),
            rgb_depth: coloured.map(|c| if c.facts.widening.is_narrow(i) { 8 } else { 16 }),
        }
    };
    sources.all.iter().enumerate().map(report).collect()
}

/// What was read of each attribute.
fn attribute_reports(cloud: &Cloud<'_>) -> Vec<AttributeReport> {
    let report = |(attribute, shortfall): (&pointmill_format::Attribute, &crate::cloud::Shortfall)| {
        let missing = MissingValues { points: shortfall.missing_points, files: shortfall.missing_files, value: 0 };
        AttributeReport {
            name: attribute.name.clone(),
            ty: attribute.ty.to_string(),
            elements: attribute.elements,
            missing: (missing.points > 0).then_some(missing),
            changed: (!shortfall.changes.is_empty()).then(|| shortfall.changes.into()),
        }
    };
    cloud.schema().attributes.iter().zip(&cloud.facts.shortfalls).map(report).collect()
}

/// The lattice and the root cube.
pub(crate) fn grid_report(lattice: &JobLattice, is_lossless: bool, cube: &Cube) -> GridReport {
    let why = GridReason { lattice: lattice.reason, rounds: !is_lossless };
    let offset = cube.offset(&lattice.lattice);
    GridReport { scale: lattice.lattice.scale, offset, cube_side: cube.side, why }
}

/// What shaped the datasets, as the report has it: what all outputs share. Each output adds its own settings.
pub(crate) fn settings(plan: &Plan, kinds: &[DatasetKind]) -> Map<String, Value> {
    let mut settings = filter_settings(&plan.filter);
    settings.insert("to".into(), kinds.iter().map(|k| k.name()).collect::<Vec<_>>().into());
    let attributes = match &plan.attributes {
        AttributeChoice::Usual => json!("usual"),
        AttributeChoice::All => json!("all"),
        AttributeChoice::Scene => json!("scene"),
        AttributeChoice::List(names) => json!(names),
    };
    settings.insert("attributes".into(), attributes);
    if let ScaleChoice::Within(precision) = plan.scale {
        settings.insert("precision".into(), precision.to_string().into());
    }
    settings.insert("memory".into(), plan.memory_bytes.into());
    settings.insert("threads".into(), plan.threads.into());
    if !plan.derive.is_nothing() {
        settings.insert("derive".into(), derive_settings(&plan.derive));
    }
    settings.insert("duplicates".into(), plan.duplicates.name().into());
    settings.insert("outliers".into(), plan.outliers.name().into());
    settings.insert("rgb-depth".into(), plan.rgb_depth.name().into());
    for (name, value) in plan.open.maps.iter().flat_map(|maps| maps.settings()) {
        settings.insert(name.into(), value.into());
    }
    settings
}

/// What is computed, and how.
fn derive_settings(derive: &Derive) -> Value {
    let mut settings = json!({
        "normals": derive.normals.map(DeriveNormals::name),
        "radius": derive.radius,
        "orient": match derive.orient {
            Orient::Scanner => json!("scanner"),
            Orient::Up => json!("up"),
            Orient::None => json!("none"),
            Orient::Towards(place) => json!(place),
        },
    });
    match derive.neighbourhood {
        Neighbourhood::Nearest(count) => settings["neighbours"] = count.into(),
        Neighbourhood::Within(radius) => settings["neighbour_radius"] = radius.into(),
    }
    settings
}

/// The filter, as reports and datasets have it; nothing if it keeps everything.
pub(crate) fn filter_settings(filter: &Filter) -> Map<String, Value> {
    let mut settings = Map::new();
    if let Some(b) = &filter.bounds {
        settings.insert("bounds".into(), json!([b.min[0], b.min[1], b.min[2], b.max[0], b.max[1], b.max[2]]));
    }
    if let Some(classes) = &filter.classes {
        settings.insert("classes".into(), json!(classes));
    }
    if filter.every > 1 {
        settings.insert("every".into(), filter.every.into());
    }
    if filter.origin_points == OriginPoints::Skip {
        settings.insert("originPoints".into(), "skip".into());
    }
    settings
}
