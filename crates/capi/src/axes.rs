//! Which way is up for the caller.

use pointmill_format::Aabb;

use crate::status::{Fault, Outcome};

/// The axes of everything that a handle takes and gives in world coordinates: boxes, positions, cameras, rays, hits.
/// Files are z-up. Of a dataset with the coordinates (x, y, z):
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PmAxes {
    /// (x, y, z): as in the file, right-handed, z is up.
    ZUp = 0,
    /// (x, z, -y): right-handed, y is up (OpenGL, glTF, Godot).
    YUp = 1,
    /// (x, z, y): left-handed, y is up (Unity).
    YUpLeftHanded = 2,
}

impl PmAxes {
    pub(crate) fn of(value: u32) -> Outcome<Self> {
        [Self::ZUp, Self::YUp, Self::YUpLeftHanded]
            .into_iter()
            .find(|axes| *axes as u32 == value)
            .ok_or_else(|| Fault::argument(format!("axes are {value}; there are 0 to 2")))
    }

    /// From the file to the caller.
    #[inline]
    pub(crate) fn outward(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::ZUp => [x, y, z],
            Self::YUp => [x, z, -y],
            Self::YUpLeftHanded => [x, z, y],
        }
    }

    /// From the caller to the file.
    pub(crate) fn inward(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::ZUp => [x, y, z],
            Self::YUp => [x, -z, y],
            Self::YUpLeftHanded => [x, z, y],
        }
    }

    /// A box for the caller.
    pub(crate) fn bounds(self, bounds: &Aabb) -> Aabb {
        let (a, b) = (self.outward(bounds.min), self.outward(bounds.max));
        match self {
            Self::YUp => Aabb { min: [a[0], a[1], b[2]], max: [b[0], b[1], a[2]] },
            _ => Aabb { min: a, max: b },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_and_back_is_where_it_was_and_boxes_keep_their_points() {
        let bounds = Aabb { min: [1.0, 2.0, 3.0], max: [4.0, 6.0, 8.0] };
        for axes in [PmAxes::ZUp, PmAxes::YUp, PmAxes::YUpLeftHanded] {
            let p = [2.0, 5.0, 7.0];
            assert_eq!(axes.inward(axes.outward(p)), p);
            let theirs = axes.bounds(&bounds);
            assert!(!theirs.is_empty() && theirs.contains(axes.outward(p)), "{axes:?}");
            assert_eq!(PmAxes::of(axes as u32).unwrap(), axes);
        }
        assert_eq!(PmAxes::YUp.outward([1.0, 2.0, 3.0]), [1.0, 3.0, -2.0]);
        assert_eq!(PmAxes::YUpLeftHanded.outward([1.0, 2.0, 3.0]), [1.0, 3.0, 2.0]);
        assert!(PmAxes::of(3).is_err());
    }
}
