//! How finely mapped coordinates are stored.

use super::map::{PointMap, ScanMap};
use super::positions::{move_all, project};
use crate::{Aabb, Affine, AxisGrid, Resolution, Scan};

/// Differences that stand for derivatives, as part of the coordinate.
const DIFFERENCE: f64 = 1e-6;

/// What the mapped coordinates resolve: where an axis follows one axis of the file, the steps of that; else all steps of
/// the file, seen along the axis.
pub(super) fn resolutions(inner: &dyn Scan, map: &ScanMap) -> [Resolution; 3] {
    let bounds = inner.bounds_hint();
    let own = own(inner);
    let affine = map.affine.linear().map(alone);
    let follows = match (&map.projection, &bounds) {
        (None, _) => affine,
        (Some(projection), Some(bounds)) if keeps_heights(&map.affine, &**projection, bounds) => {
            [None, None, affine[2]]
        }
        (Some(_), _) => [None; 3],
    };
    let derivatives = bounds.and_then(|bounds| derivatives(map, bounds.center()));
    std::array::from_fn(|i| match (follows[i], derivatives) {
        (Some((axis, factor)), _) => {
            let far = bounds.map(|b| b.min[axis].abs().max(b.max[axis].abs()));
            moved(own[axis], factor, map.affine.translation()[i], far)
        }
        (None, Some(derivatives)) => mixed(&own, derivatives[i], &bounds),
        (None, None) => Resolution::Double,
    })
}

/// What the file resolves, its lattice included.
fn own(inner: &dyn Scan) -> [Resolution; 3] {
    let info = inner.info();
    let grid = |a: usize| info.lattice.map(|l| AxisGrid { step: l.scale[a], offset: l.offset[a] });
    std::array::from_fn(|a| grid(a).map_or(info.resolution[a], Resolution::Grid))
}

/// The only axis that a row follows, and its factor.
fn alone(row: [f64; 3]) -> Option<(usize, f64)> {
    let mut factors = row.into_iter().enumerate().filter(|(_, factor)| *factor != 0.0);
    factors.next().filter(|_| factors.next().is_none())
}

/// `coordinate · factor + shift`; `far`: the largest coordinate of the axis before.
fn moved(own: Resolution, factor: f64, shift: f64, far: Option<f64>) -> Resolution {
    match own {
        Resolution::Grid(AxisGrid { step, offset }) => {
            Resolution::Grid(AxisGrid { step: step * factor.abs(), offset: offset * factor + shift })
        }
        Resolution::Step(step) => Resolution::Step(step * factor.abs()),
        Resolution::Single if factor.abs() == 1.0 && shift == 0.0 => Resolution::Single,
        Resolution::Single => match far.map(single_step) {
            Some(step) if step > 0.0 => Resolution::Step(step * factor.abs()),
            _ => Resolution::Double,
        },
        Resolution::Double => Resolution::Double,
    }
}

/// An axis that follows several.
fn mixed(own: &[Resolution; 3], derivatives: [f64; 3], bounds: &Option<Aabb>) -> Resolution {
    let far = |axis: usize| bounds.map_or(0.0, |b| b.min[axis].abs().max(b.max[axis].abs()));
    let mut sum = 0.0f64;
    for (axis, derivative) in derivatives.into_iter().enumerate().filter(|(_, derivative)| *derivative != 0.0) {
        let step = match own[axis] {
            Resolution::Grid(AxisGrid { step, .. }) | Resolution::Step(step) => step,
            Resolution::Single => single_step(far(axis)),
            Resolution::Double => return Resolution::Double,
        };
        sum = sum.hypot(derivative * step);
    }
    if sum > 0.0 { Resolution::Step(sum) } else { Resolution::Double }
}

/// The step of single precision at a coordinate.
fn single_step(far: f64) -> f64 {
    if far > 0.0 { 2f64.powi(far.log2().floor() as i32 - 23) } else { 0.0 }
}

/// True if the projection leaves z as it is, at the corners of the box.
fn keeps_heights(affine: &Affine, projection: &dyn PointMap, bounds: &Aabb) -> bool {
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] });
    let mut points: [Vec<f64>; 3] = Default::default();
    (0..8).map(corner).for_each(|point| push(&mut points, point));
    move_all(affine, &mut points);
    let heights = points[2].clone();
    projection.map(points.each_mut().map(Vec::as_mut_slice));
    points[2] == heights
}

/// The derivatives of the map at a place, by row; `None` where it has no image.
fn derivatives(map: &ScanMap, place: [f64; 3]) -> Option<[[f64; 3]; 3]> {
    let Some(projection) = &map.projection else { return Some(*map.affine.linear()) };
    let difference = place.map(|v| DIFFERENCE * v.abs().max(1.0));
    let mut points: [Vec<f64>; 3] = Default::default();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let mut point = place;
            point[axis] += sign * difference[axis];
            push(&mut points, point);
        }
    }
    project(&map.affine, &**projection, &mut points);
    let by = |i: usize, j: usize| (points[i][2 * j] - points[i][2 * j + 1]) / (2.0 * difference[j]);
    let rows: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| by(i, j)));
    rows.iter().flatten().all(|v| v.is_finite()).then_some(rows)
}

fn push(points: &mut [Vec<f64>; 3], point: [f64; 3]) {
    points.iter_mut().zip(point).for_each(|(values, v)| values.push(v));
}
