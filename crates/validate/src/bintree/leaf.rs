//! Checks the points of one leaf against the page.

use std::ops::Range;

use pointmill_format::bintree::{CORE_BYTES, Header, RecordLayout};
use pointmill_format::{Aabb, AttributeType, Lattice};

use super::precision;
use super::summary::Summary;
use super::tree::{AXES, compare_boxes};
use crate::accuracy::Deviation;
use crate::check::Check;
use crate::finding::{Faults, Finding, Findings};
use crate::place::Place;

/// The points of a leaf, taken apart; reused from leaf to leaf.
#[derive(Debug, Default)]
pub(super) struct Points {
    /// Records as stored.
    pub(super) bytes: Vec<u8>,
    /// x, y, z relative to the center.
    offsets: [Vec<f32>; 3],
    /// World coordinates.
    decoded: [Vec<f64>; 3],
    /// The lattice integers next to them.
    pub(super) steps: [Vec<i64>; 3],
}

/// How exact the positions of a leaf are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Exactness {
    /// No offset is so large that it could stand for two lattice points, nor infinite or NaN.
    pub(super) certain: bool,
    /// The largest distance on an axis from a lattice point, world units.
    pub(super) error: f64,
    /// The largest that is allowed.
    pub(super) bound: f64,
    /// Of all points from those of the lattice, if they are certain.
    pub(super) deviation: Deviation,
}

/// What a leaf is checked against.
pub(super) struct Leaf<'a> {
    pub(super) place: Place,
    pub(super) bounds: &'a Aabb,
    pub(super) center: [f64; 3],
    pub(super) header: &'a Header,
    pub(super) findings: &'a Findings,
}

impl Points {
    /// Takes `bytes` apart.
    pub(super) fn decode(&mut self, stride: usize, center: [f64; 3], lattice: &Lattice) {
        for axis in 0..3 {
            let (offsets, decoded) = (&mut self.offsets[axis], &mut self.decoded[axis]);
            let words = self.bytes.chunks_exact(stride).filter_map(|r| r[4 * axis..].first_chunk::<4>());
            offsets.clear();
            offsets.extend(words.map(|w| f32::from_le_bytes(*w)));
            decoded.clear();
            decoded.extend(offsets.iter().map(|d| center[axis] + f64::from(*d)));
            self.steps[axis].clear();
            self.steps[axis].extend(decoded.iter().map(|v| lattice.quantize(axis, *v)));
        }
    }

    pub(super) fn len(&self) -> usize {
        self.steps[0].len()
    }

    fn is_finite(&self) -> bool {
        self.offsets.iter().flatten().all(|d| d.is_finite())
    }

    /// Of a point from the center.
    pub(super) fn offset(&self, i: usize) -> [f32; 3] {
        self.offsets.each_ref().map(|d| d[i])
    }

    fn step(&self, i: usize) -> [i64; 3] {
        self.steps.each_ref().map(|s| s[i])
    }

    /// What points of one place are ordered by.
    fn tail(&self, i: usize, stride: usize) -> &[u8] {
        self.bytes.get(i * stride + 12..(i + 1) * stride).unwrap_or_default()
    }

    /// The tails of the first and last record.
    pub(super) fn ends(&self, stride: usize) -> [Box<[u8]>; 2] {
        [0, self.len().saturating_sub(1)].map(|i| self.tail(i, stride).into())
    }
}

impl Leaf<'_> {
    /// The box is exactly that of the decoded points.
    pub(super) fn check_box(&self, points: &Points) {
        if !points.is_finite() {
            return; // has its finding with the positions
        }
        self.findings.checked(Check::LeafBoxes, 1);
        let all = |start: f64, pick: fn(f64, f64) -> f64| {
            points.decoded.each_ref().map(|values| values.iter().copied().fold(start, pick))
        };
        let tight = Aabb { min: all(f64::INFINITY, f64::min), max: all(f64::NEG_INFINITY, f64::max) };
        compare_boxes(Check::LeafBoxes, self.place, &tight, self.bounds, self.findings);
    }

    /// Classes are whole and finite, `rgba` is opaque and the colour of `rgb`.
    pub(super) fn check_values(&self, points: &Points) {
        let RecordColumns { rgb, rgba, .. } = RecordColumns::of(&self.header.record);
        let mut classes = Faults::default();
        let (mut alphas, mut colours) = (Faults::default(), Faults::default());
        for record in points.bytes.chunks_exact(self.header.record.stride()) {
            let class = record[12..].first_chunk().map_or(f32::NAN, |w| f32::from_le_bytes(*w));
            if class.fract() != 0.0 || class.abs() > 16_777_216.0 {
                classes.add("a whole number", class.to_string());
            }
            let Some([r, g, b, a]) = rgba.and_then(|at| record[at..].first_chunk::<4>()) else { continue };
            if *a != 255 {
                alphas.add(255, *a);
            }
            if let Some(wide) = rgb.and_then(|at| record[at..].first_chunk::<6>()) {
                let (words, _) = wide.as_chunks::<2>();
                let expected: Vec<u8> = words.iter().map(|w| to_byte(u16::from_le_bytes(*w))).collect();
                if expected != [*r, *g, *b] {
                    colours.add(expected, vec![*r, *g, *b]);
                }
            }
        }
        self.findings.checked(Check::Values, points.len() as u64);
        classes.report(Check::Values, "classification", self.place, self.findings);
        alphas.report(Check::Values, "alpha of rgba", self.place, self.findings);
        colours.report(Check::Values, "rgba beside rgb", self.place, self.findings);
    }

    /// Bytes that belong to no column are zero.
    pub(super) fn check_padding(&self, points: &Points) {
        let gaps = RecordColumns::of(&self.header.record).gaps;
        self.findings.checked(Check::Padding, points.len() as u64);
        let mut faults = Faults::default();
        for record in points.bytes.chunks_exact(self.header.record.stride()) {
            if let Some(at) = gaps.iter().cloned().flatten().find(|at| record[*at] != 0) {
                faults.add(0, format!("{} at byte {at} of the record", record[at]));
            }
        }
        faults.report(Check::Padding, "padding", self.place, self.findings);
    }

    /// Every decoded position is next to a lattice point, and its offset the best one there is. `None` if the lattice is
    /// unknown to the index or an offset makes no number.
    pub(super) fn check_positions(&self, points: &Points) -> Exactness {
        let lattice = &self.header.lattice;
        let deviation = Deviation::default();
        let mut exactness = Exactness { certain: true, error: 0.0, bound: 0.0, deviation };
        self.findings.checked(Check::Positions, points.len() as u64);
        for (axis, name) in AXES.into_iter().enumerate() {
            let (scale, center) = (lattice.scale[axis], self.center[axis]);
            let half_extent = points.offsets[axis].iter().fold(0.0, |h: f64, d| h.max(f64::from(d.abs())));
            let magnitude = points.decoded[axis].iter().fold(lattice.offset[axis].abs(), |m, v| m.max(v.abs()));
            let bound = precision::bound(half_extent, magnitude);
            let mut not_finite = Faults::default();
            for d in points.offsets[axis].iter().filter(|d| !d.is_finite()) {
                not_finite.add("a finite number", d.to_string());
            }
            if !not_finite.is_empty() || bound >= scale / 2.0 {
                exactness.certain = false;
                not_finite.report(Check::Positions, format!("offset of {name}"), self.place, self.findings);
                continue;
            }
            let (mut far, mut inexact) = (Faults::default(), Faults::default());
            let values = points.decoded[axis].iter().zip(&points.steps[axis]).zip(&points.offsets[axis]);
            for ((decoded, step), offset) in values {
                let exact = *step as f64 * scale + lattice.offset[axis];
                let error = (decoded - exact).abs();
                exactness.error = exactness.error.max(error);
                if error > bound {
                    far.add(format!("within {bound:e} of {exact}"), *decoded);
                } else if (exact - center) as f32 != *offset {
                    inexact.add((exact - center) as f32, *offset);
                }
            }
            exactness.bound = exactness.bound.max(bound);
            far.report(Check::Positions, name, self.place, self.findings);
            inexact.report(Check::Positions, format!("offset of {name}"), self.place, self.findings);
        }
        if exactness.certain {
            for i in 0..points.len() {
                let meant = lattice.world(points.step(i));
                exactness.deviation.add([0, 1, 2].map(|a| points.decoded[a][i] - meant[a]), meant);
            }
        }
        exactness
    }

    /// The center is the middle of the box of the lattice points.
    pub(super) fn check_center(&self, summary: &Summary) {
        let Lattice { scale, offset } = self.header.lattice;
        let world = |steps: [i64; 3]| [0, 1, 2].map(|a| steps[a] as f64 * scale[a] + offset[a]);
        let (min, max) = (world(summary.min), world(summary.max));
        for (axis, name) in AXES.into_iter().enumerate() {
            let middle = (min[axis] + max[axis]) / 2.0;
            if middle != self.center[axis] {
                let finding = Finding::new(Check::Positions, format!("center.{name}"), middle, self.center[axis]);
                self.findings.push(finding.at(self.place));
            }
        }
    }

    /// Points stand in Morton order from the corner of the leaf, those of one place in the order of their bytes.
    pub(super) fn check_order(&self, points: &Points, corner: [i64; 3]) {
        let stride = self.header.record.stride();
        self.findings.checked(Check::LeafOrder, points.len() as u64);
        let from_corner = |i| {
            let step = points.step(i);
            [0, 1, 2].map(|a| step[a].wrapping_sub(corner[a]) as u64)
        };
        let (mut places, mut ties) = (Faults::default(), Faults::default());
        for i in 1..points.len() {
            match morton_order(from_corner(i - 1), from_corner(i)) {
                std::cmp::Ordering::Less => {}
                std::cmp::Ordering::Equal if points.tail(i - 1, stride) <= points.tail(i, stride) => {}
                std::cmp::Ordering::Equal => {
                    ties.add("ascending", format!("record {i} stands behind a greater one of its place"));
                }
                std::cmp::Ordering::Greater => {
                    places.add("ascending", format!("record {i} stands behind one of a greater code"));
                }
            }
        }
        places.report(Check::LeafOrder, "Morton order", self.place, self.findings);
        ties.report(Check::LeafOrder, "bytes of points of one place", self.place, self.findings);
    }
}

/// Where columns that are looked at stand in a record, and what belongs to no column.
struct RecordColumns {
    rgb: Option<usize>,
    rgba: Option<usize>,
    gaps: Vec<Range<usize>>,
}

impl RecordColumns {
    fn of(record: &RecordLayout) -> Self {
        let find = |name: &str, ty: AttributeType, elements: usize| {
            let mut extras = record.extras().iter();
            let is_it = |a: &pointmill_format::Attribute| a.name == name && a.ty == ty && a.elements == elements;
            extras.find(|e| is_it(&e.attribute)).map(|e| e.offset)
        };
        let (mut gaps, mut end) = (Vec::new(), CORE_BYTES);
        for extra in record.extras() {
            gaps.push(end..extra.offset);
            end = extra.offset + extra.attribute.size();
        }
        gaps.push(end..record.stride());
        gaps.retain(|gap| !gap.is_empty());
        Self { rgb: find("rgb", AttributeType::UInt16, 3), rgba: find("rgba", AttributeType::UInt8, 4), gaps }
    }
}

/// A channel of 16 bits as 8.
fn to_byte(v: u16) -> u8 {
    ((u32::from(v) * 255 + 32_767) / 65_535) as u8
}

/// Compares Morton codes, x above y above z in each triple of bits, without building them: the axis whose coordinates
/// differ in the highest bit decides, of equal ones the first.
fn morton_order(a: [u64; 3], b: [u64; 3]) -> std::cmp::Ordering {
    let highest = |axis: usize| u64::BITS - (a[axis] ^ b[axis]).leading_zeros();
    let axis = (1..3).fold(0, |best, axis| if highest(axis) > highest(best) { axis } else { best });
    a[axis].cmp(&b[axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn morton_order_is_that_of_interleaved_codes() {
        let code = |p: [u64; 3]| {
            (0..5).fold(0, |code, bit| code | (p[0] >> bit & 1) << (3 * bit + 2) | (p[1] >> bit & 1) << (3 * bit + 1))
                | (0..5).fold(0, |code, bit| code | (p[2] >> bit & 1) << (3 * bit))
        };
        let points: Vec<[u64; 3]> = (0..200).map(|i| [i * 7 % 32, i * 11 % 32, i * 13 % 29]).collect();
        for a in &points {
            for b in &points {
                assert_eq!(morton_order(*a, *b), code(*a).cmp(&code(*b)), "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn channels_become_bytes_by_the_rule_of_the_page() {
        assert_eq!([0, 128, 129, 257, 65_406, 65_407, 65_535].map(to_byte), [0, 0, 1, 1, 254, 255, 255]);
    }
}
