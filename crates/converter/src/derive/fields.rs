//! What is computed, put into records.

use super::surface::{Surface, any_side, towards, up};
use crate::cloud::{DerivedFields, Range};
use crate::plan::Orient;
use crate::sources::Schema;

/// Bytes of a component.
const BYTES: usize = 4;

/// Where records have what is computed, and to which side normals point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fields {
    /// Byte offsets.
    normal: Option<([usize; 3], usize)>,
    radius: Option<usize>,
    side: Side,
}

/// To which side normals point.
#[derive(Debug, Clone, Copy)]
pub(super) enum Side {
    /// To where the record says that the scanner stood, else up.
    Scanner,
    Up,
    Any,
    /// To this place, steps of the lattice as records have them, of these lengths.
    Place {
        at: [f64; 3],
        steps: [f64; 3],
    },
}

impl Side {
    /// `at`: a place in world coordinates as records would have it.
    pub(super) fn of(orient: Orient, at: impl FnOnce([f64; 3]) -> [f64; 3], steps: [f64; 3]) -> Self {
        match orient {
            Orient::Scanner => Self::Scanner,
            Orient::Up => Self::Up,
            Orient::None => Self::Any,
            Orient::Towards(place) => Self::Place { at: at(place), steps },
        }
    }
}

/// What was written.
#[derive(Debug, Clone)]
pub(super) struct Written {
    pub(super) kept_normals: u64,
    pub(super) without_normal: u64,
    pub(super) kept_radii: u64,
    pub(super) without_radius: u64,
    /// Normal, curvature, radius.
    pub(super) ranges: [Range; 5],
}

impl Default for Written {
    fn default() -> Self {
        let ranges = std::array::from_fn(|_| Range::new(1));
        Self { kept_normals: 0, without_normal: 0, kept_radii: 0, without_radius: 0, ranges }
    }
}

impl Written {
    pub(super) fn merge(&mut self, other: &Self) {
        self.kept_normals += other.kept_normals;
        self.without_normal += other.without_normal;
        self.kept_radii += other.kept_radii;
        self.without_radius += other.without_radius;
        self.ranges.iter_mut().zip(&other.ranges).for_each(|(a, b)| a.merge(b));
    }

    fn see(&mut self, which: usize, value: f32) {
        if value.is_finite() {
            self.ranges[which].add(value.into());
        } else {
            self.ranges[which].has_non_finite = true;
        }
    }
}

impl Fields {
    pub(super) fn new(schema: &Schema, derived: &DerivedFields, side: Side) -> Self {
        let at = |i: usize| schema.offsets[i];
        let normal = derived.normal.map(|(normal, curvature)| (normal.map(at), at(curvature)));
        Self { normal, radius: derived.radius.map(at), side }
    }

    /// Puts the surface through its place into a record, but for what the scan has said of it.
    pub(super) fn put(&self, record: &mut [u8], place: [i32; 3], surface: &Surface, written: &mut Written) {
        if let Some((normal, curvature)) = self.normal {
            let own = normal.map(|at| read(record, at));
            let is_direction = read(record, curvature).to_bits() == DerivedFields::IS_DIRECTION.to_bits();
            let length: f64 = own.iter().map(|v| f64::from(*v) * f64::from(*v)).sum();
            let put = if !is_direction && length.is_finite() && length > 0.0 {
                written.kept_normals += 1;
                own
            } else if surface.normal == [0.0; 3] {
                written.without_normal += 1;
                [0.0; 3]
            } else {
                self.oriented(surface.normal, place, is_direction.then_some(own))
            };
            normal.iter().zip(put).for_each(|(at, v)| write(record, *at, v));
            write(record, curvature, surface.curvature);
            put.into_iter().chain([surface.curvature]).enumerate().for_each(|(i, v)| written.see(i, v));
        }
        if let Some(radius) = self.radius {
            let own = read(record, radius);
            let put = if own.is_finite() && own > 0.0 {
                written.kept_radii += 1;
                own
            } else {
                written.without_radius += u64::from(surface.radius == 0.0);
                surface.radius
            };
            write(record, radius, put);
            written.see(4, put);
        }
    }

    fn oriented(&self, normal: [f32; 3], place: [i32; 3], scanner: Option<[f32; 3]>) -> [f32; 3] {
        match (self.side, scanner) {
            (Side::Scanner, Some(direction)) => towards(normal, direction),
            (Side::Scanner, None) | (Side::Up, _) => up(normal),
            (Side::Any, _) => any_side(normal),
            (Side::Place { at, steps }, _) => {
                let along: [f64; 3] = [0, 1, 2].map(|a| (at[a] - f64::from(place[a])) * steps[a]);
                // of a size that single precision holds
                let longest = along.iter().fold(0.0f64, |most, v| most.max(v.abs()));
                let by = if longest > 0.0 { 1.0 / longest } else { 0.0 };
                towards(normal, along.map(|v| (v * by) as f32))
            }
        }
    }
}

fn read(record: &[u8], at: usize) -> f32 {
    record.get(at..).and_then(<[u8]>::first_chunk::<BYTES>).map_or(0.0, |bytes| f32::from_le_bytes(*bytes))
}

fn write(record: &mut [u8], at: usize, value: f32) {
    record[at..at + BYTES].copy_from_slice(&value.to_le_bytes());
}

#[cfg(test)]
mod tests {
    use pointmill_format::{Attribute, AttributeType};

    use super::*;

    fn fields(side: Side) -> (Fields, usize) {
        let names = ["NormalX", "NormalY", "NormalZ", "curvature", "radius"];
        let schema = Schema::new(names.map(|name| Attribute::new(name, AttributeType::Float32, 1)).to_vec());
        let derived = DerivedFields { normal: Some(([0, 1, 2], 3)), radius: Some(4) };
        (Fields::new(&schema, &derived, side), schema.stride)
    }

    fn put(side: Side, own: [f32; 5], surface: Surface) -> ([f32; 5], Written) {
        let (fields, stride) = fields(side);
        let mut record = vec![0; stride];
        for (i, v) in own.into_iter().enumerate() {
            write(&mut record, 12 + 4 * i, v);
        }
        let mut written = Written::default();
        fields.put(&mut record, [10, 20, 30], &surface, &mut written);
        (std::array::from_fn(|i| read(&record, 12 + 4 * i)), written)
    }

    const IS_DIRECTION: f32 = DerivedFields::IS_DIRECTION;

    const SURFACE: Surface = Surface { normal: [0.6, 0.0, -0.8], curvature: 0.1, radius: 2.0 };

    #[test]
    fn what_scans_say_is_kept_and_the_rest_is_computed() {
        let (seen, written) = put(Side::Up, [0.0; 5], SURFACE);
        assert_eq!(seen, [-0.6, 0.0, 0.8, 0.1, 2.0]);
        assert_eq!((written.kept_normals, written.without_normal, written.without_radius), (0, 0, 0));
        assert_eq!((written.ranges[0].min[0], written.ranges[4].max[0]), (f64::from(-0.6f32), 2.0));
        let (seen, written) = put(Side::Up, [0.0, 0.0, -3.0, 0.0, 0.5], SURFACE);
        assert_eq!(seen, [0.0, 0.0, -3.0, 0.1, 0.5]);
        assert_eq!((written.kept_normals, written.kept_radii), (1, 1));
        for own in [1e-30, 1e30] {
            assert_eq!(put(Side::Up, [own, 0.0, 0.0, 0.0, 0.0], SURFACE).0[..3], [own, 0.0, 0.0]);
        }
        let (seen, written) = put(Side::Up, [f32::NAN, 0.0, 0.0, 0.0, f32::NAN], Surface::default());
        assert_eq!(seen, [0.0; 5]);
        assert_eq!((written.without_normal, written.without_radius), (1, 1));
    }

    #[test]
    fn normals_point_to_the_scanner_where_it_is_known() {
        let (seen, _) = put(Side::Scanner, [5.0, 0.0, 0.0, IS_DIRECTION, 0.0], SURFACE);
        assert_eq!(seen[..4], [0.6, 0.0, -0.8, 0.1]);
        let (seen, _) = put(Side::Scanner, [-5.0, 0.0, 0.0, IS_DIRECTION, 0.0], SURFACE);
        assert_eq!(seen[..3], [-0.6, 0.0, 0.8]);
        let (seen, _) = put(Side::Scanner, [0.0; 5], SURFACE);
        assert_eq!(seen[..3], [-0.6, 0.0, 0.8], "up");
        // a direction is never left where there is no normal
        let (seen, _) = put(Side::Up, [5.0, 0.0, 0.0, IS_DIRECTION, 0.0], Surface::default());
        assert_eq!(seen, [0.0; 5]);
    }

    #[test]
    fn normals_point_to_a_place_however_far_it_is() {
        for (x, expected) in [(1e30, 0.6), (-1e30, -0.6), (11.0, 0.6), (9.0, -0.6)] {
            let side = Side::Place { at: [x, 20.0, 30.0], steps: [1e8; 3] };
            assert_eq!(put(side, [0.0; 5], SURFACE).0[0], expected, "{x}");
        }
    }
}
