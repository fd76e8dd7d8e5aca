//! Which points of a batch pass the filter.

use pointmill_format::{Aabb, Column, Lattice, PointBatch, Positions, with_column};

use super::visit::Visit;
use crate::cloud::Stats;
use crate::error::{ConvertError, InputFault};
use crate::plan::{OnFault, OriginPoints, Plan};
use crate::runtime::{Vectors, vectorized};

/// Fills `selection` with the points that pass the filter; false if all do.
pub(crate) fn select(
    plan: &Plan,
    visit: &mut Visit<'_>,
    batch: &PointBatch,
    stats: &mut Stats,
    selection: &mut Vec<u32>,
) -> Result<bool, ConvertError> {
    let filter = &plan.filter;
    let bounds = world_bounds(visit.lattice(), &batch.positions);
    visit.seen.bounds = visit.seen.bounds.union(&bounds);
    let at_origin = visit.origins.count(batch);
    visit.seen.at_origin += at_origin;
    let skips_origin = filter.origin_points == OriginPoints::Skip && at_origin > 0;
    let (info, cut, far_cut) = (visit.info(), visit.cut.as_ref(), visit.far_cut.as_ref());
    let regions = &visit.regions;
    let all_inside = [cut, far_cut].into_iter().flatten().all(|cut| cut.holds_all(&batch.positions))
        && (regions.is_empty() || regions.iter().any(|region| region.holds_all(&batch.positions)));
    let is_inside = |i: usize| {
        cut.is_none_or(|cut| cut.holds(&batch.positions, i))
            && (regions.is_empty() || regions.iter().any(|region| region.holds(&batch.positions, i)))
    };
    let all_finite = match &batch.positions {
        Positions::Quantized(_) => true,
        Positions::World(p) => p.iter().all(|axis| axis.iter().all(|v| v.is_finite())),
    };
    if filter.every < 2 && all_inside && filter.classes.is_none() && all_finite && !skips_origin {
        return Ok(false);
    }
    let class_column = info.attributes.iter().position(|a| a.name == "classification");
    let classes = class_column.map(|c| &batch.columns[c]).filter(|_| filter.classes.is_some()).map(whole_numbers);
    let is_finite = |i: usize| match &batch.positions {
        Positions::Quantized(_) => true,
        Positions::World(p) => p.iter().all(|axis| axis[i].is_finite()),
    };
    selection.clear();
    for i in 0..batch.len() {
        if filter.every > 1 && !(batch.first_point + i as u64).is_multiple_of(filter.every) {
            stats.thinned += 1;
            continue;
        }
        if !is_finite(i) {
            if plan.invalid == OnFault::Fail {
                let path = info.path.clone();
                return Err(InputFault::InvalidPosition { path, point: batch.first_point + i as u64 }.into());
            }
            stats.invalid += 1;
        } else if skips_origin && visit.origins.hold(batch, i) {
            stats.origin_skipped += 1;
        } else if !is_inside(i) {
            stats.outside_bounds += 1;
        } else if far_cut.is_some_and(|cut| !cut.holds(&batch.positions, i)) {
            stats.outliers += 1;
        } else if filter
            .classes
            .as_ref()
            .is_some_and(|c| !classes.as_ref().map_or(Some(0), |v| v[i]).is_some_and(|class| c.contains(&class)))
        {
            stats.other_class += 1;
        } else {
            selection.push(i as u32);
        }
    }
    Ok(selection.len() < batch.len())
}

/// Classes of any type as whole numbers; `None`: no whole number, and so no class.
#[allow(clippy::unnecessary_cast)] // one body for every type of column
fn whole_numbers(column: &Column) -> Vec<Option<i64>> {
    with_column!(column, v => v.iter().map(|v| Some(*v as i64).filter(|class| *class as f64 == *v as f64)).collect())
}

vectorized! {
    /// The smallest and the largest.
    fn extremes(values: &[i32]) -> Option<(i32, i32)> = extremes_anyhow;
}

#[inline(always)]
fn extremes_anyhow(values: &[i32]) -> Option<(i32, i32)> {
    let first = *values.first()?;
    Some(values.iter().fold((first, first), |(min, max), v| (min.min(*v), max.max(*v))))
}

fn world_bounds(lattice: Option<&Lattice>, positions: &Positions) -> Aabb {
    let mut bounds = Aabb::EMPTY;
    for a in 0..3 {
        let (min, max) = match positions {
            Positions::Quantized(p) => {
                let (scale, offset) = lattice.map_or((1.0, 0.0), |l| (l.scale[a], l.offset[a]));
                let Some((min, max)) = extremes(Vectors::best(), &p[a]) else { continue };
                (f64::from(min) * scale + offset, f64::from(max) * scale + offset)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_set_of_instructions_finds_the_same_extremes() {
        let mut random = pointmill_testkit::Random::new(6);
        for vectors in Vectors::all() {
            assert_eq!(extremes(vectors, &[]), None);
            assert_eq!(extremes(vectors, &[i32::MAX, i32::MIN]), Some((i32::MIN, i32::MAX)));
            // the smallest and the largest at every place of several vectors and what is left behind them
            for count in [1, 7, 8, 75] {
                for at in 0..count {
                    let mut values: Vec<i32> = (0..count).map(|_| random.below(1000) as i32 - 500).collect();
                    values[at] = -600;
                    values[(at + count / 2) % count] += 1200;
                    let expected = (values.iter().copied().min(), values.iter().copied().max());
                    let (min, max) = extremes(vectors, &values).unwrap();
                    assert_eq!((Some(min), Some(max)), expected, "{vectors:?} {values:?}");
                }
            }
        }
    }

    #[test]
    fn bounds_are_in_world_units_and_of_what_is_finite() {
        let lattice = Lattice { scale: [0.5, 0.25, 2.0], offset: [10.0, 0.0, -1.0] };
        let q = Positions::Quantized([vec![4, -2, 0], vec![8, 8, 8], vec![i32::MAX, 0, i32::MIN]]);
        let found = world_bounds(Some(&lattice), &q);
        assert_eq!(found, Aabb { min: [9.0, 2.0, -4_294_967_297.0], max: [12.0, 2.0, 4_294_967_293.0] });
        let world = Positions::World([vec![1.0, f64::NAN], vec![2.0, 5.0], vec![f64::INFINITY, -3.0]]);
        assert_eq!(world_bounds(None, &world), Aabb { min: [1.0, 2.0, -3.0], max: [1.0, 5.0, -3.0] });
    }
}
