//! The octree as far as it is loaded.

use std::collections::HashMap;

use crate::octree::ChunkRanges;
use crate::{NodeKey, ReadError};

use super::{Dataset, HIERARCHY_FILE, Node, NodeRecord};

/// The part of the octree that is known, for renderers: it begins with the root's chunk and grows by a chunk whenever
/// the renderer comes to a proxy that it wants to draw.
///
/// ```
/// use pointmill_format::{NodeKey, potree2::{Dataset, Hierarchy}};
///
/// # fn main() -> Result<(), pointmill_format::ReadError> {
/// let dataset = Dataset::open(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/potree2/default"))?;
/// let mut tree = Hierarchy::new(&dataset)?;
/// let mut stack = vec![NodeKey::ROOT];
/// while let Some(key) = stack.pop() {
///     tree.load(&dataset, key)?; // does nothing unless `key` is a proxy
///     stack.extend(tree.children(key).map(|child| child.key));
/// }
/// assert_eq!(tree.len(), dataset.read_hierarchy()?.len());
/// # Ok(())
/// # }
/// ```
///
/// To keep a render loop free of waiting, read the chunk on another thread with [`Dataset::read_chunk`] and hand it
/// over with [`Hierarchy::insert`].
#[derive(Debug, Clone)]
pub struct Hierarchy {
    nodes: HashMap<NodeKey, NodeRecord>,
    ranges: ChunkRanges,
}

impl Hierarchy {
    /// Reads the root's chunk.
    ///
    /// # Errors
    /// As [`Dataset::read_chunk`].
    pub fn new(dataset: &Dataset) -> Result<Self, ReadError> {
        let size = dataset.metadata().first_chunk_size;
        // A stand-in for the root, which no chunk refers to.
        let root = NodeRecord { node_type: 2, child_mask: 0, points: 0, byte_offset: 0, byte_size: size };
        let mut tree = Self { nodes: HashMap::from([(NodeKey::ROOT, root)]), ranges: ChunkRanges::default() };
        tree.load(dataset, NodeKey::ROOT)?;
        Ok(tree)
    }

    /// The node at `key`, if it is known to exist; it may be a proxy.
    pub fn get(&self, key: NodeKey) -> Option<Node> {
        self.nodes.get(&key).map(|&record| Node { key, record })
    }

    /// The children of the node at `key`, by index; none of a proxy or a node that is not known.
    pub fn children(&self, key: NodeKey) -> impl Iterator<Item = Node> + '_ {
        let parent = self.nodes.get(&key);
        let exists = move |child: &u8| parent.is_some_and(|record| record.has_child(*child));
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
    /// As [`Dataset::read_chunk`] and [`Self::insert`]; the tree is as before.
    pub fn load(&mut self, dataset: &Dataset, key: NodeKey) -> Result<usize, ReadError> {
        match self.nodes.get(&key) {
            Some(record) if record.is_proxy() => {
                let chunk = dataset.read_chunk(key, record.byte_offset, record.byte_size)?;
                self.insert(dataset, &chunk)
            }
            _ => Ok(0),
        }
    }

    /// Adds a chunk that [`Dataset::read_chunk`] gave for a proxy of this tree. Returns how many nodes were added: 0 if
    /// the chunk is here already.
    ///
    /// # Errors
    /// A chunk that begins with a proxy or overlaps another one; the tree is as before.
    pub fn insert(&mut self, dataset: &Dataset, chunk: &[Node]) -> Result<usize, ReadError> {
        let Some(root) = chunk.first() else { return Ok(0) };
        let Some(proxy) = self.nodes.get(&root.key).filter(|r| r.is_proxy()) else { return Ok(0) };
        let path = dataset.locate(HIERARCHY_FILE);
        if root.record.is_proxy() {
            let what = format!("the hierarchy chunk of {} begins with a proxy", root.key);
            return Err(ReadError::broken(path, proxy.byte_offset, what));
        }
        self.ranges.claim(root.key, proxy.byte_offset, proxy.byte_size, &path)?;
        self.nodes.extend(chunk.iter().map(|n| (n.key, n.record)));
        Ok(chunk.len() - 1)
    }
}
