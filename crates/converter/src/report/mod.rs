//! The account of a run: what went in, what came out, what it cost.

mod build;
mod types;

pub(crate) use build::{Account, filter_settings, grid_report, input_reports, report, settings};
pub use types::{
    AttributeReport, ChangedAttribute, ChangedValues, CoordinateChange, DropReason, DroppedAttribute, Estimate,
    GridReport, InputReport, MissingValues, OutputReport, PhaseReport, PointsReport, Report, SharedPlaceReport,
    TreeReport,
};
