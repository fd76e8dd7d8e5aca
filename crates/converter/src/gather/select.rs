//! Which points of a batch pass the filter.

use pointmill_format::{Aabb, Column, Lattice, PointBatch, Positions, with_column};

use super::context::Context;
use crate::cloud::Stats;
use crate::error::{ConvertError, InputFault};
use crate::plan::OnFault;

/// Fills `selection` with the points that pass the filter; false if all do.
pub(super) fn select(
    pass: &Context<'_>,
    source: usize,
    batch: &PointBatch,
    stats: &mut Stats,
    selection: &mut Vec<u32>,
) -> Result<bool, ConvertError> {
    let scan = &pass.sources.all[source].scan;
    let filter = &pass.plan.filter;
    let bounds = world_bounds(scan.info().lattice.as_ref(), &batch.positions);
    stats.sources[source].bounds = stats.sources[source].bounds.union(&bounds);
    let is_inside = |b: Aabb| b.contains(bounds.min) && b.contains(bounds.max);
    let all_inside = filter.bounds.is_none_or(is_inside) && pass.far_cut.is_none_or(is_inside);
    let all_finite = match &batch.positions {
        Positions::Quantized(_) => true,
        Positions::World(p) => p.iter().all(|axis| axis.iter().all(|v| v.is_finite())),
    };
    if filter.every < 2 && all_inside && filter.classes.is_none() && all_finite {
        return Ok(false);
    }
    let class_column = scan.info().attributes.iter().position(|a| a.name == "classification");
    let classes = class_column.map(|c| &batch.columns[c]).filter(|_| filter.classes.is_some()).map(whole_numbers);
    let world = |i: usize| -> [f64; 3] {
        match (&batch.positions, scan.info().lattice.as_ref()) {
            (Positions::Quantized(p), Some(l)) => {
                std::array::from_fn(|a| f64::from(p[a][i]) * l.scale[a] + l.offset[a])
            }
            (Positions::Quantized(p), None) => std::array::from_fn(|a| f64::from(p[a][i])),
            (Positions::World(p), _) => std::array::from_fn(|a| p[a][i]),
        }
    };
    selection.clear();
    for i in 0..batch.len() {
        if filter.every > 1 && !(batch.first_point + i as u64).is_multiple_of(filter.every) {
            stats.thinned += 1;
            continue;
        }
        let p = world(i);
        if !p.iter().all(|v| v.is_finite()) {
            if pass.plan.invalid == OnFault::Fail {
                let path = scan.info().path.clone();
                return Err(InputFault::InvalidPosition { path, point: batch.first_point + i as u64 }.into());
            }
            stats.invalid += 1;
        } else if filter.bounds.is_some_and(|b| !b.contains(p)) {
            stats.outside_bounds += 1;
        } else if pass.far_cut.is_some_and(|b| !b.contains(p)) {
            stats.outliers += 1;
        } else if filter
            .classes
            .as_ref()
            .is_some_and(|c| !c.iter().any(|c| i64::from(*c) == classes.as_ref().map_or(0, |v| v[i])))
        {
            stats.other_class += 1;
        } else {
            selection.push(i as u32);
        }
    }
    Ok(selection.len() < batch.len())
}

/// Classes of any type as whole numbers; what is none is no class, −1.
#[allow(clippy::unnecessary_cast)] // one body for every type of column
fn whole_numbers(column: &Column) -> Vec<i64> {
    with_column!(column, v => v.iter().map(|v| if (*v as i64) as f64 == *v as f64 { *v as i64 } else { -1 }).collect())
}

fn world_bounds(lattice: Option<&Lattice>, positions: &Positions) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    for a in 0..3 {
        let (min, max) = match positions {
            Positions::Quantized(p) => {
                let (scale, offset) = lattice.map_or((1.0, 0.0), |l| (l.scale[a], l.offset[a]));
                let (Some(min), Some(max)) = (p[a].iter().min(), p[a].iter().max()) else { continue };
                (f64::from(*min) * scale + offset, f64::from(*max) * scale + offset)
            }
            Positions::World(p) => p[a]
                .iter()
                .filter(|v| v.is_finite())
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), v| (lo.min(*v), hi.max(*v))),
        };
        bounds.min[a] = min;
        bounds.max[a] = max;
    }
    bounds
}
