//! The account of a run: what went in, what came out, what it cost.

mod accuracy;
mod assess;
mod build;
mod choices;
mod precision;
mod types;

pub use accuracy::{Accuracy, How, Integers, Merged, Metres, PositionErrors};
pub(crate) use assess::{FormatErrors, accuracy};
pub(crate) use build::{Account, filter_settings, grid_report, input_reports, report, settings};
pub use choices::{ChoiceReason, PlannedChoice};
pub use precision::{PrecisionReport, SavedBytes};
pub(crate) use precision::{check_lattice, precision};
pub use types::{
    AttributeReport, ChangedAttribute, ChangedValues, DerivedReport, DropReason, DroppedAttribute, Estimate,
    GridReport, InputReport, MissingValues, OtherFilesReport, OutputReport, PhaseReport, PointsReport, Report,
    SharedPlaceReport, TakenOver, TreeReport,
};
