//! From scans to datasets, within a memory budget.
//!
//! [`convert`] makes octrees, binary trees and batches of any number of scans, several from one read:
//!
//! 1. `sources`: the scans are opened; their headers give a lattice before the first point is read.
//! 2. `gather`: every point is decoded once, in parallel, becomes integers on that lattice, and is kept as a record in
//!    blocks that are grouped by the cells of a coarse grid, in memory or, beyond the budget, in one spill file. The
//!    result is the `cloud`: facts that nothing changes afterwards, and records that each output takes once.
//! 3. `outputs`: each format builds its dataset from the cloud: the octree by sampling chunks in Morton order, the binary
//!    tree by exact sums of cells, batches by sorting.
//!
//! The bytes depend on the points and the settings alone: not on threads, memory, or the order of the inputs.
//!
//! ```
//! use pointmill_converter::{Plan, Potree2Settings, Silent, convert};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let folder = tempfile::tempdir()?;
//! let scan = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/las/format3.las");
//! let plan = Plan::new(vec![scan.into()], folder.path().join("city"));
//! let report = convert(&plan, &[Potree2Settings::default().into()], &Silent)?;
//! assert_eq!(report.points.read, report.outputs[0].points);
//! # Ok(())
//! # }
//! ```

#![cfg_attr(
    not(test),
    warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::unwrap_in_result)
)]

mod advice;
#[cfg(feature = "bench")]
#[doc(hidden)]
pub mod bench_api;
mod cloud;
mod convert;
mod derive;
mod error;
mod estimate;
mod export;
mod gather;
mod job;
pub mod memory;
mod octree;
mod outputs;
mod plan;
mod reason;
mod report;
mod runtime;
mod shared_job;
mod sources;
mod unit_name;
mod warning;

pub use advice::Advice;
pub use convert::{Verify, convert, convert_on, convert_verified, settings};
pub use error::{ConvertError, InputFault, JobFault, MemoryNeed, OutputFault, Unsupported};
pub use estimate::estimate;
pub use export::{ExportReport, ExportedAttribute, ExportedPoints, PositionChange, export, export_on};
pub use octree::Sampling;
pub use outputs::batches::BatchesSettings;
pub use outputs::bintree::BintreeSettings;
pub use outputs::copc::CopcSettings;
pub use outputs::potree1::{Potree1Settings, Potree1Version};
pub use outputs::potree2::{DarkColours, Encoding, Potree2Settings};
pub use outputs::{StagedFiles, Target, WorkFolder, resolve_path};
pub use plan::{
    AttributeChoice, Checkpoint, Derive, DeriveNormals, Duplicates, ExportFormat, Filter, LengthUnit, NEIGHBOURS,
    Neighbourhood, OnFault, Orient, OriginPoints, Outliers, Plan, PlanError, PlanFault, PositionPrecision, RgbDepth,
    ScaleChoice, Setting,
};
pub use reason::{AxisReason, BuiltAnew, Coarser, CoarserCause, GridReason, LatticeBasis, LatticeReason};
pub use report::{
    Accuracy, AttributeReport, ChangedAttribute, ChangedValues, ChoiceReason, DerivedReport, DropReason,
    DroppedAttribute, Estimate, GridReport, How, InputReport, Integers, Merged, Metres, MissingValues,
    OtherFilesReport, OutputReport, PhaseReport, PlannedChoice, PointsReport, PositionErrors, PrecisionReport, Report,
    SavedBytes, SharedPlaceReport, TakenOver, TreeReport,
};
pub use runtime::{Disk, DiskOperation, Events, Phase, Replacing, Silent, SystemDisk};
pub use shared_job::{finish_job, job_units, plan_job, run_units};
pub use sources::{ResolvedCrs, resolve_crs};
pub use unit_name::{JobUnit, JobUnits, UnitName};
pub use warning::{ColourNote, CrsNote, NameFault, Proj4Fault, RenamedAttribute, ViewerNote, Warning};
