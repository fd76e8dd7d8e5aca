//! Potree 2.0 datasets: a folder of `metadata.json`, `hierarchy.bin` and `octree.bin` (`docs/formats/potree2.md`).
//!
//! [`Dataset`] opens one from a folder or from any [`ByteSource`](crate::bytes::ByteSource). A renderer walks the octree
//! lazily with [`Hierarchy`] and reads nodes into [`NodePoints`](crate::NodePoints); a tool that wants everything calls
//! [`Dataset::read_hierarchy`].
//!
//! ```
//! use pointmill_format::{NodePoints, potree2::Dataset};
//!
//! # fn main() -> Result<(), pointmill_format::ReadError> {
//! let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/potree2/brotli");
//! let dataset = Dataset::open(folder)?;
//! let (mut points, mut total) = (NodePoints::default(), 0);
//! for node in dataset.read_hierarchy()? {
//!     dataset.read_points(&node, &mut points)?;
//!     println!("{}: {} points in {:?}", node.key, points.len(), dataset.metadata().node_cube(node.key));
//!     total += points.len() as u64;
//! }
//! assert_eq!(total, dataset.metadata().points);
//! # Ok(())
//! # }
//! ```
//!
//! Nothing found in a file is trusted: ranges are checked against the file, the tree is free of cycles, and memory is
//! allocated only where bytes are there to fill it. What PotreeConverter 2 wrote is read, its faults included.
//!
//! For writing there are [`Metadata::to_json`], [`encode_hierarchy`] and [`encode_brotli`]; where the payloads lie in
//! `octree.bin` is the writer's choice.

mod brotli;
mod chunk;
mod columns;
mod dataset;
mod encode_brotli;
mod encode_hierarchy;
mod hierarchy;
mod metadata;
mod metadata_json;
mod metadata_parse;
mod morton;
mod node_points;
mod octree;
mod payload;
mod record;

pub use dataset::Dataset;
pub use encode_brotli::{BrotliScratch, encode_brotli, encode_brotli_while};
pub use encode_hierarchy::{CHUNK_RECORDS, HierarchyBytes, encode_hierarchy};
pub use hierarchy::Hierarchy;
pub use metadata::{AttributeStats, Encoding, Metadata};
pub use record::{Node, NodeEntry, NodeRecord, NodeType};

/// The file of the metadata.
pub const METADATA_FILE: &str = "metadata.json";

/// The file of the nodes.
pub const HIERARCHY_FILE: &str = "hierarchy.bin";

/// The file of the points.
pub const OCTREE_FILE: &str = "octree.bin";
