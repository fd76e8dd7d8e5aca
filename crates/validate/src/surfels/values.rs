//! What every normal, curvature and radius must be by itself, and how many of them may be 0.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use serde_json::{Value, json};

use super::columns::{Column, Columns};
use super::derived::{CURVATURE, Derived, NORMALS, Orient, RADIUS};
use super::expected::length;
use crate::against::Rules;
use crate::against::block::Block;
use crate::check::Check;
use crate::finding::{Faults, Finding, Findings};
use crate::place::Place;

/// By how much the length of a normal may differ from 1: of floats, of 16 bits.
const LENGTH: [f64; 2] = [1e-3, 0.02];

/// By how much a normal may point to the wrong side, for its rounding: of floats, of 16 bits, which turn it by up to 1.6°.
const SIDE: [f64; 2] = [1e-6, 0.03];

/// The largest variation of a surface is 1/3, and single precision rounds it.
const MOST_CURVATURE: f64 = 1.0 / 3.0 + 1e-6;

/// Checks records as they come.
pub(super) struct Values<'a> {
    pub(super) derived: &'a Derived,
    pub(super) columns: Columns,
    pub(super) rules: &'a Rules,
    /// Normals have 16 bits.
    pub(super) is_octahedral: bool,
    /// Integers of positions are known.
    pub(super) has_positions: bool,
    pub(super) findings: &'a Findings,
    pub(super) zero_normals: AtomicU64,
    pub(super) zero_radii: AtomicU64,
}

/// What is wrong with the normals of a block.
#[derive(Default)]
struct NormalFaults {
    not_finite: Faults,
    length: Faults,
    side: Faults,
}

impl Values<'_> {
    /// Checks the records of a block.
    pub(super) fn look(&self, block: &Block, place: Place) {
        if self.columns.known_normal().is_some() {
            self.normals(block, place);
        }
        let mut faults = Faults::default();
        if self.columns.known_curvature().is_some() {
            self.findings.checked(Check::Curvature, block.len() as u64);
            for curvature in (0..block.len()).map(|i| self.columns.surfel(block, i).curvature) {
                if !(0.0..=MOST_CURVATURE).contains(&curvature) {
                    faults.add("0 to 1/3", shown(curvature));
                }
            }
            std::mem::take(&mut faults).report(Check::Curvature, CURVATURE, place, self.findings);
        }
        if self.columns.known_radius().is_some() {
            self.findings.checked(Check::Radii, block.len() as u64);
            for radius in (0..block.len()).map(|i| self.columns.surfel(block, i).radius) {
                self.zero_radii.fetch_add(u64::from(radius == 0.0), Relaxed);
                if !(radius.is_finite() && radius >= 0.0) {
                    faults.add("a finite number, 0 or more", shown(radius));
                }
            }
            faults.report(Check::Radii, RADIUS, place, self.findings);
        }
    }

    fn normals(&self, block: &Block, place: Place) {
        let storage = usize::from(self.is_octahedral);
        let are_kept = self.derived.kept_normals > 0;
        let mut faults = NormalFaults::default();
        let mut zero = 0;
        for i in 0..block.len() {
            let normal = self.columns.surfel(block, i).normal;
            let length = length(normal);
            if normal == [0.0; 3] {
                zero += 1;
            } else if !length.is_finite() {
                faults.not_finite.add("finite numbers", normal.map(shown).to_vec());
            } else if (length - 1.0).abs() > LENGTH[storage] {
                faults.length.add(1, length);
            } else if !are_kept && !self.is_on_its_side(normal, block, i) {
                faults.side.add(self.derived.orient.words(), json!(normal));
            }
        }
        self.findings.checked(Check::Normals, block.len() as u64);
        self.zero_normals.fetch_add(zero, Relaxed);
        let NormalFaults { not_finite, length, side } = faults;
        for (subject, faults) in
            [("normal", not_finite), ("length of the normal", length), ("side of the normal", side)]
        {
            if let Some(finding) = faults.finding(Check::Normals, subject, place) {
                // which normals are those of the scans, whose lengths are what they are, is not known
                self.findings.push(if are_kept { finding.warning() } else { finding });
            }
        }
    }

    /// True if the normal of a record is on the side that was asked for, or that cannot be told.
    fn is_on_its_side(&self, normal: [f64; 3], block: &Block, i: usize) -> bool {
        let slack = SIDE[usize::from(self.is_octahedral)];
        let [x, y, z] = normal;
        let is_up = z > 0.0 || z == 0.0 && (y > 0.0 || y == 0.0 && x > 0.0);
        match self.derived.orient {
            Orient::Scanner => true,
            Orient::Up => is_up || self.is_octahedral && z >= -slack,
            Orient::None => {
                let largest = normal.iter().fold(0.0, |most: f64, c| most.max(c.abs()));
                normal.iter().any(|c| *c > 0.0 && *c >= largest - slack)
            }
            Orient::Place(place) if self.has_positions => {
                let world = self.rules.world(block.position(i));
                let to = [0, 1, 2].map(|a| place[a] - world[a]);
                let dot: f64 = (0..3).map(|a| to[a] * normal[a]).sum();
                dot >= -slack * length(to)
            }
            Orient::Place(_) => true,
        }
    }

    /// What only all points together show. `is_complete`: all could be read.
    pub(super) fn conclude(&self, is_complete: bool) {
        let (derived, columns) = (self.derived, self.columns);
        let normal = columns.normal.map(|columns| NORMALS.into_iter().zip(columns).collect());
        let count = (self.zero_normals.load(Relaxed), derived.without_normal);
        let zeros = (!self.is_octahedral).then_some(count);
        self.conclude_check(Check::Normals, normal, zeros.filter(|_| is_complete), "without_normal");
        self.conclude_check(Check::Curvature, columns.curvature.map(|c| vec![(CURVATURE, c)]), None, "");
        let zeros = Some((self.zero_radii.load(Relaxed), derived.without_radius));
        let radius = columns.radius.map(|c| vec![(RADIUS, c)]);
        self.conclude_check(Check::Radii, radius, zeros.filter(|_| is_complete), "without_radius");
        if derived.normals && derived.kept_normals > 0 && columns.known_normal().is_some() {
            self.findings.note(Check::Normals, "those of scans were kept as they were: sides are not judged");
        }
    }

    /// `columns`: those that the check is about, `None` if none was computed. `zeros`: how many values are 0, and how many the report
    /// states, under `key`.
    fn conclude_check(
        &self,
        check: Check,
        columns: Option<Vec<(&str, Column)>>,
        zeros: Option<(u64, Option<u64>)>,
        key: &'static str,
    ) {
        let Some(columns) = columns else { return self.findings.skip(check, "none were computed") };
        let named = |wanted: Column| {
            let names = columns.iter().filter(|(_, column)| *column == wanted).map(|(name, _)| *name);
            Some(names.collect::<Vec<_>>()).filter(|names| !names.is_empty())
        };
        if let Some(left_out) = named(Column::LeftOut) {
            self.findings.skip(check, format!("{} left out", left_out.join(", ")));
        }
        for name in named(Column::Missing).into_iter().flatten() {
            self.findings.checked(check, 1);
            let expected = "an attribute of the dataset, or one that the report says was left out";
            self.findings.push(Finding::new(check, name.to_owned(), expected, "none"));
        }
        let are_known = columns.iter().all(|(_, c)| matches!(c, Column::Stored(..) | Column::Constant(_)));
        let Some((found, stated)) = zeros.filter(|_| are_known) else { return };
        self.findings.checked(check, 1);
        // the report counts all points that were there before equal ones were dropped
        let is_right =
            stated.is_some_and(|stated| found <= stated && stated - found <= self.derived.duplicates_dropped);
        if !is_right {
            self.findings.push(Finding::new(check, format!("{key} in the report"), found, json!(stated)));
        }
    }
}

impl Orient {
    fn words(self) -> &'static str {
        match self {
            Self::Scanner => "towards the scanner",
            Self::Up => "upwards",
            Self::None => "the component of the largest magnitude above 0",
            Self::Place(_) => "towards the place that was given",
        }
    }
}

/// A number for people; JSON has no NaN.
fn shown(value: f64) -> Value {
    if value.is_finite() { json!(value) } else { value.to_string().into() }
}
