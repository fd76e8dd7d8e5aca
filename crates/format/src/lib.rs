//! Point-cloud files, for renderers and for preprocessors: scans become columns, datasets become nodes, and back.
//!
//! A scan (LAS, LAZ, E57, PLY, PCD, text, depth maps) is a list of attributes and a run of points. [`open_scan`] detects the kind from
//! the content and reads the header; batches of points follow, a typed column per attribute:
//!
//! ```
//! # #[cfg(feature = "las")] {
//! use pointmill_format::{OpenOptions, Positions, Wanted, open_scan};
//!
//! # let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/las/format7.laz");
//! let scan = open_scan(file, &OpenOptions::default())?;
//! let info = scan.info();
//! println!("{}, {} points, EPSG {:?}", info.format, info.points_declared, info.crs.epsg);
//! info.warnings.iter().for_each(|warning| println!("{warning}"));
//!
//! let (mut points, mut brightest) = (0, 0);
//! for batch in scan.batches(Wanted::named(info, ["intensity"])?) {
//!     let batch = batch?;
//!     if let (Positions::Quantized([x, y, z]), Some(lattice)) = (&batch.positions, info.lattice) {
//!         let first = lattice.world([x[0], y[0], z[0]].map(i64::from));
//!         println!("{} points from {first:?} on", batch.len());
//!     }
//!     let intensity = batch.column::<u16>("intensity").ok_or("no intensity")?;
//!     brightest = intensity.iter().copied().max().unwrap_or(0).max(brightest);
//!     points += batch.len() as u64;
//! }
//! assert_eq!(points, info.points_declared);
//! # }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! Programs that use all cores decode the pieces of a scan on their own threads ([`Scan::decode`]).
//!
//! * [`scan`]: scans, decoded in parallel pieces, each kind with a cargo feature: `depth` (depth maps), `e57` (E57), `las`
//!   (LAS 1.0–1.5, LAZ, COPC), `ply` (PLY), `pcd` (PCD), `text` (XYZ/CSV, PTS, PTX, OFF, OBJ); `scans` is all of them. `scan::las::write` writes
//!   LAS (feature `las`) and LAZ (feature `laz`).
//! * [`potree1`]: Potree 1.4 to 1.8 octrees (`cloud.js`), read lazily from a folder or (feature `zip`) an uncompressed
//!   archive, and what a writer of them needs.
//! * [`potree2`]: Potree 2.0 octrees, read lazily from a folder or any byte-range source, and written.
//! * `copc` (feature `las`): COPC 1.0, LAZ files that are octrees, read range by range.
//! * [`octree`]: what these have in common, for renderers that do not care which one it is.
//! * [`bintree`]: mean-split binary trees of tight boxes, read leaf by leaf with what renderers ask, and written
//!   (feature `rstar`: nearest points too).
//! * [`batches`]: quantised batches with levels of detail, mapped as they stand (features `mmap`, `zstd`), and written.
//! * [`bytes`]: positioned reads and writes of files.
//!
//! The feature `serde` gives boxes, lattices and node keys their serialisation.
//!
//! The crate has no threads, no temporary files and no tree building: it says what the bytes say. Lengths and counts
//! found in a file are never trusted; an allocation is bounded by the size of the file or, for compressed nodes, by
//! [`potree2::Dataset::set_max_node_bytes`]. No bytes make it panic; a piece that cannot be decoded is an error
//! ([`Fault::Decode`]).

#![cfg_attr(
    not(test),
    warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::unwrap_in_result)
)]
#![deny(unsafe_code)] // but for the memory map of `batches` (feature `mmap`): one call, in a separate module

mod dataset_kind;
mod dataset_scan;
mod error;
mod geometry;
mod json;
mod names;
mod open_octree;
mod open_scan;
mod points;
mod write_error;

pub mod batches;
pub mod bintree;
pub mod bytes;
#[cfg(feature = "las")]
pub mod copc;
pub mod octree;
pub mod potree1;
pub mod potree2;
pub mod scan;

pub use dataset_kind::{DatasetKind, Located, locate};
pub use error::{Advice, ErrorKind, Fault, ReadError, json_fault, system_reason};
pub use geometry::{Aabb, Affine, AffineFault, AxisGrid, Deviations, Frustum, Lattice, NodeKey, Ray};
pub use names::UnknownName;
pub use open_octree::open_octree;
pub use open_scan::open_scan;
pub use points::{Attribute, AttributeType, Changes, Column, Element, NodePoints, PointBatch, Positions};
pub use scan::{
    Batches, Blob, Counted, Crs, DatasetNote, Decimal, DepthFilter, DepthOptions, ImageEncoding, ImageGeometry,
    ImageKind, ImagePose, Intrinsics, MAX_BATCH_BYTES, MAX_BATCH_POINTS, OpenOptions, OtherKind, Piece, PointMap,
    Resolution, Scan, ScanImage, ScanInfo, ScanKind, ScanMap, ScanMaps, ScanPart, ScanWarning, Scratch, Sink, Unit,
    UnknownAttribute, Wanted, scans_named, supported_scans,
};
pub use write_error::WriteError;

/// The JSON library whose types hold keys that a format leaves free ([`potree2::Metadata::extra`]).
pub use serde_json;

/// The library of the R*-tree that [`bintree::NearestPoints::leaf_boxes`] gives (feature `rstar`).
#[cfg(feature = "rstar")]
pub use rstar;

/// What threads share stays shareable: this compiles, or the types have lost it.
const _: () = {
    const fn shared<T: Send + Sync>() {}
    #[cfg(feature = "las")]
    shared::<copc::Dataset>();
    shared::<potree1::Dataset>();
    shared::<potree2::Dataset>();
    shared::<potree2::Hierarchy>();
    shared::<bintree::Bintree>();
    shared::<bintree::Picker>();
    shared::<batches::Batches<batches::AlignedBytes>>();
    shared::<NodePoints>();
    shared::<Box<dyn Scan>>();
    shared::<ScanInfo>();
    shared::<PointBatch>();
    shared::<Scratch>();
    shared::<Batches<'static>>();
    shared::<bytes::Folder>();
    shared::<ReadError>();
    shared::<WriteError>();
};

/// The example in the README compiles, or the tests fail.
#[cfg(doctest)]
#[doc = include_str!("../../../README.md")]
struct Readme;
