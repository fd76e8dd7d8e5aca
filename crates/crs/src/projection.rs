//! A change of projection as a map of points.

use pointmill_format::PointMap;
use proj_core::Transform;

/// Maps points of one system to another; x is the east on both sides.
#[derive(Debug)]
pub(crate) struct Projection {
    pub(crate) transform: Transform,
    /// The definition of the source puts north before east.
    pub(crate) from_north_first: bool,
    /// The definition of the target puts north before east.
    pub(crate) to_north_first: bool,
}

impl Projection {
    fn image(&self, [x, y, z]: [f64; 3]) -> Option<[f64; 3]> {
        let point = if self.from_north_first { (y, x, z) } else { (x, y, z) };
        let (x, y, z) = self.transform.convert_3d(point).ok()?;
        let image = if self.to_north_first { [y, x, z] } else { [x, y, z] };
        image.iter().all(|v| v.is_finite()).then_some(image)
    }
}

impl PointMap for Projection {
    fn map(&self, [x, y, z]: [&mut [f64]; 3]) {
        for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
            [*x, *y, *z] = self.image([*x, *y, *z]).unwrap_or([f64::NAN; 3]);
        }
    }
}
