//! How far the positions that a reader decodes are from those of the sources, by own arithmetic, and whether the report
//! of the conversion says so (`docs/accuracy.md`).
//!
//! # Tolerances
//! Figures of all points are compared to 10⁻⁶ of them, and to what doubles of the size of the coordinates are rounded
//! to: other software adds in another order. No reported maximum may be lower than the one found, beyond that rounding.

mod compare;
mod deviation;
mod figures;
mod known;
mod reported;

use std::path::Path;

pub(crate) use deviation::{Deviation, Ordered};
pub use figures::{Accuracy, Integers, Merged, PositionErrors};
pub(crate) use known::{Known, Side};

use crate::check::Check;
use crate::finding::Findings;

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
