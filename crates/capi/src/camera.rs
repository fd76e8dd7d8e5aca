//! Where a picture is taken from.

use pointmill_format::batches::focal_pixels;
use pointmill_format::octree::Viewpoint;
use pointmill_format::{Frustum, Lattice};

use crate::axes::PmAxes;
use crate::status::{Fault, Outcome};

/// A perspective camera, world units, in the axes of the handle.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PmCamera {
    /// Where it is.
    pub eye: [f64; 3],
    /// The direction of view, of any length > 0.
    pub forward: [f64; 3],
    /// What is up in the picture, of any length; chosen where it is parallel to `forward`.
    pub up: [f64; 3],
    /// Angle between the upper and the lower border of the picture, radians, > 0 and < π.
    pub vertical_fov: f64,
    /// Nothing nearer is in the picture, ≥ 0.
    pub near: f64,
    /// Nothing beyond is in the picture; 0: no limit.
    pub far: f64,
    /// Pixels from left to right, ≥ 1.
    pub width: u32,
    /// Pixels from top to bottom, ≥ 1.
    pub height: u32,
}

/// A camera in the axes of the file.
pub(crate) struct View {
    pub(crate) eye: [f64; 3],
    pub(crate) frustum: Frustum,
    /// Pixels per unit at a depth of one unit.
    pub(crate) focal: f64,
    pub(crate) viewpoint: Viewpoint,
}

impl PmCamera {
    pub(crate) fn view(&self, axes: PmAxes) -> Outcome<View> {
        let all = [self.eye, self.forward, self.up, [self.vertical_fov, self.near, self.far]];
        if all.as_flattened().iter().any(|v| !v.is_finite()) {
            return Err(Fault::argument("the camera has a number that is not finite"));
        }
        let length = self.forward.iter().map(|v| v * v).sum::<f64>();
        if !(length > 0.0 && length.is_finite()) {
            return Err(Fault::argument(format!("the camera looks in the direction {:?}", self.forward)));
        }
        if !(self.vertical_fov > 0.0 && self.vertical_fov < std::f64::consts::PI) {
            let text = format!("the camera has a field of view of {} radians, not between 0 and π", self.vertical_fov);
            return Err(Fault::argument(text));
        }
        if self.width == 0 || self.height == 0 {
            return Err(Fault::argument(format!("the picture has {} × {} pixels", self.width, self.height)));
        }
        let far = if self.far == 0.0 { 4.0 * Lattice::FARTHEST } else { self.far };
        if !(0.0..far).contains(&self.near) {
            return Err(Fault::argument(format!("the picture begins at {} and ends at {far}", self.near)));
        }
        let [eye, forward, up] = [self.eye, self.forward, self.up].map(|v| axes.inward(v));
        let up = if up == [0.0; 3] { forward } else { up };
        let aspect = f64::from(self.width) / f64::from(self.height);
        let frustum = Frustum::perspective(eye, forward, up, self.vertical_fov, aspect, [self.near, far]);
        let focal = focal_pixels(self.height.into(), self.vertical_fov);
        Ok(View { eye, frustum, focal, viewpoint: Viewpoint::new(eye, forward, focal, frustum) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::status::PmStatus;

    #[test]
    fn cameras_that_see_nothing_are_refused() {
        let sound = PmCamera {
            eye: [0.0; 3],
            forward: [0.0, 1.0, 0.0],
            up: [0.0; 3],
            vertical_fov: 1.0,
            near: 0.1,
            far: 0.0,
            width: 100,
            height: 100,
        };
        assert!(sound.view(PmAxes::YUp).is_ok(), "up is chosen");
        for broken in [
            PmCamera { eye: [f64::NAN; 3], ..sound },
            PmCamera { forward: [0.0; 3], ..sound },
            PmCamera { forward: [1e200, 0.0, 0.0], ..sound },
            PmCamera { vertical_fov: 3.2, ..sound },
            PmCamera { vertical_fov: 0.0, ..sound },
            PmCamera { width: 0, ..sound },
            PmCamera { near: -1.0, ..sound },
            PmCamera { near: 2.0, far: 2.0, ..sound },
        ] {
            assert_eq!(
                broken.view(PmAxes::ZUp).err().map(|fault| fault.status),
                Some(PmStatus::Argument),
                "{broken:?}"
            );
        }
    }
}
