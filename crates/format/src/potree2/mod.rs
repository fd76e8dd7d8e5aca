//! Potree 2.0 datasets: a folder of `metadata.json`, `hierarchy.bin` and `octree.bin` (`docs/formats/potree2.md`).
//!
//! [`Dataset`] opens one from a folder or from any [`ByteSource`]. A renderer walks the octree lazily with
//! [`Hierarchy`] and reads nodes into [`NodePoints`]; a tool that wants everything calls [`Dataset::read_hierarchy`].
//!
//! ```no_run
//! use pointmill_format::potree2::{Dataset, NodePoints};
//!
//! # fn main() -> Result<(), pointmill_format::ReadError> {
//! let dataset = Dataset::open("clouds/city".as_ref())?;
//! let mut points = NodePoints::default();
//! for node in dataset.read_hierarchy()? {
//!     dataset.read_points(&node, &mut points)?;
//!     println!("{}: {} points in {:?}", node.key, points.len(), dataset.metadata().node_cube(node.key));
//! }
//! # Ok(())
//! # }
//! ```
//!
//! Nothing found in a file is trusted: ranges are checked against the file, the tree is free of cycles, and memory is
//! asked for only where bytes are there to fill it. What PotreeConverter 2 wrote is read, its faults included.
//!
//! For writing there are [`Metadata::to_json`], [`encode_hierarchy`] and [`encode_brotli`]; where the payloads lie in
//! `octree.bin` is the writer's choice.

mod brotli;
mod chunk;
pub(crate) mod column_bytes;
mod dataset;
mod encode_brotli;
mod encode_hierarchy;
mod hierarchy;
mod metadata;
mod metadata_json;
mod metadata_parse;
mod morton;
mod node_points;
mod record;
mod source;

pub use dataset::Dataset;
pub use encode_brotli::{BrotliScratch, encode_brotli};
pub use encode_hierarchy::{HierarchyBytes, NodeEntry, encode_hierarchy};
pub use hierarchy::Hierarchy;
pub use metadata::{AttributeStats, Encoding, Metadata};
pub use node_points::NodePoints;
pub use record::{Node, NodeRecord, NodeType};
pub use source::{ByteSource, DatasetFile, Folder, Memory};
