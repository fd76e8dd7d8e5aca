//! How far the positions that a reader decodes are from those of the sources, by own arithmetic, and whether the report
//! of the conversion says so (`docs/accuracy.md`).
//!
//! # Tolerances
//! Figures of all points are compared to 10⁻⁶ of them, and to what doubles of the size of the coordinates are rounded
//! to: other software adds in another order. No reported maximum may be lower than the one found, beyond that rounding.

mod compare;
mod deviation;
mod figures;
mod reported;

use std::path::Path;

pub(crate) use deviation::{Deviation, Ordered};
pub use figures::{Accuracy, Integers, Merged, PositionErrors};

use crate::check::Check;
use crate::finding::Findings;

/// What a validation knows of the accuracy of a dataset.
#[derive(Debug, Default)]
pub(crate) struct Known<'a> {
    /// Points of the dataset.
    pub(crate) points: u64,
    /// The coordinate reference system, as the dataset states it.
    pub(crate) projection: &'a str,
    /// Least and greatest world coordinate of each axis.
    pub(crate) bounds: Option<[[f64; 2]; 3]>,
    /// The lattice against the sources, if they are at hand.
    pub(crate) lattice: Option<Side>,
    /// What a reader decodes against the lattice.
    pub(crate) format: Option<Side>,
}

/// What the lattice or the format did.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Side {
    pub(crate) deviation: Deviation,
    /// Points whose integers do not come back.
    pub(crate) lost: u64,
    /// Points that fell together with points that were apart; `None`: not counted.
    pub(crate) merged: Option<u64>,
}

impl Default for Side {
    fn default() -> Self {
        Self { deviation: Deviation::default(), lost: 0, merged: Some(0) }
    }
}

impl Side {
    pub(crate) fn merge(&mut self, other: &Self) {
        self.deviation.merge(&other.deviation);
        self.lost += other.lost;
        self.merged = self.merged.zip(other.merged).map(|(a, b)| a + b);
    }
}

/// The accuracy of the dataset at `path`; what its report says else is a finding.
pub(crate) fn judge(path: &Path, known: &Known<'_>, findings: &Findings) -> Accuracy {
    let found = Accuracy::of(known);
    let kind = findings.format();
    match reported::find(path, kind) {
        Some(report) => {
            compare::check(&report, &found, known, findings);
            let missing = match (&known.lattice, &known.format) {
                (Some(_), Some(_)) => None,
                (None, Some(_)) => Some("without the sources, what the lattice did is not known"),
                (Some(_), None) => Some("what the format did is not known"),
                (None, None) => Some("neither what the lattice nor what the format did is known"),
            };
            missing.into_iter().for_each(|why| findings.note(Check::Accuracy, why));
        }
        None => findings.skip(Check::Accuracy, "there is no report of the conversion beside the dataset"),
    }
    found
}
