//! A camera and the size of a picture: where places of the world are in it.

use pointmill_format::Aabb;
use pointmill_format::Frustum;
use pointmill_format::octree::Viewpoint;

use crate::vector::{dot, minus};
use crate::{Camera, CameraError, Size};

/// From the world to the picture.
///
/// Positions become relative to the eye in double precision before anything else, so that coordinates of 10^7 do not
/// jitter; what remains is small enough for single precision.
#[derive(Debug, Clone)]
pub(crate) struct Projection {
    pub(crate) eye: [f64; 3],
    /// Right, up and forward.
    pub(crate) axes: [[f64; 3]; 3],
    pub(crate) size: Size,
    /// Pixels per unit at a depth of one unit.
    pub(crate) focal: f64,
    pub(crate) frustum: Frustum,
}

/// Coordinates as they are stored, and where they are relative to the eye: `stored · scale + shift`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    scale: [f64; 3],
    shift: [f64; 3],
}

impl Projection {
    pub(crate) fn new(camera: &Camera, size: Size) -> Result<Self, CameraError> {
        let axes = camera.axes()?;
        let fov = camera.vertical_fov.to_radians();
        let focal = pointmill_format::batches::focal_pixels(size.height().into(), fov);
        let everything = [0.0, 4.0 * pointmill_format::Lattice::FARTHEST];
        let frustum = Frustum::perspective(camera.eye, axes[2], axes[1], fov, size.aspect(), everything);
        Ok(Self { eye: camera.eye, axes, size, focal, frustum })
    }

    /// World coordinates.
    pub(crate) fn world_frame(&self) -> Frame {
        Frame { scale: [1.0; 3], shift: self.eye.map(|c| -c) }
    }

    /// Integers on a lattice.
    pub(crate) fn lattice_frame(&self, lattice: &pointmill_format::Lattice) -> Frame {
        Frame { scale: lattice.scale, shift: minus(lattice.offset, self.eye) }
    }

    /// Right, up and forward of a place, relative to the eye, world units.
    #[inline]
    pub(crate) fn view(&self, frame: &Frame, stored: [f64; 3]) -> [f64; 3] {
        let relative: [f64; 3] = std::array::from_fn(|a| stored[a] * frame.scale[a] + frame.shift[a]);
        self.axes.map(|axis| dot(axis, relative))
    }

    /// Pixels from the left and from the top, and the depth, of a place of the world; `None` behind the eye.
    #[cfg(test)]
    pub(crate) fn pixel(&self, world: [f64; 3]) -> Option<[f64; 3]> {
        let [x, y, depth] = self.view(&self.world_frame(), world);
        let [width, height] = [self.size.width(), self.size.height()].map(f64::from);
        let scale = self.focal / depth;
        (depth > 0.0).then_some([width / 2.0 + x * scale, height / 2.0 - y * scale, depth])
    }

    /// False if nothing of the box is in the picture.
    pub(crate) fn may_see(&self, bounds: &Aabb) -> bool {
        self.frustum.may_see(bounds)
    }

    /// What a walk through an octree must know.
    pub(crate) fn viewpoint(&self) -> Viewpoint {
        Viewpoint::new(self.eye, self.axes[2], self.focal, self.frustum)
    }
}

#[cfg(test)]
mod tests {
    use pointmill_format::Lattice;

    use super::*;

    /// 90 degrees: a place as far above as ahead is on the border.
    fn projection(eye: [f64; 3]) -> Projection {
        let camera = Camera { vertical_fov: 90.0, ..Camera::new(eye, [eye[0], eye[1] + 1.0, eye[2]]) };
        Projection::new(&camera, Size::new(160, 120).unwrap()).unwrap()
    }

    #[test]
    fn places_are_where_they_were_computed_by_hand() {
        let projection = projection([1.0, 2.0, 3.0]);
        assert!((projection.focal - 60.0).abs() < 1e-12, "half of 120 pixels at 45 degrees: {}", projection.focal);
        let close = |world, expected: [f64; 3]| {
            let found = projection.pixel(world).unwrap();
            assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-9), "{found:?} {expected:?}");
        };
        close([1.0, 12.0, 3.0], [80.0, 60.0, 10.0]);
        close([1.0, 12.0, 13.0], [80.0, 0.0, 10.0]);
        close([6.0, 12.0, -2.0], [110.0, 90.0, 10.0]);
        assert_eq!(projection.pixel([1.0, 1.0, 3.0]), None, "behind");
    }

    #[test]
    fn far_from_the_origin_nothing_jitters() {
        let eye = [4.4e7 + 0.123, -5.2e7 - 0.457, 100.1];
        let (near, far) = (projection([0.0; 3]), projection(eye));
        let lattice = Lattice { scale: [0.001; 3], offset: eye };
        for stored in [[123.0, 4567.0, 89.0], [-2001.0, 10_000.0, 1.0]] {
            let there = far.view(&far.lattice_frame(&lattice), stored);
            let here = near.view(&near.world_frame(), stored.map(|v| v * 0.001));
            assert_eq!(there, here);
        }
    }

    #[test]
    fn spheres_shrink_with_the_distance() {
        let projection = projection([0.0; 3]);
        let around = |y: f64| Aabb { min: [-1.0, y - 1.0, -1.0], max: [1.0, y + 1.0, 1.0] };
        let [pixels, angle] = projection.viewpoint().sphere(&around(10.0));
        assert!((pixels - 3f64.sqrt() * 6.0).abs() < 1e-12 && angle == 0.0, "{pixels} {angle}");
        assert_eq!(projection.viewpoint().sphere(&around(1.0))[0], f64::INFINITY, "from inside");
        assert!((projection.viewpoint().sphere(&around(-10.0))[1] - std::f64::consts::PI).abs() < 1e-12);
        assert!(projection.may_see(&around(10.0)) && !projection.may_see(&around(-10.0)));
    }
}
