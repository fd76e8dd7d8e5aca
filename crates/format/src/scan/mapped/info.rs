//! What is known of a mapped scan before its points are decoded.

use super::directions::has_normals;
use super::map::ScanMap;
use super::positions::{PositionMap, move_all, project};
use super::resolution::resolutions;
use crate::{Aabb, Affine, Scan, ScanInfo, ScanPart, ScanWarning};

/// Points per side of the grid whose images stand for those of a box: x, y, z.
const GRID: [usize; 3] = [13, 13, 3];

/// The description of the mapped scan.
pub(super) fn mapped(inner: &dyn Scan, map: &ScanMap, positions: &PositionMap) -> ScanInfo {
    let own = inner.info();
    let mut info = own.clone();
    info.lattice = match positions {
        PositionMap::Lattice { lattice, .. } => Some(*lattice),
        PositionMap::World { .. } => None,
    };
    info.bounds_declared = own.bounds_declared.and_then(|bounds| image(map, &bounds));
    info.resolution = resolutions(inner, map);
    info.parts.iter_mut().for_each(|part| move_part(map, part));
    info.warnings.extend(map.warnings.iter().cloned());
    if map.projection.is_some() && (!own.parts.is_empty() || has_normals(own)) {
        info.warnings.push(ScanWarning::DirectionsProjected);
    }
    let is_turned = map.projection.is_some() || map.affine.linear() != Affine::IDENTITY.linear();
    if is_turned && own.attribute("rot_0").is_some() {
        info.warnings.push(ScanWarning::SplatsUnturned);
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
