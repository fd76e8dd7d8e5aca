//! The nodes of an octree that are known, by number.

use std::collections::HashMap;
use std::sync::{PoisonError, RwLock};

use pointmill_format::octree::{Octree, OctreeNode, OctreeNodes};
use pointmill_format::{NodeKey, ReadError};

use crate::status::{Fault, Outcome, PmStatus};

/// An octree whose index is read chunk by chunk. Nodes are numbered in the order in which they become known; the root is 0.
pub(crate) struct Tree {
    pub(crate) octree: Box<dyn Octree>,
    known: RwLock<Known>,
}

struct Known {
    nodes: OctreeNodes,
    ids: HashMap<NodeKey, u32>,
    keys: Vec<NodeKey>,
}

impl Known {
    fn number(&mut self, key: NodeKey) {
        let next = self.keys.len() as u32;
        if let std::collections::hash_map::Entry::Vacant(entry) = self.ids.entry(key) {
            entry.insert(next);
            self.keys.push(key);
        }
    }
}

impl Tree {
    /// Reads the root's chunk.
    pub(crate) fn new(octree: Box<dyn Octree>) -> Outcome<Self> {
        let nodes = OctreeNodes::new(&*octree)?;
        let mut known = Known { nodes, ids: HashMap::new(), keys: Vec::new() };
        // breadth first, children by index: as chunks are
        known.number(NodeKey::ROOT);
        let mut at = 0;
        while let Some(key) = known.keys.get(at).copied() {
            let children: Vec<NodeKey> = known.nodes.children(key).map(|child| child.key).collect();
            children.into_iter().for_each(|child| known.number(child));
            at += 1;
        }
        Ok(Self { octree, known: RwLock::new(known) })
    }

    fn known(&self) -> std::sync::RwLockReadGuard<'_, Known> {
        self.known.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Nodes known now.
    pub(crate) fn len(&self) -> u32 {
        self.known().keys.len() as u32
    }

    /// The node of that number, with that of its parent.
    pub(crate) fn node(&self, id: u32) -> Option<(OctreeNode, Option<u32>)> {
        let known = self.known();
        let key = known.keys.get(id as usize)?;
        let parent = key.parent().and_then(|parent| known.ids.get(&parent).copied());
        Some((*known.nodes.get(*key)?, parent))
    }

    /// The numbers of the children that are known, by index.
    pub(crate) fn children(&self, id: u32) -> Vec<u32> {
        let known = self.known();
        let Some(key) = known.keys.get(id as usize) else { return Vec::new() };
        known.nodes.children(*key).filter_map(|child| known.ids.get(&child.key).copied()).collect()
    }

    /// The number of the node at `key`, if it is known.
    pub(crate) fn id(&self, key: NodeKey) -> Option<u32> {
        self.known().ids.get(&key).copied()
    }

    /// The node at `key`; `load`: reads its chunk if it is a proxy.
    pub(crate) fn at(&self, key: NodeKey, load: bool) -> Result<Option<OctreeNode>, ReadError> {
        let get = || self.known().nodes.get(key).copied();
        match get() {
            Some(proxy) if proxy.is_proxy && load => {
                self.load(&proxy)?;
                Ok(get())
            }
            found => Ok(found),
        }
    }

    /// Reads the chunk of a proxy; other threads work on meanwhile. Returns how many nodes became known.
    pub(crate) fn load(&self, proxy: &OctreeNode) -> Result<u32, ReadError> {
        if !proxy.is_proxy {
            return Ok(0);
        }
        let chunk = self.octree.chunk(proxy)?;
        let mut known = self.known.write().unwrap_or_else(PoisonError::into_inner);
        let before = known.keys.len();
        known.nodes.insert(&*self.octree, &chunk)?;
        chunk.iter().for_each(|node| known.number(node.key));
        Ok((known.keys.len() - before) as u32)
    }

    /// Reads all chunks.
    pub(crate) fn load_all(&self, most: u32) -> Outcome {
        let mut id = 0;
        while let Some((node, _)) = self.node(id) {
            if node.is_proxy {
                self.load(&node)?;
            }
            if self.len() > most {
                let text = format!("the dataset has more than the {most} nodes that are allowed");
                return Err(Fault::new(PmStatus::Memory, text));
            }
            id += 1;
        }
        Ok(())
    }
}
