//! Potree 1.x: every check has seen its own fault: a good dataset, one planted break, exactly that finding and no other.

mod corpus;
mod dataset;
mod faults;
mod points;
mod sources;
#[path = "../support/mod.rs"]
mod support;
mod surfels;
