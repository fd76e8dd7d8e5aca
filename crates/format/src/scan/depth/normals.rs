//! Normals from the grid of a depth image.

use super::grid::Grid;
use crate::Intrinsics;
use crate::geometry::vectors::{cross, dot, minus, unit};

/// Neighbours whose depth differs by more than this part of it are of another surface.
const MAX_STEP: f64 = 0.05;

/// The normal of a pixel with a depth, in the axes of the camera and towards it; zeros where no two directions are known.
///
/// It is the cross product of the differences of the neighbours left and right, and above and below; where one of two is
/// missing, or of another surface, of the pixel and the other one.
pub(super) fn normal(grid: &Grid, camera: &Intrinsics, [u, v]: [usize; 2]) -> [f64; 3] {
    let Some(depth) = grid.depth(u, v) else { return [0.0; 3] };
    let place = camera.place([u, v], depth);
    let neighbour = |column: Option<usize>, row: Option<usize>| {
        let (column, row) = (column?, row?);
        let other = grid.depth(column, row).filter(|other| (other - depth).abs() <= MAX_STEP * depth)?;
        Some(camera.place([column, row], other))
    };
    let along = |before: Option<[f64; 3]>, after: Option<[f64; 3]>| match (before, after) {
        (None, None) => None,
        (before, after) => Some(minus(after.unwrap_or(place), before.unwrap_or(place))),
    };
    let across = along(neighbour(u.checked_sub(1), Some(v)), neighbour(u.checked_add(1), Some(v)));
    let down = along(neighbour(Some(u), v.checked_sub(1)), neighbour(Some(u), v.checked_add(1)));
    let Some((across, down)) = across.zip(down) else { return [0.0; 3] };
    let normal = unit(cross(across, down));
    if normal.iter().any(|n| n.is_nan()) {
        return [0.0; 3];
    }
    if dot(normal, place) > 0.0 { normal.map(|n| -n) } else { normal }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAMERA: Intrinsics = Intrinsics { focal: [20.0, 20.0], centre: [7.5, 5.5], size: None };

    /// The plane n · p = d as the camera sees it.
    fn plane(n: [f64; 3], d: f64) -> Grid {
        let (width, height) = (16, 12);
        let depth = |u: usize, v: usize| d / dot(n, CAMERA.place([u, v], 1.0));
        let depths = (0..width * height).map(|i| depth(i % width, i / width)).collect();
        Grid { width, height, depths }
    }

    #[test]
    fn a_plane_has_its_normal_everywhere_towards_the_camera() {
        let n = unit([0.2, -0.1, -1.0]);
        let grid = plane(n, -2.0);
        for v in 0..12 {
            for u in 0..16 {
                let found = normal(&grid, &CAMERA, [u, v]);
                assert!((dot(found, n) - 1.0).abs() < 1e-12, "{u} {v}: {found:?}");
            }
        }
    }

    #[test]
    fn an_edge_and_a_hole_bend_no_normal_and_a_lone_pixel_has_none() {
        let n = [0.0, 0.0, -1.0];
        let mut grid = plane(n, -2.0);
        for v in 0..12 {
            grid.depths[v * 16 + 8..(v + 1) * 16].fill(3.0);
        }
        grid.depths[5 * 16 + 3] = 0.0;
        grid.depths[9 * 16 + 12] = 1.0;
        for (u, v) in [(7, 3), (8, 3), (2, 5), (3, 4), (4, 5), (11, 9)] {
            assert_eq!(normal(&grid, &CAMERA, [u, v]).map(|c| c.round()), n, "{u} {v}");
        }
        assert_eq!(normal(&grid, &CAMERA, [12, 9]), [0.0; 3], "all neighbours are of another surface");
        assert_eq!(normal(&grid, &CAMERA, [3, 5]), [0.0; 3], "a hole");
    }
}
