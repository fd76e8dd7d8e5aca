//! COPC: every check has seen its own fault: a good file, one planted break, exactly that finding and no other.

mod chunks;
mod corpus;
mod file;
mod front;
mod hostile;
mod pages;
mod points;
mod sources;
#[path = "../support/mod.rs"]
mod support;
mod surfels;
