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

pub(crate) use deviation::{Deviation, Ordered};
pub use figures::{Accuracy, Integers, Merged, PositionErrors};
pub(crate) use known::{Known, Side};

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::report;
use reported::Reported;

/// The accuracy of a dataset; what its report says else is a finding.
pub(crate) fn judge(report: Option<&report::Reported>, known: &Known<'_>, findings: &Findings) -> Accuracy {
    let found = Accuracy::of(known);
    let Some(report) = report else {
        findings.skip(Check::Accuracy, "there is no report of the conversion beside the dataset");
        return found;
    };
    let Some(stated) = &report.accuracy else {
        findings.checked(Check::Accuracy, 1);
        findings.push(Finding::new(Check::Accuracy, "accuracy in the report", "figures", "none"));
        return found;
    };
    compare::check(&Reported::new(stated), &found, known, findings);
    let missing = match (&known.lattice, &known.format) {
        (Some(_), Some(_)) => None,
        (None, Some(_)) => Some("without the sources, what the lattice did is not known"),
        (Some(_), None) => Some("what the format did is not known"),
        (None, None) => Some("neither what the lattice nor what the format did is known"),
    };
    missing.into_iter().for_each(|why| findings.note(Check::Accuracy, why));
    found
}
