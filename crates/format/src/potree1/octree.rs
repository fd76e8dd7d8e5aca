//! A Potree 1.x dataset as an octree like any other.

use std::path::PathBuf;

use crate::octree::{Octree, OctreeInfo, OctreeNode};
use crate::{NodeKey, NodePoints, ReadError};

use super::{Dataset, Node};

impl Octree for Dataset {
    fn info(&self) -> &OctreeInfo {
        &self.info
    }

    fn root(&self) -> OctreeNode {
        OctreeNode { is_proxy: true, ..OctreeNode::new(NodeKey::ROOT) }
    }

    fn chunk(&self, proxy: &OctreeNode) -> Result<Vec<OctreeNode>, ReadError> {
        Ok(self.read_index(proxy.key)?.iter().map(OctreeNode::from).collect())
    }

    fn count(&self, node: &OctreeNode) -> Result<u64, ReadError> {
        self.count(node.key)
    }

    fn points(&self, node: &OctreeNode, out: &mut NodePoints) -> Result<(), ReadError> {
        self.read_points(node.key, out)
    }

    fn locate_index(&self, node: &OctreeNode) -> PathBuf {
        self.locate(&self.metadata.index_file(node.key))
    }
}

impl From<&Node> for OctreeNode {
    fn from(node: &Node) -> Self {
        let Node { key, child_mask, declared: points, is_proxy } = *node;
        Self { is_proxy, child_mask, points, ..Self::new(key) }
    }
}
