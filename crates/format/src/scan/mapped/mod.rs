//! Scans whose points are moved as they are read: turned, scaled, reprojected.
//!
//! The readers know nothing of it: `scan.rs` decodes with one of them and changes its batches. Where the map takes each
//! axis to one axis, integers stay the integers of the file and the lattice changes instead, so nothing is rounded; any
//! other map makes world coordinates in double precision.

mod directions;
mod info;
mod map;
mod positions;
mod resolution;
mod sample;
mod scan;
#[cfg(test)]
mod tests;

pub use map::{PointMap, ScanMap, ScanMaps};
pub(crate) use scan::mapped;
