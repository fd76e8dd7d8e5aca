//! Where a scan stands: rotation and translation, in double precision.

use super::xml::{Cloud, Placement};
use crate::{Aabb, AxisGrid, Resolution, ScanWarning};

/// From the scan's own coordinates to those of the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pose {
    /// Rows of the rotation matrix; `None` leaves coordinates bit for bit.
    rotation: Option<[[f64; 3]; 3]>,
    translation: [f64; 3],
}

impl Pose {
    /// The pose that a file gives, and what is wrong with it: it may be without the rotation.
    pub(super) fn new(placement: Option<Placement>) -> (Self, Option<ScanWarning>) {
        let Placement { rotation: q, translation } = placement.unwrap_or(Placement::IDENTITY);
        let norm = q.iter().fold(0.0f64, |sum, v| sum.hypot(*v));
        if !norm.is_finite() || norm == 0.0 {
            return (Self { rotation: None, translation }, Some(ScanWarning::Rotation { normalised: false }));
        }
        let note = ((norm - 1.0).abs() > 1e-6).then_some(ScanWarning::Rotation { normalised: true });
        // a quaternion within rounding of 1 is one: dividing by its norm would only add noise
        let by = if (norm - 1.0).abs() <= 4.0 * f64::EPSILON { 1.0 } else { norm };
        let [w, x, y, z] = q.map(|v| v / by);
        let is_identity = x == 0.0 && y == 0.0 && z == 0.0;
        let rotation = [
            [w * w + x * x - y * y - z * z, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), w * w + y * y - x * x - z * z, 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), w * w + z * z - x * x - y * y],
        ];
        (Self { rotation: (!is_identity).then_some(rotation), translation }, note)
    }

    /// Rotation and translation as they are applied.
    pub(super) fn parts(&self) -> ([[f64; 3]; 3], [f64; 3]) {
        let identity = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        (self.rotation.unwrap_or(identity), self.translation)
    }

    /// How finely moved coordinates are stored, from how finely those of the scan are: turned ones are on no grid.
    pub(super) fn resolution(&self, own: [Resolution; 3]) -> [Resolution; 3] {
        if self.rotation.is_none() {
            return std::array::from_fn(|a| match own[a] {
                Resolution::Grid(grid) => {
                    Resolution::Grid(AxisGrid { offset: grid.offset + self.translation[a], ..grid })
                }
                other => other,
            });
        }
        let step = |resolution| match resolution {
            Resolution::Grid(grid) => Some(grid.step),
            Resolution::Step(step) => Some(step),
            Resolution::Single | Resolution::Double => None,
        };
        let steps = own.into_iter().map(step).collect::<Option<Vec<_>>>();
        let finest = steps.and_then(|steps| steps.into_iter().reduce(f64::min));
        [finest.map_or(Resolution::Double, Resolution::Step); 3]
    }

    /// Moves points, one slice an axis, of equal length.
    pub(super) fn apply(&self, xyz: [&mut [f64]; 3]) {
        let [x, y, z] = xyz;
        if self.rotation.is_some() {
            self.rotate([&mut *x, &mut *y, &mut *z]);
        }
        for (axis, by) in [x, y, z].into_iter().zip(self.translation) {
            if by != 0.0 {
                axis.iter_mut().for_each(|v| *v += by);
            }
        }
    }

    /// Turns directions.
    pub(super) fn rotate(&self, xyz: [&mut [f64]; 3]) {
        let Some(r) = &self.rotation else { return };
        let [x, y, z] = xyz;
        for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
            let p = [*x, *y, *z];
            [*x, *y, *z] = r.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
        }
    }

    /// The box around a box that is moved.
    fn moved(&self, bounds: &Aabb) -> Aabb {
        let mut out = Aabb::EMPTY;
        for corner in 0..8 {
            let mut p: [[f64; 1]; 3] =
                std::array::from_fn(|a| [if corner >> a & 1 == 0 { bounds.min[a] } else { bounds.max[a] }]);
            let [x, y, z] = &mut p;
            self.apply([x, y, z]);
            out.grow(p.map(|[v]| v));
        }
        out
    }

    /// What the file declares of a scan's bounds, in the file's coordinates: the moved box, the box around the largest
    /// range, or nothing.
    pub(super) fn bounds_declared(&self, cloud: &Cloud) -> Option<Aabb> {
        let bounds = cloud.bounds.and_then(cartesian_box).or_else(|| cloud.range_max.and_then(range_box))?;
        let moved = self.moved(&bounds);
        (!moved.is_empty() && moved.extent().iter().all(|e| e.is_finite())).then_some(moved)
    }
}

fn cartesian_box(ends: [[f64; 2]; 3]) -> Option<Aabb> {
    let bounds = Aabb { min: ends.map(|[min, _]| min), max: ends.map(|[_, max]| max) };
    // writers without a bound write the largest double
    (!bounds.is_empty() && bounds.extent().iter().all(|e| *e < 1e100)).then_some(bounds)
}

fn range_box(range: f64) -> Option<Aabb> {
    (0.0..1e100).contains(&range).then_some(Aabb { min: [-range; 3], max: [range; 3] })
}

/// Turns range, azimuth and elevation into x, y and z, in place (ASTM E2807 §6.4: azimuth from +x towards +y,
/// elevation from the xy plane).
pub(super) fn spherical_to_cartesian(xyz: [&mut [f64]; 3]) {
    let [x, y, z] = xyz;
    for ((x, y), z) in x.iter_mut().zip(y).zip(z) {
        let (range, (sin_az, cos_az), (sin_el, cos_el)) = (*x, y.sin_cos(), z.sin_cos());
        *x = range * cos_el * cos_az;
        *y = range * cos_el * sin_az;
        *z = range * sin_el;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(rotation: [f64; 4], translation: [f64; 3]) -> (Pose, Option<ScanWarning>) {
        Pose::new(Some(Placement { rotation, translation }))
    }

    fn moved(pose: &Pose, p: [f64; 3]) -> [f64; 3] {
        let [mut x, mut y, mut z] = p.map(|v| [v]);
        pose.apply([&mut x, &mut y, &mut z]);
        [x[0], y[0], z[0]]
    }

    #[test]
    fn a_quarter_turn_about_z_takes_x_to_y_whatever_the_length_of_the_quaternion() {
        for length in [1.0, 7.0, 1e-200] {
            let half = std::f64::consts::FRAC_1_SQRT_2 * length;
            let (pose, note) = pose([half, 0.0, 0.0, half], [10.0, 20.0, 30.0]);
            let p = moved(&pose, [1.0, 0.0, 2.0]);
            assert!(p.iter().zip([10.0, 21.0, 32.0]).all(|(a, b)| (a - b).abs() < 1e-12), "{p:?}");
            assert_eq!(note.is_some(), length != 1.0);
        }
    }

    #[test]
    fn no_rotation_leaves_every_bit_and_nonsense_is_told() {
        for w in [1.0, -1.0, 3.0] {
            let (pose, _) = pose([w, 0.0, 0.0, 0.0], [0.0; 3]);
            assert_eq!(moved(&pose, [0.1, -0.2, 1e300]), [0.1, -0.2, 1e300]);
        }
        for q in [[0.0; 4], [f64::NAN, 0.0, 0.0, 1.0], [f64::INFINITY; 4]] {
            let (pose, note) = pose(q, [1.0, 0.0, 0.0]);
            assert_eq!((moved(&pose, [0.5; 3]), note.is_some()), ([1.5, 0.5, 0.5], true));
        }
    }

    #[test]
    fn declared_bounds_are_moved_with_the_scan() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let (pose, _) = pose([half, 0.0, 0.0, half], [100.0, 0.0, 0.0]);
        let cloud = |z_max| Cloud { bounds: Some([[0.0, 1.0], [0.0, 2.0], [0.0, z_max]]), ..Cloud::default() };
        let b = pose.bounds_declared(&cloud(3.0)).unwrap();
        let expected = Aabb { min: [98.0, 0.0, 0.0], max: [100.0, 1.0, 3.0] };
        assert!((0..3).all(|a| (b.min[a] - expected.min[a]).abs() < 1e-9 && (b.max[a] - expected.max[a]).abs() < 1e-9));
        assert_eq!(pose.bounds_declared(&cloud(f64::MAX)), None);
    }

    #[test]
    fn azimuth_turns_from_x_to_y_and_elevation_lifts() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let (mut x, mut y, mut z) = ([2.0, 2.0], [quarter, 0.0], [0.0, quarter]);
        spherical_to_cartesian([&mut x, &mut y, &mut z]);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(x[0], 0.0) && near(y[0], 2.0) && near(z[0], 0.0));
        assert!(near(x[1], 0.0) && near(y[1], 0.0) && near(z[1], 2.0));
    }

    #[test]
    fn turned_and_moved_points_are_doubles() {
        // cosine 0.6, sine 0.8; nothing of a third of it is a whole number of powers of two
        let (pose, _) = pose([2.0, 0.0, 0.0, 1.0], [5e6, -5e6, 1e-3]);
        let p = [1000.001, 0.0, 1e6];
        let found = moved(&pose, p);
        // docs/design/numerics.md, §2.4; the decimals here are doubles too, off by half a last place
        let u = f64::EPSILON / 2.0;
        for (found, meant) in found.into_iter().zip([5_000_600.000_6, -4_999_199.999_2, 1_000_000.001]) {
            let bound = 24.0 * u * p.iter().sum::<f64>() + 2.0 * u * f64::abs(meant);
            assert!((found - meant).abs() <= bound, "{found} {meant} {bound}");
        }
    }

    #[test]
    fn axes_that_change_places_lose_no_bit() {
        let (third, note) = pose([0.5; 4], [0.0; 3]);
        assert_eq!(moved(&third, [5_400_000.062_5, -0.1, 1e-9]), [1e-9, 5_400_000.062_5, -0.1]);
        assert_eq!(note, None);
        for (axis, turned) in [[1.0, -2.0, -3.0], [-1.0, 2.0, -3.0], [-1.0, -2.0, 3.0]].into_iter().enumerate() {
            let mut q = [0.0; 4];
            q[axis + 1] = 1.0;
            assert_eq!(moved(&pose(q, [0.0; 3]).0, [1.0, 2.0, 3.0]), turned, "half a turn about axis {axis}");
        }
    }

    #[test]
    fn a_grid_that_is_moved_stays_one_and_one_that_is_turned_becomes_its_step() {
        let grid = |step, offset| Resolution::Grid(AxisGrid { step, offset });
        let own = [grid(0.5, 2.0), Resolution::Step(0.25), grid(0.125, -1.0)];
        let (shifted, _) = pose([1.0, 0.0, 0.0, 0.0], [10.0, 20.0, 0.5]);
        assert_eq!(shifted.resolution(own), [grid(0.5, 12.0), Resolution::Step(0.25), grid(0.125, -0.5)]);
        assert_eq!(shifted.parts(), ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], [10.0, 20.0, 0.5]));
        let (turned, _) = pose([0.5; 4], [1.0, 2.0, 3.0]);
        assert_eq!(turned.resolution(own), [Resolution::Step(0.125); 3], "the finest of all");
        for fine in [Resolution::Single, Resolution::Double] {
            assert_eq!(turned.resolution([own[0], fine, own[1]]), [Resolution::Double; 3]);
            assert_eq!(shifted.resolution([fine; 3]), [fine; 3]);
        }
        assert_eq!(turned.parts(), ([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [1.0, 2.0, 3.0]));
    }

    #[test]
    fn bounds_without_an_end_are_none() {
        let declared =
            |bounds, range_max| Pose::new(None).0.bounds_declared(&Cloud { bounds, range_max, ..Cloud::default() });
        let sides = |min: f64, max: f64| Some([[min, max]; 3]);
        assert_eq!(declared(sides(-1.0, 2.0), None), Some(Aabb { min: [-1.0; 3], max: [2.0; 3] }));
        assert_eq!(declared(sides(3.0, 3.0), None), Some(Aabb { min: [3.0; 3], max: [3.0; 3] }));
        assert_eq!(declared(None, Some(5.0)), Some(Aabb { min: [-5.0; 3], max: [5.0; 3] }));
        assert_eq!(declared(None, Some(0.0)), Some(Aabb { min: [0.0; 3], max: [0.0; 3] }));
        for none in [sides(2.0, 1.0), sides(0.0, 1e100), sides(f64::NAN, 1.0), None] {
            assert_eq!(declared(none, None), None, "{none:?}");
        }
        assert_eq!([declared(None, Some(-1.0)), declared(None, Some(1e100))], [None; 2]);
    }
}
