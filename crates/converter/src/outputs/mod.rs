//! The formats that are written, a folder each; [`output`] is what they have in common.

mod attributes;
pub(crate) mod batches;
pub(crate) mod bintree;
mod colour;
pub(crate) mod copc;
mod number;
mod octrees;
mod origin;
mod output;
pub(crate) mod potree1;
pub(crate) mod potree2;
mod recovery;
mod staging;
mod together;

pub(crate) use attributes::choose as choose_attributes;
pub use output::Target;
pub(crate) use output::{DiskSize, check, choices, keep_lattice, named_attributes, wants};
pub(crate) use staging::{StagedDataset, StagedFile, StagedFolder};
pub use staging::{StagedFiles, WorkFolder, resolve_path};
pub(crate) use together::{groups, write};
