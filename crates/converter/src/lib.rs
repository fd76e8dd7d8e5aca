//! From scans to datasets: gathering, octree building and sampling within a memory budget.
//!
//! [`convert`] makes a Potree 2.0 octree of any number of scans:
//!
//! 1. every point is decoded once, in parallel, becomes integers on one lattice, and is kept as a record in blocks that
//!    are grouped by the cells of a coarse grid, in memory or, beyond the budget, in one spill file;
//! 2. the cloud is cut into chunks, octree nodes that are small enough to be built alone; each is sorted in Morton
//!    order, divided and sampled bottom-up by one thread;
//! 3. finished chunks are put behind one another in Morton order, and the few nodes above them are sampled as soon as
//!    all their children are there.
//!
//! The bytes depend on the points and the settings alone: not on threads, memory, chunks or the order of the inputs.

mod axis;
mod batches;
#[doc(hidden)]
pub mod bench_api;
mod bintree;
mod budget;
mod build;
mod checksum;
mod chunks;
mod convert;
mod crs;
mod describe;
mod error;
mod estimate;
mod events;
mod gather;
mod grid;
mod job;
mod lattice;
pub mod memory;
mod morton;
mod needs;
mod octree;
mod os_hints;
mod plan;
mod records;
mod report;
mod sample;
mod schema;
mod write;

pub use convert::convert;
pub use error::ConvertError;
pub use estimate::estimate;
pub use events::{Events, Phase, Silent};
pub use plan::{
    AttributeChoice, BatchesSettings, BintreeSettings, Duplicates, Encoding, Filter, OnFault, Plan, RgbDepth, Sampling,
    ScaleChoice, Target,
};
pub use report::{
    CoordinateChange, DroppedAttribute, Estimate, GridReport, InputReport, OutputReport, PhaseReport, PointsReport,
    Report, TreeReport,
};
