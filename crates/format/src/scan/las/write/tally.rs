//! What a header says of all points, counted from their records.

use super::layout::RecordLayout;
use crate::scan::las::bytes::{f64_at, i32_at};
use crate::{Aabb, Lattice};

/// What is known when all points are written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// All points.
    pub points: u64,
    /// Points by the number of their return, 1 to 15; those of return 0 are in none.
    pub points_by_return: [u64; 15],
    /// The box of the points, world units.
    pub bounds: Aabb,
    /// Least and greatest GPS time.
    pub gps_time: [f64; 2],
}

/// Counts records as they are encoded; the order of records and of [`Self::merge`] does not matter.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[derive(Debug, Clone, PartialEq)]
pub struct Tally {
    points: u64,
    by_return: [u64; 16],
    min: [i32; 3],
    max: [i32; 3],
    gps_time: [f64; 2],
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            points: 0,
            by_return: [0; 16],
            min: [i32::MAX; 3],
            max: [i32::MIN; 3],
            gps_time: [f64::INFINITY, f64::NEG_INFINITY],
        }
    }
}

impl Tally {
    /// Counts records of that layout.
    pub fn add(&mut self, layout: &RecordLayout, records: &[u8]) {
        let len = layout.record_len();
        let mask = if layout.point_format() < 6 { 0b111 } else { 0b1111 };
        for record in records.chunks_exact(len) {
            self.by_return[usize::from(record[14] & mask)] += 1;
            for axis in 0..3 {
                let q = i32_at(record, 4 * axis);
                (self.min[axis], self.max[axis]) = (self.min[axis].min(q), self.max[axis].max(q));
            }
        }
        self.points += (records.len() / len) as u64;
        let time_at = match layout.point_format() {
            1 | 3 => 20,
            6.. => 22,
            _ => return,
        };
        let [mut least, mut greatest] = self.gps_time;
        for record in records.chunks_exact(len) {
            let time = f64_at(record, time_at);
            if time.is_finite() {
                (least, greatest) = (least.min(time), greatest.max(time));
            }
        }
        self.gps_time = [least, greatest];
    }

    /// Counts points of which nothing else is to be known.
    pub fn count(&mut self, points: u64) {
        self.points += points;
    }

    /// Counts what another one has counted, too.
    pub fn merge(&mut self, other: &Self) {
        self.points += other.points;
        self.by_return.iter_mut().zip(other.by_return).for_each(|(to, n)| *to += n);
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
        let ([a, b], [c, d]) = (self.gps_time, other.gps_time);
        self.gps_time = [a.min(c), b.max(d)];
    }

    /// Records counted.
    pub fn points(&self) -> u64 {
        self.points
    }

    /// What a header says of points on that lattice; zeros where there are none.
    pub fn summary(&self, lattice: &Lattice) -> Summary {
        let world = |corner: [i32; 3]| lattice.world(corner.map(i64::from));
        let is_empty = self.points == 0;
        let bounds = if is_empty {
            Aabb { min: [0.0; 3], max: [0.0; 3] }
        } else {
            Aabb { min: world(self.min), max: world(self.max) }
        };
        let [least, greatest] = self.gps_time;
        let gps_time = if least <= greatest { [least, greatest] } else { [0.0; 2] };
        let points_by_return = std::array::from_fn(|i| self.by_return[i + 1]);
        Summary { points: self.points, points_by_return, bounds, gps_time }
    }
}

impl Summary {
    /// True if the GPS times cannot be seconds of a week: they are adjusted standard time.
    pub fn is_adjusted_time(&self) -> bool {
        const WEEK: f64 = 604_800.0;
        self.gps_time[0] < 0.0 || self.gps_time[1] > WEEK
    }
}
