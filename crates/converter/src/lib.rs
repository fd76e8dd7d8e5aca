//! From scans to datasets: gathering, octree building and sampling within a memory budget.

#[allow(dead_code)] // until the passes use it
mod crs;
mod error;
mod events;
pub mod memory;
mod plan;
mod report;

pub use error::ConvertError;
pub use events::{Events, Phase, Silent};
pub use plan::{AttributeChoice, Duplicates, Encoding, Filter, OnFault, Plan, RgbDepth, Sampling, ScaleChoice};
pub use report::{
    CoordinateChange, DroppedAttribute, Estimate, GridReport, InputReport, PhaseReport, PointsReport, Report,
    TreeReport,
};

/// Converts the inputs of `plan` to one dataset.
///
/// # Errors
/// See [`ConvertError`]; the output folder is then as it was before.
pub fn convert(plan: &Plan, events: &dyn Events) -> Result<Report, ConvertError> {
    let _ = (plan, events);
    Err(ConvertError::Internal("not built yet".into()))
}

/// Says from the headers alone what [`convert`] would do.
///
/// # Errors
/// Inputs that cannot be opened.
pub fn estimate(plan: &Plan) -> Result<Estimate, ConvertError> {
    let _ = plan;
    Err(ConvertError::Internal("not built yet".into()))
}
