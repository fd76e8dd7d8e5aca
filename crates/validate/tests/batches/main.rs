//! Quantised batches: every check has seen its own fault. A good file, one planted break, exactly that finding.

mod against;
mod cloud;
mod coarse;
mod compressed;
mod faults;
mod golden;
mod points_faults;
#[path = "../support/surfels.rs"]
mod surfels;
mod surfels_of_batches;
