//! Readers and writers of point-cloud formats, for renderers and for preprocessors.
//!
//! * [`batches`]: quantised batches with levels of detail, mapped as they stand (cargo features `mmap`, `zstd`), and written.
//! * [`bintree`]: mean-split binary trees of tight boxes, read leaf by leaf with what renderers ask, and written
//!   (feature `rstar`: nearest points too).
//! * [`potree2`]: Potree 2.0 octrees, read lazily from a folder or any byte-range source, and written.
//! * [`scan`]: scans, decoded in parallel pieces, each kind with a cargo feature: `e57` (E57), `las` (LAS 1.0–1.5, LAZ,
//!   COPC), `ply` (PLY), `pcd` (PCD), `text` (XYZ/CSV, PTS, PTX, OFF).
//! * [`bytes`]: positioned reads and writes of files.
//!
//! [`open_scan`] opens a scan of any kind whose feature is on; the kind is detected from the content.
//!
//! The crate has no threads, no temporary files and no tree building: it says what the bytes say. Lengths and counts
//! found in a file are never trusted; an allocation is bounded by the size of the file that asks for it.
#![deny(unsafe_code)] // but for the memory map of `batches` (feature `mmap`): one call, in a module of its own

mod dataset_kind;
mod error;
mod geometry;
mod names;
mod points;

pub mod batches;
pub mod bintree;
pub mod bytes;
pub mod potree2;
pub mod scan;

pub use dataset_kind::{DatasetKind, Located, locate};
pub use error::{ErrorKind, ReadError};
pub use geometry::{Aabb, Lattice, NodeKey};
pub use names::UnknownName;
pub use points::{Attribute, AttributeType, Column, Element, NodePoints, PointBatch, Positions};
pub use scan::{
    Crs, MAX_BATCH_POINTS, OpenOptions, Piece, Resolution, Scan, ScanInfo, ScanKind, ScanPart, Scratch, Sink, Wanted,
    open_scan, supported_scans,
};

/// The JSON library whose types hold keys that a format leaves free ([`potree2::Metadata::extra`]).
pub use serde_json;

/// The library of the R*-tree that [`bintree::NearestPoints::leaf_boxes`] gives (feature `rstar`).
#[cfg(feature = "rstar")]
pub use rstar;

/// What threads share stays shareable: this compiles, or the types have lost it.
const _: () = {
    const fn shared<T: Send + Sync>() {}
    shared::<potree2::Dataset>();
    shared::<potree2::Hierarchy>();
    shared::<bintree::Bintree>();
    shared::<bintree::Picker>();
    shared::<batches::Batches<batches::AlignedBytes>>();
    shared::<NodePoints>();
    shared::<bytes::Folder>();
    shared::<ReadError>();
    shared::<batches::WriteError>();
};

/// The example in the README compiles, or the tests fail.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
