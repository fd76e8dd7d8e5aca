//! Values of all points, against what header, info record and descriptors of extra bytes say.

use pointmill_format::copc::Info;
use pointmill_format::{Attribute, Column, NodePoints, with_column};
use serde_json::json;

use super::front::{Front, bytes};
use super::records::DESCRIPTOR;
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::expect::Geometry;

/// Values of 8 bits in fields of 16.
const EIGHT_BITS: u16 = 255;

const NOTHING: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// What was seen so far.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) points: u64,
    /// Stored positions.
    position: [[i32; 2]; 3],
    /// Points by number of the return, 0 to 15.
    returns: [u64; 16],
    /// Points whose return is 0, or above the number of returns.
    odd_returns: u64,
    gps_time: [f64; 2],
    /// Nodes whose GPS times do not ascend.
    unsorted: u64,
    /// The greatest value of a colour; `None` without colours.
    colour: Option<u16>,
    /// Of each attribute of one value.
    ranges: Vec<[f64; 2]>,
}

impl Seen {
    pub(super) fn new(attributes: &[Attribute]) -> Self {
        Self {
            points: 0,
            position: [[i32::MAX, i32::MIN]; 3],
            returns: [0; 16],
            odd_returns: 0,
            gps_time: NOTHING,
            unsorted: 0,
            colour: None,
            ranges: vec![NOTHING; attributes.len()],
        }
    }

    /// Takes in the points of a node.
    pub(super) fn add(&mut self, points: &NodePoints) {
        self.points += points.len() as u64;
        for (seen, values) in self.position.iter_mut().zip(points.quantized().unwrap_or_default()) {
            *seen = values.iter().fold(*seen, |[min, max], v| [min.min(*v), max.max(*v)]);
        }
        let returns = points.column::<u8>("return number").unwrap_or_default();
        let of = points.column::<u8>("number of returns").unwrap_or_default();
        for (number, of) in returns.iter().zip(of) {
            self.returns[usize::from(number & 15)] += 1;
            self.odd_returns += u64::from(*number == 0 || number > of);
        }
        let times = points.column::<f64>("gps-time").unwrap_or_default();
        self.gps_time = times.iter().fold(self.gps_time, |[min, max], t| [min.min(*t), max.max(*t)]);
        self.unsorted += u64::from(!times.is_sorted());
        for colour in ["rgb", "nir"].into_iter().filter_map(|name| points.column::<u16>(name)) {
            self.colour = self.colour.max(colour.iter().copied().max());
        }
        for (seen, column) in self.ranges.iter_mut().zip(points.columns()) {
            let [min, max] = range(column);
            *seen = [seen[0].min(min), seen[1].max(max)];
        }
    }

    /// Takes in what another thread has seen.
    pub(super) fn merge(&mut self, other: &Self) {
        self.points += other.points;
        self.odd_returns += other.odd_returns;
        self.unsorted += other.unsorted;
        self.colour = self.colour.max(other.colour);
        self.returns.iter_mut().zip(other.returns).for_each(|(a, b)| *a += b);
        for (a, b) in self.position.iter_mut().zip(other.position) {
            *a = [a[0].min(b[0]), a[1].max(b[1])];
        }
        let ranges = self.ranges.iter_mut().zip(&other.ranges);
        for (a, b) in ranges.chain([(&mut self.gps_time, &other.gps_time)]) {
            *a = [a[0].min(b[0]), a[1].max(b[1])];
        }
    }
}

#[allow(clippy::unnecessary_cast)] // one body for every type of column
fn range(column: &Column) -> [f64; 2] {
    with_column!(column, values => {
        // what is not a number loses every comparison
        values.iter().fold(NOTHING, |[min, max], v| [min.min(*v as f64), max.max(*v as f64)])
    })
}

/// What a file says of all its points, against what was seen of them.
pub(super) struct Judged<'a> {
    pub(super) front: &'a Front,
    pub(super) info: &'a Info,
    pub(super) geometry: &'a Geometry,
    pub(super) attributes: &'a [Attribute],
    /// Every node could be read: what is said must be attained.
    pub(super) is_complete: bool,
    pub(super) findings: &'a Findings,
}

impl Judged<'_> {
    /// Reports what is not so.
    pub(super) fn hold(&self, seen: &Seen) {
        if seen.points == 0 {
            return;
        }
        self.tight_box(seen);
        self.returns(seen);
        self.gps_times(seen);
        self.colours(seen);
        self.extra_bytes(seen);
    }

    /// A finding that is an error of files of our own, and a warning of others, whose writers are free.
    fn push_ours(&self, finding: Finding) {
        self.findings.push(if self.front.is_ours() { finding } else { finding.warning() });
    }

    /// The bounds of the header: exact but for the rounding of the last digits, never by a step.
    fn tight_box(&self, seen: &Seen) {
        self.findings.checked(Check::TightBox, seen.points);
        let bounds = self.front.bounds();
        for (side, subject) in [(0, "least coordinates"), (1, "greatest coordinates")] {
            let lattice = &self.geometry.lattice;
            let world = [0, 1, 2].map(|a| {
                let stored = i64::from(seen.position[a][side]);
                stored as f64 * lattice.scale[a] + lattice.offset[a]
            });
            let stated = bounds.map(|range| range[side]);
            let sign = if side == 0 { -1.0 } else { 1.0 };
            let beyond = [0, 1, 2].map(|a| (world[a] - stated[a]) * sign);
            let steps = [0, 1, 2].map(|a| {
                let rounding = super::boxes::tolerance(a, self.geometry, lattice).min(lattice.scale[a] / 2.0);
                let off = if self.is_complete { beyond[a].abs() } else { beyond[a] };
                if off > rounding { off / lattice.scale[a] } else { 0.0 }
            });
            let most = steps.into_iter().fold(0.0, f64::max);
            if most > 0.0 {
                let finding = Finding::new(Check::TightBox, subject, json!(world), json!(stated));
                // others state the bounds of coordinates that they have rounded since
                if most <= 1.0 { self.push_ours(finding) } else { self.findings.push(finding) }
            }
        }
    }

    fn returns(&self, seen: &Seen) {
        self.findings.checked(Check::Returns, seen.points);
        let stated: Vec<u64> = (0..15).map(|i| self.front.u64(255 + 8 * i)).collect();
        if self.is_complete && stated != seen.returns[1..] {
            let expected = json!(seen.returns[1..]);
            self.findings.push(Finding::new(Check::Returns, "points by return", expected, json!(stated)));
        }
        if seen.odd_returns > 0 {
            let expected = "1 to the number of returns";
            let finding = Finding::new(Check::Returns, "number of the return", expected, "0 or above it");
            self.findings.push(finding.points(seen.odd_returns).warning());
        }
    }

    fn gps_times(&self, seen: &Seen) {
        self.findings.checked(Check::GpsTime, seen.points);
        let (stated, found) = (self.info.gps_time, seen.gps_time);
        let is_within = stated[0] <= found[0] && found[1] <= stated[1];
        let finding = Finding::new(Check::GpsTime, "least and greatest GPS time", json!(found), json!(stated));
        if !is_within && found[0] <= found[1] {
            self.findings.push(finding);
        } else if self.is_complete && stated != found && found[0] <= found[1] {
            self.push_ours(finding);
        }
        if seen.unsorted > 0 && !self.front.is_ours() {
            let subject = "nodes whose GPS times do not ascend";
            self.findings.push(Finding::new(Check::GpsTime, subject, 0, seen.unsorted).warning());
        }
    }

    /// Colours that use the lower 8 of their 16 bits are dark in all programs that go by the specification.
    fn colours(&self, seen: &Seen) {
        let Some(most) = seen.colour else {
            self.findings.skip(Check::ColourDepth, "there are none");
            return;
        };
        self.findings.checked(Check::ColourDepth, seen.points);
        if most <= EIGHT_BITS && self.is_complete {
            let finding = Finding::new(Check::ColourDepth, "greatest value of colours", "16 bits", most);
            self.findings.push(finding.warning());
        }
    }

    /// Ranges that the descriptors of extra bytes state.
    fn extra_bytes(&self, seen: &Seen) {
        let records = self.front.all("LASF_Spec", 4).take(1);
        let descriptors = records.flat_map(|record| record.data.as_chunks::<DESCRIPTOR>().0);
        let mut any = false;
        for descriptor in descriptors {
            let name = descriptor[4..36].split(|b| *b == 0).next().unwrap_or_default();
            let named = |a: &Attribute| a.name.as_bytes() == name && a.elements == 1;
            let Some(column) = self.attributes.iter().position(named) else { continue };
            let [least, greatest] = seen.ranges[column];
            let sides = [("min", 1, 64, least, -1.0), ("max", 2, 88, greatest, 1.0)];
            let is_stated = |bit: i32| descriptor[3] >> bit & 1 == 1;
            for (word, _, at, found, sign) in sides.into_iter().filter(|(_, bit, ..)| is_stated(*bit)) {
                let Some(stated) = value(descriptor, at) else { continue };
                any = true;
                self.findings.checked(Check::AttributeRanges, 1);
                if (found - stated) * sign > 0.0 || self.is_complete && found != stated {
                    let subject = format!("{word} of {}", self.attributes[column].name);
                    // others copy what was so of the points of a source
                    self.push_ours(Finding::new(Check::AttributeRanges, subject, json!(found), json!(stated)));
                }
            }
        }
        if !any {
            self.findings.skip(Check::AttributeRanges, "none are stated");
        }
    }
}

/// A value of a descriptor: of 8 bytes, whatever the type.
fn value(descriptor: &[u8; DESCRIPTOR], at: usize) -> Option<f64> {
    let bytes: [u8; 8] = bytes(descriptor, at);
    match descriptor[2] {
        1 | 3 | 5 | 7 => Some(u64::from_le_bytes(bytes) as f64),
        2 | 4 | 6 | 8 => Some(i64::from_le_bytes(bytes) as f64),
        9 | 10 => Some(f64::from_le_bytes(bytes)),
        _ => None,
    }
}
