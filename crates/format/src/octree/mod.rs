//! Octrees of points, whatever format they are in: what a renderer asks, so that it walks all of them in the same way.
//!
//! [`Octree`] is what a dataset answers, [`OctreeNodes`] the part of the tree that is known, [`visible_nodes`] what a picture
//! shows. [`open_octree`](crate::open_octree) opens any kind.
//!
//! ```
//! use pointmill_format::octree::OctreeNodes;
//! use pointmill_format::{NodeKey, NodePoints, open_octree};
//!
//! # fn main() -> Result<(), pointmill_format::ReadError> {
//! for folder in ["potree2/brotli", "potree1/words"] {
//!     let octree = open_octree(format!("{}/../../fixtures/{folder}", env!("CARGO_MANIFEST_DIR")))?;
//!     let info = octree.info();
//!     let mut nodes = OctreeNodes::new(&*octree)?;
//!     let (mut points, mut stack, mut total) = (NodePoints::default(), vec![NodeKey::ROOT], 0);
//!     while let Some(key) = stack.pop() {
//!         nodes.load(&*octree, key)?; // does nothing unless `key` is a proxy
//!         stack.extend(nodes.children(key).map(|child| child.key));
//!         let Some(node) = nodes.get(key) else { continue };
//!         octree.points(node, &mut points)?;
//!         assert!(points.is_empty() || points.column::<u16>("rgb").is_some());
//!         println!("{key} in {:?}: {} points, {} apart", info.node_box(key), points.len(), info.spacing_at(key.level));
//!         total += points.len() as u64;
//!     }
//!     assert_eq!(Some(total), info.points);
//! }
//! # Ok(())
//! # }
//! ```

mod chunk_cut;
mod linked_tree;
mod nodes;
mod ranges;
mod visible;

use std::path::PathBuf;

use crate::{Aabb, Attribute, NodeKey, NodePoints, ReadError};

pub(crate) use chunk_cut::chunk_roots;
pub(crate) use linked_tree::{Keyed, LinkedTree};
pub use nodes::OctreeNodes;
pub(crate) use ranges::ChunkRanges;
pub use visible::{Order, Selection, Viewpoint, VisibleNode, visible_nodes};

/// What an octree says of itself.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct OctreeInfo {
    /// For people: "Potree 1.7".
    pub format: String,
    /// The root's box, a cube, world units.
    pub cube: Aabb,
    /// Distance between points in the root, world units.
    pub spacing: f64,
    /// Points of all nodes together, if the dataset says it.
    pub points: Option<u64>,
    /// The columns of [`Octree::points`], in their order; positions are not among them.
    pub attributes: Vec<Attribute>,
    /// A proj4 definition or nothing.
    pub projection: String,
}

impl OctreeInfo {
    /// What an octree of that cube and spacing (world units) says if it says nothing else.
    #[must_use]
    pub fn new(format: impl Into<String>, cube: Aabb, spacing: f64, attributes: Vec<Attribute>) -> Self {
        Self { format: format.into(), cube, spacing, points: None, attributes, projection: String::new() }
    }

    /// The box of a node: the cube halved [`NodeKey::level`] times.
    #[must_use]
    pub fn node_box(&self, key: NodeKey) -> Aabb {
        self.cube.octant(key)
    }

    /// Distance between points in inner nodes of `level`, world units: halves with every level.
    #[must_use]
    pub fn spacing_at(&self, level: u8) -> f64 {
        self.spacing * (-f64::from(level)).exp2()
    }
}

/// A node as an index has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct OctreeNode {
    /// Its address.
    pub key: NodeKey,
    /// What is known of it, and of what is below it, stands in a chunk of the index that is not read yet
    /// ([`Octree::chunk`]).
    pub is_proxy: bool,
    /// Bit i is set if child i exists; without meaning of a proxy.
    pub child_mask: u8,
    /// Points of the node alone, as the index says. Of Potree 1.x that is often wrong, mostly 0: [`Octree::count`] knows better.
    pub points: u64,
    /// Where the points (of a proxy: its chunk) are in their file, in formats that say it; else 0. So is `byte_size`.
    pub byte_offset: u64,
    /// See `byte_offset`.
    pub byte_size: u64,
}

impl OctreeNode {
    /// The node of that address, without children, points and a place.
    #[must_use]
    pub const fn new(key: NodeKey) -> Self {
        Self { key, is_proxy: false, child_mask: 0, points: 0, byte_offset: 0, byte_size: 0 }
    }

    /// True if child `child` (0–7) exists. Not known of a proxy: false.
    pub const fn has_child(&self, child: u8) -> bool {
        !self.is_proxy && child < 8 && self.child_mask >> child & 1 == 1
    }
}

/// A dataset that is an additive octree: every point is in one node, and drawing a node requires drawing its ancestors.
///
/// Nothing is kept between calls, and threads may share it: what is read is what is requested.
pub trait Octree: Send + Sync {
    /// What is known without reading a node.
    fn info(&self) -> &OctreeInfo;

    /// The root, as a proxy: its chunk is to be read first.
    fn root(&self) -> OctreeNode;

    /// Reads the chunk of the index that begins with the proxy `proxy`: that node, no longer a proxy, and descendants of it,
    /// breadth first, some of which may be proxies.
    ///
    /// # Errors
    /// A chunk that is not there, or is no tree.
    fn chunk(&self, proxy: &OctreeNode) -> Result<Vec<OctreeNode>, ReadError>;

    /// How many points a node has. May read the place of the points, not the points.
    ///
    /// # Errors
    /// Points that are not there.
    fn count(&self, node: &OctreeNode) -> Result<u64, ReadError>;

    /// Reads the points of a node that is no proxy; replaces the contents of `out`, whose columns are those of
    /// [`OctreeInfo::attributes`].
    ///
    /// # Errors
    /// Points that are not there, or not as their format wants them.
    fn points(&self, node: &OctreeNode, out: &mut NodePoints) -> Result<(), ReadError>;

    /// What the file with a node's chunk of the index is called in messages.
    fn locate_index(&self, node: &OctreeNode) -> PathBuf;
}
