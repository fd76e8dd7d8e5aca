//! COPC 1.0: a LAZ file whose chunks are the nodes of an octree (`docs/formats/copc.md`).
//!
//! [`Dataset`] opens one from a path or from any [`ByteSource`](crate::bytes::ByteSource), and reads the ranges of the file
//! that are asked for, no others. Renderers walk it as any [`Octree`](crate::octree::Octree). As a scan, which is read from its
//! first point to its last, [`crate::open_scan`] opens it.
//!
//! ```
//! use pointmill_format::{NodePoints, copc::Dataset};
//!
//! # fn main() -> Result<(), pointmill_format::ReadError> {
//! let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/copc/pages.copc.laz");
//! let (dataset, mut points) = (Dataset::open(file)?, NodePoints::default());
//! for node in dataset.read_hierarchy()? {
//!     dataset.read_points(&node, &mut points)?;
//!     assert_eq!(points.len() as u64, node.points);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Nothing that the file says is believed: pages that overlap, go round in circles or leave the file, nodes without parents,
//! and chunks that say something else of themselves than the hierarchy are errors.

mod dataset;
mod detect;
mod entry;
mod info;
mod octree;
mod page;
mod write;

pub use crate::scan::las::chunk_table_entries;
pub use dataset::Dataset;
pub use detect::{FIRST_BYTES, detect, is_copc};
pub use entry::Entry;
pub use info::Info;
pub use write::{Ending, Heading, MAX_PAGE_ENTRIES, Pages, Summary, encode_pages};
