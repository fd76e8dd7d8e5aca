//! Every check of binary trees has seen its own fault: a good dataset, one planted break, exactly that finding.

mod faults;
mod index;
mod sources;
mod support;
#[path = "../support/surfels.rs"]
mod surfels;
mod surfels_of_leaves;
