//! What a run would do, from the headers alone.

use crate::budget::Budget;
use crate::describe::{grid_report, input_reports, resolve_crs, tidy_bounds};
use crate::error::ConvertError;
use crate::events::Silent;
use crate::gather::Range;
use crate::grid::{Cube, LatticeBounds};
use crate::job::Job;
use crate::octree::choose_attributes;
use crate::plan::{AttributeChoice, Plan};
use crate::report::Estimate;
use crate::schema::POSITION_BYTES;

/// Bytes of a hierarchy record, and of metadata and report together.
const NODE_BYTES: u64 = 22;
const JSON_BYTES: u64 = 16 << 10;

/// Says from the headers alone what [`crate::convert`] would do.
///
/// # Errors
/// Inputs that cannot be opened, or a memory ceiling that is too small.
pub fn estimate(plan: &Plan) -> Result<Estimate, ConvertError> {
    let job = Job::open(plan, &Silent)?;
    let budget = Budget::new(plan, job.schema.stride)?;
    let mut warnings = job.warnings.clone();
    let crs = resolve_crs(plan, &job, &mut warnings)?;
    // Which attributes are constant is not known before the points are read.
    let ranges: Vec<Range> = job.schema.attributes.iter().map(|a| Range::new(a.elements)).collect();
    let kept = match &plan.attributes {
        AttributeChoice::Scene => choose_attributes(&AttributeChoice::All, &job, &ranges),
        other => choose_attributes(other, &job, &ranges),
    }
    .kept;
    let size = |i: &usize| job.schema.attributes[*i].size();
    let bytes_per_point = (POSITION_BYTES + kept.iter().map(size).sum::<usize>()) as u64;
    let bounds = job.bounds_hint.map(|b| LatticeBounds {
        min: std::array::from_fn(|a| job.lattice.quantize(a, b.min[a])),
        max: std::array::from_fn(|a| job.lattice.quantize(a, b.max[a])),
    });
    let cube = bounds.and_then(|b| Cube::around(&b, &job.lattice).ok());
    let points = job.points_declared / plan.filter.every.max(1);
    let stride = job.schema.stride as u64;
    let nodes = points / u64::from(plan.leaf_capacity) * 3 + 1;
    Ok(Estimate {
        inputs: input_reports(&job, None),
        points,
        bounds: bounds.map(|b| tidy_bounds(&job, b.min, b.max)),
        crs: if crs.projection.is_empty() { crs.label } else { crs.projection },
        grid: cube.map(|c| grid_report(&job, &c)).unwrap_or_default(),
        attributes: std::iter::once("position".to_owned())
            .chain(kept.iter().map(|&i| job.schema.attributes[i].name.clone()))
            .collect(),
        bytes_per_point,
        memory_bytes: budget.estimate_peak(points, job.schema.stride),
        temp_bytes: (points * stride).saturating_sub(budget.store_bytes),
        output_bytes: points * bytes_per_point + nodes * NODE_BYTES + JSON_BYTES,
        warnings,
    })
}
