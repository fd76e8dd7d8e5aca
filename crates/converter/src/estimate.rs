//! What a run would do, from the headers alone.

use pointmill_format::bintree::CORE_BYTES;

use crate::budget::Budget;
use crate::describe::{grid_report, input_reports, resolve_crs, tidy_bounds};
use crate::error::ConvertError;
use crate::events::Silent;
use crate::gather::Range;
use crate::grid::{Cube, LatticeBounds};
use crate::job::Job;
use crate::needs;
use crate::octree::choose_attributes;
use crate::plan::{AttributeChoice, Plan, Target};
use crate::report::Estimate;
use crate::schema::{POSITION_BYTES, Schema};

/// Bytes of a hierarchy record, and of metadata and report together.
const NODE_BYTES: u64 = 22;
const JSON_BYTES: u64 = 16 << 10;

/// Bytes of a node of a binary tree in its index, and of a batch.
const INDEX_NODE_BYTES: u64 = 220;
const BATCH_BYTES: u64 = 32;

/// What an output takes on disk: of each point, and of nodes or batches for a thousand points.
struct Size {
    per_point: u64,
    per_1000_points: u64,
}

impl Size {
    /// An upper bound; `attributes`: bytes of those that an octree would keep.
    fn of(target: &Target, plan: &Plan, schema: &Schema, attributes: u64) -> Self {
        let is_usual = plan.attributes == AttributeChoice::Usual;
        match target {
            Target::Potree2 => {
                let nodes = 3000 / u64::from(plan.leaf_capacity).max(1) + 1;
                Self { per_point: POSITION_BYTES as u64 + attributes, per_1000_points: nodes * NODE_BYTES }
            }
            Target::Bintree(settings) => {
                // Leaves are two thirds full, and there is an inner node for each.
                let nodes = 3000 / u64::from(settings.capacity).max(1) + 1;
                let class = needs::class(schema).map_or(0, |i| schema.attributes[i].size() as u64);
                let extras = if is_usual { 0 } else { attributes.saturating_sub(class).next_multiple_of(4) };
                Self { per_point: CORE_BYTES as u64 + extras, per_1000_points: nodes * INDEX_NODE_BYTES }
            }
            Target::Batches(settings) => {
                let colour = needs::colour(schema).map_or(0, |i| schema.attributes[i].size() as u64);
                let extras = if is_usual { 0 } else { attributes.saturating_sub(colour) };
                let planes = u64::from(settings.planes.unwrap_or(3));
                // Colour word, and index and word of an original for points of the coarser levels.
                let originals = if settings.originals { 8 } else { 0 };
                Self { per_point: 4 * planes + 4 + originals + extras, per_1000_points: BATCH_BYTES }
            }
        }
    }
}

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
    let all = kept.iter().map(size).sum::<usize>() as u64;
    let sizes: Vec<Size> = plan.targets.iter().map(|t| Size::of(t, plan, &job.schema, all)).collect();
    let bytes_per_point: u64 = sizes.iter().map(|s| s.per_point).sum();
    let bounds = job.bounds_hint.map(|b| LatticeBounds {
        min: std::array::from_fn(|a| job.lattice.quantize(a, b.min[a])),
        max: std::array::from_fn(|a| job.lattice.quantize(a, b.max[a])),
    });
    let cube = bounds.and_then(|b| Cube::around(&b, &job.lattice).ok());
    let points = job.points_declared / plan.filter.every.max(1);
    let stride = job.schema.stride as u64;
    let of_nodes: u64 = sizes.iter().map(|s| points * s.per_1000_points / 1000).sum();
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
        output_bytes: points * bytes_per_point + of_nodes + JSON_BYTES,
        warnings,
    })
}
