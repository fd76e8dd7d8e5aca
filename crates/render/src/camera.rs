//! Where a picture is taken from.

use pointmill_format::{Aabb, Lattice};

use crate::CameraError;
use crate::vector::{cross, dot, length, minus, plus, unit};

/// Field of view of the cameras that are made here, degrees from top to bottom.
const FIELD_OF_VIEW: f64 = 60.0;

/// The corners of a box are that many times as deep as where they would touch the border of the picture.
const MARGIN: f64 = 1.04;

/// Steps towards the camera that has points in the middle of its picture; each leaves a small part of what was missing.
const STEPS: usize = 4;

/// Directions whose angle has a smaller sine than this are parallel.
const PARALLEL: f64 = 1e-9;

/// Width and height of a picture, in pixels: each 1 to 16,384, and at most 2^26 together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    width: u32,
    height: u32,
}

impl Size {
    /// The largest side, in pixels.
    pub const LARGEST_SIDE: u32 = 16_384;

    /// The most pixels: the buffers of a picture then stay below 3 GB.
    pub const MOST_PIXELS: u64 = 1 << 26;

    /// A size.
    ///
    /// # Errors
    /// A side of 0 or above [`Self::LARGEST_SIDE`]; more than [`Self::MOST_PIXELS`].
    pub fn new(width: u32, height: u32) -> Result<Self, CameraError> {
        let sides = 1..=Self::LARGEST_SIDE;
        if !sides.contains(&width) || !sides.contains(&height) {
            return Err(CameraError::Side(width, height));
        }
        if u64::from(width) * u64::from(height) > Self::MOST_PIXELS {
            return Err(CameraError::Pixels(width, height));
        }
        Ok(Self { width, height })
    }

    /// Pixels from left to right.
    pub const fn width(self) -> u32 {
        self.width
    }

    /// Pixels from top to bottom.
    pub const fn height(self) -> u32 {
        self.height
    }

    /// Width over height.
    pub fn aspect(self) -> f64 {
        f64::from(self.width) / f64::from(self.height)
    }

    /// Number of pixels.
    pub const fn pixels(self) -> usize {
        self.width as usize * self.height as usize
    }
}

impl Default for Size {
    /// 1920 × 1080.
    fn default() -> Self {
        Self { width: 1920, height: 1080 }
    }
}

/// A side from which a scene is looked at. z is up, y is north, x is east.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum View {
    /// From above; north is up.
    Top,
    /// From below; north is up, east is on the left.
    Bottom,
    /// From the north: east is on the left.
    North,
    /// From the south: east is on the right.
    South,
    /// From the east: north is on the right.
    East,
    /// From the west: north is on the left.
    West,
    /// From the south-east and above, as far as one side is as good as another ([`crate::Scene::best_view`]).
    Fit,
}

impl View {
    /// Every view.
    pub const ALL: [Self; 7] = [Self::Top, Self::Bottom, Self::North, Self::South, Self::East, Self::West, Self::Fit];

    /// The one with that name, if there is one.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|view| view.name() == name)
    }

    /// The word: "top".
    pub const fn name(self) -> &'static str {
        match self {
            Self::Top => "top",
            Self::Bottom => "bottom",
            Self::North => "north",
            Self::South => "south",
            Self::East => "east",
            Self::West => "west",
            Self::Fit => "fit",
        }
    }

    /// The direction of view, of any length.
    const fn direction(self) -> [f64; 3] {
        match self {
            Self::Top => [0.0, 0.0, -1.0],
            Self::Bottom => [0.0, 0.0, 1.0],
            Self::North => [0.0, -1.0, 0.0],
            Self::South => [0.0, 1.0, 0.0],
            Self::East => [-1.0, 0.0, 0.0],
            Self::West => [1.0, 0.0, 0.0],
            Self::Fit => [-0.5, 1.0, -0.7],
        }
    }
}

impl std::fmt::Display for View {
    /// [`Self::name`].
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// A perspective camera, in world coordinates.
///
/// ```
/// use pointmill_format::Aabb;
/// use pointmill_render::{Camera, Size, View};
///
/// let bounds = Aabb { min: [0.0; 3], max: [10.0, 20.0, 5.0] };
/// let camera = Camera::fit(&bounds, View::North, Size::new(160, 120)?);
/// assert!(camera.eye[1] > 20.0 && camera.target == bounds.center());
/// # Ok::<(), pointmill_render::CameraError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Camera {
    /// Where it stands.
    pub eye: [f64; 3],
    /// What is in the middle of the picture.
    pub target: [f64; 3],
    /// What is up in the picture, of any length. Where it is parallel to the direction of view, north is up, or else z.
    pub up: [f64; 3],
    /// Angle between the upper and the lower border of the picture, degrees.
    pub vertical_fov: f64,
}

impl Camera {
    /// A camera with z up and 60 degrees from top to bottom.
    #[must_use]
    pub const fn new(eye: [f64; 3], target: [f64; 3]) -> Self {
        Self { eye, target, up: [0.0, 0.0, 1.0], vertical_fov: FIELD_OF_VIEW }
    }

    /// The camera from which all of `bounds` (world units, not empty) just fits into a picture of that size.
    #[must_use]
    pub fn fit(bounds: &Aabb, view: View, size: Size) -> Self {
        Self::fit_along(bounds, view.direction(), size)
    }

    /// As [`Self::fit`], looking along `direction`, of any length; along y if that is no direction.
    #[must_use]
    pub fn fit_along(bounds: &Aabb, direction: [f64; 3], size: Size) -> Self {
        let corner = |i: usize| std::array::from_fn(|a| if i >> a & 1 == 0 { bounds.min[a] } else { bounds.max[a] });
        Self::around(&(0..8).map(corner).collect::<Vec<_>>(), bounds.center(), bounds, direction, size)
    }

    /// As [`Self::fit_along`], but what just fits is these points of `bounds`, and they are in the middle of the picture.
    pub(crate) fn fit_points(points: &[[f64; 3]], bounds: &Aabb, direction: [f64; 3], size: Size) -> Self {
        let mut camera = Self::around(points, bounds.center(), bounds, direction, size);
        for _ in 0..STEPS {
            let Ok([right, up, forward]) = camera.axes() else { break };
            // where they are in the picture, as tangents, and how far the middle of that is from its own
            let (mut low, mut high, mut depths) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], 0.0);
            for point in points {
                let at = minus(*point, camera.eye);
                let depth = dot(at, forward);
                depths += depth;
                for (axis, along) in [right, up].into_iter().enumerate() {
                    let tangent = dot(at, along) / depth;
                    (low[axis], high[axis]) = (low[axis].min(tangent), high[axis].max(tangent));
                }
            }
            let depth = depths / points.len() as f64;
            let [aside, above] = [0, 1].map(|axis| (low[axis] + high[axis]) / 2.0 * depth);
            let target = plus(plus(camera.target, right, aside), up, above);
            if target.iter().any(|c| !c.is_finite()) {
                break;
            }
            camera = Self::around(points, target, bounds, direction, size);
        }
        camera
    }

    /// The camera that looks at `middle` along `direction`, and has all points in its picture.
    fn around(points: &[[f64; 3]], middle: [f64; 3], bounds: &Aabb, direction: [f64; 3], size: Size) -> Self {
        let target = if middle.iter().all(|c| c.is_finite()) { middle } else { [0.0; 3] };
        let forward = unit(direction).unwrap_or([0.0, 1.0, 0.0]);
        let [right, up] = across(forward, [0.0, 0.0, 1.0]);
        let slope = (FIELD_OF_VIEW / 2.0).to_radians().tan();
        let needed = points.iter().map(|point| {
            let at = minus(*point, target);
            let side = (dot(at, right).abs() / (slope * size.aspect())).max(dot(at, up).abs() / slope);
            side * MARGIN - dot(at, forward)
        });
        // one point, or points in one place, are looked at from one unit away
        let extent = length(bounds.extent());
        let least = if extent.is_finite() && extent > 0.0 { extent / 100.0 } else { 1.0 };
        let distance = needed.fold(least, f64::max);
        let distance = if distance.is_finite() { distance } else { least };
        // however far from the origin of the world, the eye is not where it looks
        let nearest = target.iter().fold(0.0f64, |m, c| m.max(c.abs())) * 1e-12;
        Self::new(plus(target, forward, -distance.max(nearest)), target)
    }

    /// Checks the camera and gives right, up and forward, each of length 1.
    ///
    /// # Errors
    /// Numbers that are not finite, or too large; no direction; a field of view of 0 or less, of 180 degrees or more.
    pub fn axes(&self) -> Result<[[f64; 3]; 3], CameraError> {
        let numbers = self.eye.iter().chain(&self.target).chain(&self.up).chain([&self.vertical_fov]);
        if !numbers.clone().all(|v| v.is_finite()) {
            return Err(CameraError::NotFinite);
        }
        if numbers.take(6).any(|v| v.abs() > Lattice::FARTHEST) {
            return Err(CameraError::TooFar);
        }
        if !(self.vertical_fov > 0.0 && self.vertical_fov < 180.0) {
            return Err(CameraError::FieldOfView(self.vertical_fov));
        }
        let forward = unit(minus(self.target, self.eye)).ok_or(CameraError::NoDirection(self.eye))?;
        let [right, up] = across(forward, self.up);
        Ok([right, up, forward])
    }
}

/// Right and up of a picture.
fn across(forward: [f64; 3], up: [f64; 3]) -> [[f64; 3]; 2] {
    let candidates = [up, [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let right = candidates.into_iter().filter_map(unit).map(|up| cross(forward, up)).find(|r| length(*r) > PARALLEL);
    let right = right.and_then(unit).unwrap_or([1.0, 0.0, 0.0]);
    [right, cross(right, forward)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::projection::Projection;

    const SIZE: Size = Size { width: 200, height: 100 };

    fn bounds() -> Aabb {
        Aabb { min: [0.0; 3], max: [10.0, 20.0, 5.0] }
    }

    /// Where a place is in the picture: pixels from the left and from the top.
    fn at(view: View, place: [f64; 3]) -> [f64; 2] {
        let projection = Projection::new(&Camera::fit(&bounds(), view, SIZE), SIZE).unwrap();
        let [x, y, _] = projection.pixel(place).unwrap();
        [x, y]
    }

    #[test]
    fn pictures_are_not_mirrored() {
        let [middle, east, north, up] = [[5.0, 10.0, 2.5], [9.0, 10.0, 2.5], [5.0, 19.0, 2.5], [5.0, 10.0, 4.5]];
        for (view, right, upwards) in [(View::Top, east, north), (View::South, east, up), (View::East, north, up)] {
            assert!(at(view, right)[0] > at(view, middle)[0] + 5.0, "{view}");
            assert!(at(view, upwards)[1] < at(view, middle)[1] - 5.0, "{view}");
        }
        for (view, left, upwards) in [(View::Bottom, east, north), (View::North, east, up), (View::West, north, up)] {
            assert!(at(view, left)[0] < at(view, middle)[0] - 5.0, "{view}");
            assert!(at(view, upwards)[1] < at(view, middle)[1] - 5.0, "{view}");
        }
    }

    #[test]
    fn the_box_fits_and_fills_the_picture() {
        for view in View::ALL {
            let mut reach = [0.0f64; 2];
            for i in 0..8 {
                let corner = std::array::from_fn(|a| if i >> a & 1 == 0 { bounds().min[a] } else { bounds().max[a] });
                let [x, y] = at(view, corner);
                assert!((0.0..200.0).contains(&x) && (0.0..100.0).contains(&y), "{view}: {x} {y}");
                reach = [reach[0].max((x - 100.0).abs() / 100.0), reach[1].max((y - 50.0).abs() / 50.0)];
            }
            assert!((reach[0].max(reach[1]) - 1.0 / MARGIN).abs() < 1e-9, "{view}: {reach:?}");
        }
    }

    #[test]
    fn points_at_one_end_of_their_box_are_in_the_middle_of_the_picture() {
        let points = [[8.0, 1.0, 4.0], [10.0, 1.0, 4.0], [9.0, 3.0, 5.0]];
        let camera = Camera::fit_points(&points, &bounds(), [-0.3, 1.0, -0.5], SIZE);
        let projection = Projection::new(&camera, SIZE).unwrap();
        let at = points.map(|point| projection.pixel(point).unwrap());
        for (axis, side) in [200.0, 100.0].into_iter().enumerate() {
            let low = at.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
            let high = at.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
            assert!(low > 0.0 && high < side, "{at:?}");
            // steps towards it, not the solution
            assert!(((low + high) / 2.0 - side / 2.0).abs() < side / 50.0, "{at:?}");
        }
    }

    #[test]
    fn one_place_is_looked_at_from_outside() {
        for place in [[0.0; 3], [5e5, 4e6, 100.0], [1e12, -1e12, 1e12], [1e29, 0.0, 0.0]] {
            let camera = Camera::fit(&Aabb { min: place, max: place }, View::Fit, SIZE);
            let projection = Projection::new(&camera, SIZE).unwrap();
            assert!(projection.pixel(place).is_some(), "{camera:?}");
        }
    }

    #[test]
    fn cameras_that_see_nothing_are_refused() {
        let camera = Camera::new([0.0; 3], [0.0, 1.0, 0.0]);
        let axes = |change: &dyn Fn(&mut Camera)| {
            let mut camera = camera;
            change(&mut camera);
            camera.axes().unwrap_err()
        };
        assert_eq!(axes(&|c| c.target = c.eye), CameraError::NoDirection([0.0; 3]));
        assert_eq!(axes(&|c| c.up[1] = f64::NAN), CameraError::NotFinite);
        assert_eq!(axes(&|c| c.eye[0] = f64::INFINITY), CameraError::NotFinite);
        assert_eq!(axes(&|c| c.eye[0] = 1e300), CameraError::TooFar);
        assert_eq!(axes(&|c| c.vertical_fov = 0.0), CameraError::FieldOfView(0.0));
        assert_eq!(axes(&|c| c.vertical_fov = 180.0), CameraError::FieldOfView(180.0));
    }

    #[test]
    fn an_up_without_meaning_is_replaced() {
        for up in [[0.0; 3], [0.0, 0.0, 1.0], [0.0, 0.0, -7.0]] {
            let camera = Camera { up, ..Camera::new([0.0; 3], [0.0, 0.0, -1.0]) };
            let [right, up, _] = camera.axes().unwrap();
            assert_eq!((right, up), ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]));
        }
        let north = Camera { up: [0.0, 1.0, 0.0], ..Camera::new([0.0; 3], [0.0, 1.0, 0.0]) };
        assert_eq!(north.axes().unwrap()[1], [0.0, 0.0, 1.0]);
    }

    #[test]
    fn sizes_end_where_memory_does() {
        assert_eq!(Size::new(0, 5), Err(CameraError::Side(0, 5)));
        assert_eq!(Size::new(5, 1_000_000), Err(CameraError::Side(5, 1_000_000)));
        assert_eq!(Size::new(16_384, 16_384), Err(CameraError::Pixels(16_384, 16_384)));
        assert_eq!(Size::new(16_384, 4096).unwrap().pixels(), 1 << 26);
    }
}
