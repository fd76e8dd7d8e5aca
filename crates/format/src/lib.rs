//! Readers and writers of point-cloud formats, for renderers and for preprocessors.
//!
//! * [`batches`]: quantised batches with levels of detail, mapped as they stand (cargo features `mmap`, `zstd`), and written.
//! * [`bintree`]: mean-split binary trees of tight boxes, read leaf by leaf with what renderers ask, and written
//!   (feature `rstar`: nearest points too).
//! * [`potree2`]: Potree 2.0 octrees, read lazily from a folder or any byte-range source, and written.
//! * `e57` (cargo feature `e57`): E57 files, all scans of one as one cloud, decoded in parallel pieces.
//! * `las` (cargo feature `las`): LAS 1.0–1.5 and LAZ scans, decoded in parallel pieces.
//! * `ply`, `pcd`, `text` (features of these names): PLY, PCD, and XYZ/CSV, PTS, PTX and OFF scans, likewise.
//!
//! [`open_scan`] opens a scan of any kind whose feature is on; the content tells which it is.
//!
//! The crate has no threads, no temporary files and no tree building: it says what the bytes say. Lengths and counts
//! found in a file are never trusted; an allocation is bounded by the size of the file that asks for it.
#![deny(unsafe_code)] // but for the memory map of `batches` (feature `mmap`): one call, in a module of its own

mod aabb;
mod attributes;
mod dataset_kind;
mod error;
mod kind;
mod lattice;
mod node_key;
mod points;
#[cfg(any(feature = "e57", feature = "las"))]
mod quiet;
mod scan;
// each reader uses its part of it: a build with few of them leaves some of it idle
#[cfg(any(feature = "pcd", feature = "ply", feature = "text"))]
#[cfg_attr(not(all(feature = "pcd", feature = "ply", feature = "text")), allow(dead_code, unused_imports))]
mod rows;
#[cfg(any(feature = "e57", feature = "las", feature = "pcd", feature = "ply", feature = "text"))]
mod source;

pub mod batches;
pub mod bintree;
#[cfg(feature = "e57")]
pub mod e57;
#[cfg(feature = "las")]
pub mod las;
#[cfg(feature = "pcd")]
pub mod pcd;
#[cfg(feature = "ply")]
pub mod ply;
pub mod potree2;
#[cfg(feature = "text")]
pub mod text;

pub use aabb::Aabb;
pub use attributes::{Attribute, AttributeType};
pub use dataset_kind::{DatasetKind, Located, UnknownDatasetKind, locate};
pub use error::{ErrorKind, ReadError};
pub use kind::{OpenOptions, ScanKind, open_scan, supported_scans};
pub use lattice::Lattice;
pub use node_key::NodeKey;
pub use points::{Column, PointBatch, Positions};
pub use scan::{Crs, MAX_BATCH_POINTS, Piece, Resolution, Scan, ScanInfo, ScanPart, Scratch, Wanted};

/// The example in the README compiles, or the tests fail.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
