//! What the pass over the points learns: bounds, ranges, counts and the checksum.

use pointmill_format::{Aabb, Attribute, Changes};
use serde::{Deserialize, Serialize};

use super::checksum::Checksum;
use super::colour_range::ColourRange;
use super::frames::JobBounds;
use super::range::Range;
use super::relations::Relations;
use crate::sources::Schema;
use crate::warning::SkippedPoints;

/// Facts about all points of the cloud. Sums and extremes only, so that any order of merging gives the same.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Stats {
    /// Of the points that go in, on the job lattice.
    pub(crate) bounds: JobBounds,
    /// Range of each attribute of the schema.
    pub(crate) ranges: Vec<Range>,
    /// Points by class, if classes have 8 bits.
    pub(crate) classes: Vec<u64>,
    /// Classes that single precision does not hold as whole numbers.
    pub(crate) odd_classes: Changes,
    /// 64-bit integers that doubles do not hold: by attribute of the schema, empty where there are none.
    pub(crate) doubled: Vec<Changes>,
    /// Attributes that follow from others; `None`: nobody asked.
    pub(crate) relations: Option<Relations>,
    /// By source; empty while a pass goes on, since there may be very many ([`SourceStats`] are kept apart).
    pub(crate) sources: Vec<SourceStats>,
    /// Of the records as they are stored.
    pub(crate) checksum: Checksum,
    pub(crate) change: Change,
    pub(crate) points: u64,
    pub(crate) outside_bounds: u64,
    /// Dropped as outliers.
    pub(crate) outliers: u64,
    pub(crate) other_class: u64,
    pub(crate) thinned: u64,
    pub(crate) invalid: u64,
    /// Skipped because they lie exactly at the origin of their scan.
    pub(crate) origin_skipped: u64,
    pub(crate) unreadable: u64,
    /// Points whose integers in their scan do not come back from the job lattice.
    pub(crate) integers_lost: u64,
    /// Points that share their point of the job lattice with another position of the sources; `None`: not counted.
    pub(crate) fallen_together: Option<u64>,
    /// Some point moved to the job lattice by more than doubles of its coordinates are rounded.
    pub(crate) moves: bool,
    /// Of parts of scans that cannot be decoded.
    pub(crate) skipped: Vec<SkippedPoints>,
}

/// Coordinate change by moving to the job lattice (job minus source), world units, over the points that go in.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize)]
pub(crate) struct Change {
    /// Largest magnitude.
    pub(crate) max: [f64; 3],
    /// Signed: the bias, once divided by the number of points.
    pub(crate) sum: [f64; 3],
    pub(crate) sum_of_squares: [f64; 3],
    /// Largest square of the distance that a point moved.
    pub(crate) max_squared_3d: f64,
}

impl Change {
    /// Adds `points` points, with the change of each axis: the same for all, or a column of it.
    pub(crate) fn add(&mut self, points: usize, axes: [Result<f64, &[f64]>; 3]) {
        for (a, axis) in axes.iter().enumerate() {
            match axis {
                Ok(by) => {
                    self.max[a] = self.max[a].max(by.abs());
                    self.sum[a] += by * points as f64;
                    self.sum_of_squares[a] += by * by * points as f64;
                }
                Err(column) => {
                    let (mut max, mut sum, mut squares) = (0.0f64, 0.0, 0.0);
                    for v in *column {
                        max = max.max(v.abs());
                        sum += v;
                        squares += v * v;
                    }
                    self.max[a] = self.max[a].max(max);
                    self.sum[a] += sum;
                    self.sum_of_squares[a] += squares;
                }
            }
        }
        if axes.iter().all(Result::is_ok) {
            let squared = axes.iter().map(|a| a.unwrap_or_default().powi(2)).sum();
            self.max_squared_3d = self.max_squared_3d.max(squared);
            return;
        }
        let at = |axis: &Result<f64, &[f64]>, i: usize| match axis {
            Ok(by) => *by,
            Err(column) => column[i],
        };
        for i in 0..points {
            let squared = axes.iter().map(|axis| at(axis, i).powi(2)).sum();
            self.max_squared_3d = self.max_squared_3d.max(squared);
        }
    }

    pub(crate) fn merge(&mut self, other: &Self) {
        for a in 0..3 {
            self.max[a] = self.max[a].max(other.max[a]);
            self.sum[a] += other.sum[a];
            self.sum_of_squares[a] += other.sum_of_squares[a];
        }
        self.max_squared_3d = self.max_squared_3d.max(other.max_squared_3d);
    }
}

/// Facts about one input.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct SourceStats {
    /// Decoded, before any filter.
    pub(crate) read: u64,
    /// That go in.
    pub(crate) kept: u64,
    /// Exactly at the origin of their scan, before any filter.
    pub(crate) at_origin: u64,
    /// World coordinates, before any filter.
    pub(crate) bounds: Aabb,
    /// Axes on which a point contradicts the grid that the file, or a sample, claims.
    pub(crate) off_grid: [bool; 3],
    /// Of the points that go in.
    pub(crate) rgb: ColourRange,
    /// Of batches that the filter cut, points that it omitted included.
    pub(crate) rgb_unfiltered: ColourRange,
    /// Values that could not stay as they were, of all points that were read: by attribute of the schema, empty where
    /// there are none.
    pub(crate) changes: Vec<Changes>,
}

impl Default for SourceStats {
    fn default() -> Self {
        Self {
            read: 0,
            kept: 0,
            at_origin: 0,
            bounds: Aabb::EMPTY,
            off_grid: [false; 3],
            rgb: ColourRange::default(),
            rgb_unfiltered: ColourRange::default(),
            changes: Vec::new(),
        }
    }
}

impl SourceStats {
    /// Adds what another thread has seen of the same input.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.read += other.read;
        self.kept += other.kept;
        self.at_origin += other.at_origin;
        self.bounds = self.bounds.union(&other.bounds);
        self.off_grid = std::array::from_fn(|axis| self.off_grid[axis] || other.off_grid[axis]);
        self.rgb.merge(&other.rgb);
        self.rgb_unfiltered.merge(&other.rgb_unfiltered);
        other.changes.iter().enumerate().for_each(|(attribute, changes)| self.count_changes(attribute, changes));
    }

    /// True if it can be of points with these attributes.
    pub(crate) fn can_be_of(&self, schema: &Schema) -> bool {
        let counts = [self.read, self.kept, self.at_origin];
        counts.into_iter().all(is_count)
            && self.kept.max(self.at_origin) <= self.read
            && can_be_changes(&self.changes, schema)
    }

    /// Adds to what changed of an attribute of the schema.
    pub(crate) fn count_changes(&mut self, attribute: usize, changes: &Changes) {
        count(&mut self.changes, attribute, changes);
    }
}

/// No unit has more points: sums of such counts fit.
const MOST_POINTS: u64 = 1 << 48;

fn is_count(count: u64) -> bool {
    count <= MOST_POINTS
}

fn can_be_changes(changes: &[Changes], schema: &Schema) -> bool {
    changes.len() <= schema.attributes.len() && changes.iter().all(are_counts)
}

fn are_counts(changes: &Changes) -> bool {
    let Changes { clamped, rounded, not_finite, out_of_range, missing, .. } = *changes;
    [clamped, rounded, not_finite, out_of_range, missing].into_iter().all(is_count)
}

fn count(all: &mut Vec<Changes>, attribute: usize, changes: &Changes) {
    if changes.is_empty() {
        return;
    }
    if all.len() <= attribute {
        all.resize(attribute + 1, Changes::default());
    }
    all[attribute].merge(changes);
}

impl Stats {
    /// Nothing of any source yet.
    pub(crate) fn new(schema: &Schema) -> Self {
        Self {
            bounds: JobBounds::EMPTY,
            ranges: schema.attributes.iter().map(|a| Range::new(a.elements)).collect(),
            classes: vec![0; 256],
            odd_classes: Changes::default(),
            doubled: Vec::new(),
            relations: None,
            sources: Vec::new(),
            checksum: Checksum::default(),
            change: Change::default(),
            points: 0,
            outside_bounds: 0,
            outliers: 0,
            other_class: 0,
            thinned: 0,
            invalid: 0,
            origin_skipped: 0,
            unreadable: 0,
            integers_lost: 0,
            moves: false,
            fallen_together: None,
            skipped: Vec::new(),
        }
    }

    /// True if it can be of points with these attributes, in a unit.
    pub(crate) fn can_be_of(&self, schema: &Schema) -> bool {
        let counts = [
            self.points,
            self.outside_bounds,
            self.outliers,
            self.other_class,
            self.thinned,
            self.invalid,
            self.origin_skipped,
            self.unreadable,
            self.integers_lost,
        ];
        let skipped = self.skipped.iter().map(|skipped| skipped.points);
        let is_range = |(range, a): (&Range, &Attribute)| range.can_be_of(a.elements);
        let is_place = |a: usize| self.bounds.min[a] <= self.bounds.max[a];
        let is_nowhere = self.points == 0 && self.bounds == JobBounds::EMPTY;
        counts.into_iter().chain(skipped).all(is_count)
            && (is_nowhere || (0..3).all(is_place))
            && self.classes.len() == 256
            && self.classes.iter().all(|points| *points <= self.points)
            && self.ranges.len() == schema.attributes.len()
            && self.ranges.iter().zip(&schema.attributes).all(is_range)
            && are_counts(&self.odd_classes)
            && can_be_changes(&self.doubled, schema)
            && self.relations.as_ref().is_none_or(|relations| relations.can_be_of(schema))
            && self.sources.is_empty()
            && self.checksum.count() == self.points
    }

    /// Adds to the values of an attribute of the schema that doubles do not hold.
    pub(crate) fn count_doubled(&mut self, attribute: usize, changes: &Changes) {
        count(&mut self.doubled, attribute, changes);
    }

    /// Adds what another thread has seen, sources aside.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.bounds.union(&other.bounds);
        self.ranges.iter_mut().zip(&other.ranges).for_each(|(a, b)| a.merge(b));
        self.classes.iter_mut().zip(&other.classes).for_each(|(a, b)| *a += b);
        self.odd_classes.merge(&other.odd_classes);
        other.doubled.iter().enumerate().for_each(|(attribute, changes)| self.count_doubled(attribute, changes));
        match (&mut self.relations, &other.relations) {
            (Some(ours), Some(theirs)) => ours.merge(theirs),
            (ours @ None, theirs) => ours.clone_from(theirs),
            (Some(_), None) => {}
        }
        self.checksum.merge(&other.checksum);
        self.change.merge(&other.change);
        self.points += other.points;
        self.outside_bounds += other.outside_bounds;
        self.outliers += other.outliers;
        self.other_class += other.other_class;
        self.thinned += other.thinned;
        self.invalid += other.invalid;
        self.origin_skipped += other.origin_skipped;
        self.unreadable += other.unreadable;
        self.integers_lost += other.integers_lost;
        self.moves |= other.moves;
        self.skipped.extend_from_slice(&other.skipped);
        self.skipped.sort();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_add_up_by_axis_and_in_space() {
        let mut change = Change::default();
        change.add(2, [Ok(0.5), Err(&[3.0, -1.0]), Err(&[4.0, 0.0])]);
        let mut other = Change::default();
        other.add(1, [Ok(-1.0), Ok(0.0), Ok(0.0)]);
        change.merge(&other);
        assert_eq!(change.max, [1.0, 3.0, 4.0]);
        assert_eq!(change.sum, [0.0, 2.0, 4.0]);
        assert_eq!(change.sum_of_squares, [1.5, 10.0, 16.0]);
        assert_eq!(change.max_squared_3d, 25.25);
    }
}
