//! From chunks to octree nodes: each chunk is sorted, divided and sampled alone; the few nodes above the chunks are
//! sampled as their children become complete.
//!
//! The order of payloads in the output depends on the tree alone: a node's children are written, in order, once the
//! node can no longer be asked for a point (see [`tree`]); the root comes last.

pub(crate) mod chunk;
pub(crate) mod commit;
pub(crate) mod sort;
pub(crate) mod tree;
