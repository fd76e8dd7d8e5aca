//! What a run would do, from the headers alone.

use crate::cloud::{Cube, Intake, Range, tidy_world};
use crate::convert::least;
use crate::error::ConvertError;
use crate::gather::{from_headers, is_coarse, is_lossless, quantized};
use crate::outputs::{self, DiskSize, Target, choose_attributes};
use crate::plan::{AttributeChoice, Plan};
use crate::report::{ChoiceReason, Estimate, PlannedChoice, grid_report, input_reports};
use crate::runtime::{Budget, Silent};
use crate::sources::{Sources, resolve_crs_of_all};

/// Bytes of metadata and report together.
const JSON_BYTES: u64 = 16 << 10;

/// Says from the headers alone what [`crate::convert`] would do.
///
/// # Errors
/// Inputs that cannot be opened, settings that cannot be used, or a memory ceiling that is too small.
pub fn estimate(plan: &Plan, targets: &[Target]) -> Result<Estimate, ConvertError> {
    outputs::check(plan, targets)?;
    let mut sources = Sources::open(plan, &Silent)?.within_precision(plan, outputs::keep_lattice(targets))?;
    let mut warnings = std::mem::take(&mut sources.warnings);
    let wants = outputs::wants(plan, targets, &sources.attributes)?;
    let intake = Intake::new(plan, &sources, &wants.attributes, is_coarse(plan, &sources)?);
    let schema = &intake.schema;
    let budget = Budget::new(plan, schema.stride, least(targets, &sources, &intake)?)?;
    let crs = resolve_crs_of_all(plan, &sources.all, &mut warnings)?;
    let lattice = from_headers(plan, &sources)?;
    // Which attributes are constant is not known before the points are read.
    let ranges: Vec<Range> = schema.attributes.iter().map(|a| Range::new(a.elements)).collect();
    let kept = choose_attributes(plan, schema, &intake.unread, &ranges, &[]).kept;
    warnings.extend(targets.iter().flat_map(|t| t.output().foresee(schema, &kept, &crs)));
    let kept_bytes = kept.iter().map(|i| schema.attributes[*i].size()).sum::<usize>() as u64;
    let sizes: Vec<DiskSize> = targets.iter().map(|t| t.output().disk_size(plan, schema, kept_bytes)).collect();
    let bytes_per_point: u64 = sizes.iter().map(|s| s.per_point).sum();
    let bounds = sources.bounds_hint(plan.filter.bounds.as_ref()).map(|b| quantized(&lattice.lattice, &b));
    let cube = bounds.and_then(|b| Cube::around(&b, &lattice.lattice).ok());
    let points = sources.points_declared / plan.filter.every.max(1);
    let stride = schema.stride as u64;
    let of_nodes: u64 = sizes.iter().map(|s| points * s.per_1000_points / 1000).sum();
    let lossless = is_lossless(&sources, &lattice);
    let world = |q: i64, a: usize| tidy_world(q, lattice.lattice.scale[a], lattice.lattice.offset[a]);
    let names = kept.iter().map(|&i| schema.attributes[i].name.clone());
    Ok(Estimate {
        inputs: input_reports(&sources, None),
        points,
        bounds: bounds.map(|b| std::array::from_fn(|i| world(if i < 3 { b.min[i] } else { b.max[i - 3] }, i % 3))),
        crs: if crs.projection.is_empty() { crs.label } else { crs.projection },
        grid: cube.map(|c| grid_report(&lattice, lossless, &c)).unwrap_or_default(),
        attributes: std::iter::once("position".to_owned()).chain(names).collect(),
        choices: choices(plan, targets),
        bytes_per_point,
        least_memory_bytes: budget.least_ceiling,
        memory_bytes: budget.estimate_peak(points, schema.stride),
        temp_bytes: (points * stride).saturating_sub(budget.record_bytes(points)),
        output_bytes: points * bytes_per_point + of_nodes + JSON_BYTES,
        warnings,
    })
}

/// What is chosen beside the lattice. Which attributes the scene requires only the points tell.
fn choices(plan: &Plan, targets: &[Target]) -> Vec<PlannedChoice> {
    let mut choices = outputs::choices(plan, targets);
    if plan.attributes == AttributeChoice::Scene {
        choices.insert(0, PlannedChoice::or_chosen("attributes", None::<&str>, ChoiceReason::Values));
    }
    choices
}
