//! Mean-split binary trees: all points in leaves, tight boxes at every node (`docs/formats/bintree.md`).
//!
//! [`Bintree`] opens a dataset from a folder or from any [`ByteSource`](crate::bytes::ByteSource) and keeps its nodes in
//! memory, about 100 bytes each; leaves are read one by one into [`NodePoints`](crate::NodePoints).
//!
//! ```
//! use pointmill_format::{NodePoints, bintree::Bintree};
//!
//! # fn main() -> Result<(), pointmill_format::ReadError> {
//! let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/bintree/files");
//! let tree = Bintree::open(folder)?;
//! let (mut points, mut total) = (NodePoints::default(), 0);
//! for leaf in tree.leaves() {
//!     tree.read_leaf(leaf, &mut points)?;
//!     println!("{}: {} points, the first at {:?}", tree.leaf_name(leaf), points.len(), points.world(0));
//!     total += points.len() as u64;
//! }
//! assert_eq!(total, tree.header().points);
//! # Ok(())
//! # }
//! ```
//!
//! A renderer asks what to draw, and how, with [`Bintree::draw_list`], and what is under the cursor with [`Picker`]. To
//! write a dataset: [`RecordLayout`] places the columns, [`LeafEncoder`] makes the bytes of leaves, [`IndexWriter`]
//! writes `index.json` node by node.

mod camera;
mod encode;
mod header;
mod json;
mod leaf_cache;
mod leaf_points;
#[cfg(feature = "rstar")]
mod nearest;
mod node;
mod pick;
mod preorder;
mod query;
mod read_header;
mod read_index;
mod record_layout;
mod tree;
mod write_index;

pub use crate::geometry::{Frustum, Ray};
pub use camera::{Material, distance_range, switch_distance};
pub use encode::{LeafEncoder, class_value, leaf_center};
pub use header::{Header, Layout, SplitRule};
#[cfg(feature = "rstar")]
pub use nearest::{LeafBox, NearestPoints, Neighbour};
pub use node::{INDEX_FILE, MAX_DEPTH, Node, NodeKind, NodePath, PACKED_FILE, leaf_file_name};
pub use pick::{Hit, Picker};
pub use record_layout::{CORE_BYTES, PlacedAttribute, RecordLayout};
pub use tree::Bintree;
pub use write_index::IndexWriter;
