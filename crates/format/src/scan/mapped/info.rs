//! What is known of a mapped scan before its points are decoded.

use super::directions::has_normals;
use super::map::{PointMap, ScanMap};
use super::positions::{PositionMap, move_all};
use crate::{Aabb, Affine, Resolution, Scan, ScanInfo, ScanPart, ScanWarning};

/// Points per side of the grid whose images stand for those of a box: x, y, z.
const GRID: [usize; 3] = [13, 13, 3];

/// Steps of the differences that stand for derivatives, as part of the coordinate.
const DIFFERENCE: f64 = 1e-6;

/// The description of the mapped scan.
pub(super) fn mapped(inner: &dyn Scan, map: &ScanMap, positions: &PositionMap) -> ScanInfo {
    let own = inner.info();
    let mut info = own.clone();
    info.lattice = match positions {
        PositionMap::Lattice { lattice, .. } => Some(*lattice),
        PositionMap::World { .. } => None,
    };
    info.bounds_declared = own.bounds_declared.and_then(|bounds| image(map, &bounds));
    info.resolution = resolution(inner, map);
    info.parts.iter_mut().for_each(|part| move_part(map, part));
    info.warnings.extend(map.warnings.iter().cloned());
    if map.projection.is_some() && (!own.parts.is_empty() || has_normals(own)) {
        info.warnings.push(ScanWarning::DirectionsProjected);
    }
    info
}

/// The box of the image of a box; `None` if nothing of it has one.
fn image(map: &ScanMap, bounds: &Aabb) -> Option<Aabb> {
    let Some(projection) = &map.projection else {
        let image = map.affine.bounds(bounds);
        return image.min.iter().chain(&image.max).all(|v| v.is_finite()).then_some(image);
    };
    let extent = bounds.extent();
    let at = |axis: usize, i: usize| bounds.min[axis] + extent[axis] * i as f64 / (GRID[axis] - 1) as f64;
    let mut points: [Vec<f64>; 3] = Default::default();
    for i in 0..GRID[0] * GRID[1] * GRID[2] {
        let place = [i % GRID[0], i / GRID[0] % GRID[1], i / (GRID[0] * GRID[1])];
        points.iter_mut().enumerate().for_each(|(axis, values)| values.push(at(axis, place[axis])));
    }
    project(&map.affine, &**projection, &mut points);
    let mut image = Aabb::EMPTY;
    let [x, y, z] = &points;
    for ((x, y), z) in x.iter().zip(y).zip(z) {
        if x.is_finite() && y.is_finite() && z.is_finite() {
            image.grow([*x, *y, *z]);
        }
    }
    (!image.is_empty()).then_some(image)
}

fn project(affine: &Affine, projection: &dyn PointMap, points: &mut [Vec<f64>; 3]) {
    move_all(affine, points);
    projection.map(points.each_mut().map(Vec::as_mut_slice));
}

/// How finely the mapped coordinates are stored: each step of the file, seen along the axes of the image.
fn resolution(inner: &dyn Scan, map: &ScanMap) -> Resolution {
    let own = inner.info();
    let is_unchanged = map.projection.is_none() && is_permutation(&map.affine);
    if own.lattice.is_none() && (is_unchanged || own.resolution == Resolution::Double) {
        return own.resolution;
    }
    let Some(bounds) = inner.bounds_hint() else { return Resolution::Double };
    let steps = match (own.lattice, own.resolution) {
        (Some(lattice), _) => lattice.scale,
        (None, Resolution::Step(step)) => [step; 3],
        (None, _) => single_steps(&bounds),
    };
    let Some(derivatives) = derivatives(map, bounds.center()) else { return Resolution::Double };
    let along = |row: [f64; 3]| row.iter().zip(steps).fold(0.0f64, |sum, (d, step)| sum.hypot(d * step));
    let least = derivatives.map(along).into_iter().filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
    if least.is_finite() { Resolution::Step(least) } else { Resolution::Double }
}

/// True if numbers are the same as before but for the axis and the sign.
fn is_permutation(affine: &Affine) -> bool {
    let is_one = |axes: [(usize, f64); 3]| axes.iter().all(|(_, factor)| factor.abs() == 1.0);
    affine.translation() == [0.0; 3] && affine.axes().is_some_and(is_one)
}

/// The steps of single precision at the far ends of the box.
fn single_steps(bounds: &Aabb) -> [f64; 3] {
    std::array::from_fn(|a| {
        let far = bounds.min[a].abs().max(bounds.max[a].abs());
        if far > 0.0 { 2f64.powi(far.log2().floor() as i32 - 23) } else { 0.0 }
    })
}

/// The derivatives of the map at a place, by row; `None` where it has no image.
fn derivatives(map: &ScanMap, place: [f64; 3]) -> Option<[[f64; 3]; 3]> {
    let Some(projection) = &map.projection else { return Some(*map.affine.linear()) };
    let difference = place.map(|v| DIFFERENCE * v.abs().max(1.0));
    let mut points: [Vec<f64>; 3] = Default::default();
    for i in 0..6 {
        for axis in 0..3 {
            let side = if i / 2 != axis { 0.0 } else { difference[axis] * if i % 2 == 0 { 1.0 } else { -1.0 } };
            points[axis].push(place[axis] + side);
        }
    }
    project(&map.affine, &**projection, &mut points);
    let by = |i: usize, j: usize| (points[i][2 * j] - points[i][2 * j + 1]) / (2.0 * difference[j]);
    let rows: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| by(i, j)));
    rows.iter().flatten().all(|v| v.is_finite()).then_some(rows)
}

/// Where a scan within the file is now. Its rotation turns with the affine map, not with a projection.
fn move_part(map: &ScanMap, part: &mut ScanPart) {
    let columns = [0, 1, 2].map(|j| map.affine.turn(part.rotation.map(|row| row[j])));
    part.rotation = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i]));
    part.bounds = part.bounds.and_then(|bounds| image(map, &bounds));
    let mut place = part.translation.map(|v| vec![v]);
    move_all(&map.affine, &mut place);
    if let Some(projection) = &map.projection {
        projection.map(place.each_mut().map(Vec::as_mut_slice));
    }
    part.translation = place.map(|v| v.first().copied().unwrap_or(f64::NAN));
}
