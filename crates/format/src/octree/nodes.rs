//! The octree as far as it is loaded.

use std::collections::HashMap;

use crate::{NodeKey, ReadError};

use super::{ChunkRanges, Octree, OctreeNode};

/// The part of an octree that is known, for renderers: it begins with the root's chunk and grows by a chunk whenever
/// the renderer comes to a proxy that it wants to draw.
///
/// To keep a render loop free of waiting, read the chunk on another thread with [`Octree::chunk`] and hand it over with
/// [`Self::insert`].
#[derive(Debug, Clone)]
pub struct OctreeNodes {
    nodes: HashMap<NodeKey, OctreeNode>,
    ranges: ChunkRanges,
}

impl OctreeNodes {
    /// Reads the root's chunk.
    ///
    /// # Errors
    /// As [`Octree::chunk`].
    pub fn new(octree: &dyn Octree) -> Result<Self, ReadError> {
        let nodes = HashMap::from([(NodeKey::ROOT, octree.root())]);
        let mut tree = Self { nodes, ranges: ChunkRanges::default() };
        tree.load(octree, NodeKey::ROOT)?;
        Ok(tree)
    }

    /// The node at `key`, if it is known to exist; it may be a proxy.
    pub fn get(&self, key: NodeKey) -> Option<&OctreeNode> {
        self.nodes.get(&key)
    }

    /// The children of the node at `key`, by index; none of a proxy or a node that is not known.
    pub fn children(&self, key: NodeKey) -> impl Iterator<Item = &OctreeNode> + '_ {
        let parent = self.nodes.get(&key);
        let exists = move |child: &u8| parent.is_some_and(|node| node.has_child(*child));
        (0..8).filter(exists).filter_map(move |child| self.get(key.child(child)?))
    }

    /// Number of nodes known.
    pub fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Never true: there is always a root.
    pub fn is_empty(&self) -> bool {
        self.nodes.is_empty()
    }

    /// If the node at `key` is a proxy, reads its chunk: it becomes a real node and its descendants become known.
    /// Returns how many nodes were added.
    ///
    /// # Errors
    /// As [`Octree::chunk`] and [`Self::insert`]; the tree is as before.
    pub fn load(&mut self, octree: &dyn Octree, key: NodeKey) -> Result<usize, ReadError> {
        match self.nodes.get(&key) {
            Some(node) if node.is_proxy => {
                let chunk = octree.chunk(node)?;
                self.insert(octree, &chunk)
            }
            _ => Ok(0),
        }
    }

    /// Adds a chunk that [`Octree::chunk`] gave for a proxy of this tree. Returns how many nodes were added: 0 if the chunk
    /// is here already.
    ///
    /// # Errors
    /// A chunk that begins with a proxy, or whose bytes are those of another one; the tree is as before.
    pub fn insert(&mut self, octree: &dyn Octree, chunk: &[OctreeNode]) -> Result<usize, ReadError> {
        let Some(root) = chunk.first() else { return Ok(0) };
        let Some(proxy) = self.nodes.get(&root.key).filter(|node| node.is_proxy) else { return Ok(0) };
        let path = octree.locate_index(proxy);
        if root.is_proxy {
            let what = format!("the hierarchy chunk of {} begins with a proxy", root.key);
            return Err(ReadError::broken(path, proxy.byte_offset, what));
        }
        if proxy.byte_size > 0 {
            self.ranges.claim(root.key, proxy.byte_offset, proxy.byte_size, &path)?;
        }
        self.nodes.extend(chunk.iter().map(|node| (node.key, *node)));
        Ok(chunk.len() - 1)
    }
}
