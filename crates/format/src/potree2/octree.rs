//! A Potree 2.0 dataset as an octree like any other.

use std::path::PathBuf;

use crate::octree::{Octree, OctreeInfo, OctreeNode};
use crate::{NodeKey, NodePoints, ReadError};

use super::{Dataset, HIERARCHY_FILE, Node, NodeRecord, NodeType};

impl Octree for Dataset {
    fn info(&self) -> &OctreeInfo {
        &self.info
    }

    fn root(&self) -> OctreeNode {
        let byte_size = self.metadata.first_chunk_size;
        OctreeNode { is_proxy: true, byte_size, ..OctreeNode::new(NodeKey::ROOT) }
    }

    fn chunk(&self, proxy: &OctreeNode) -> Result<Vec<OctreeNode>, ReadError> {
        let nodes = self.read_chunk(proxy.key, proxy.byte_offset, proxy.byte_size)?;
        Ok(nodes.iter().map(OctreeNode::from).collect())
    }

    fn count(&self, node: &OctreeNode) -> Result<u64, ReadError> {
        Ok(if node.byte_size == 0 { 0 } else { node.points })
    }

    fn points(&self, node: &OctreeNode, out: &mut NodePoints) -> Result<(), ReadError> {
        self.read_points(&Node::from(node), out)
    }

    fn locate_index(&self, _: &OctreeNode) -> PathBuf {
        self.locate(HIERARCHY_FILE)
    }
}

impl From<&Node> for OctreeNode {
    fn from(Node { key, record }: &Node) -> Self {
        let NodeRecord { child_mask, points, byte_offset, byte_size, .. } = *record;
        let (key, is_proxy) = (*key, record.is_proxy());
        Self { key, is_proxy, child_mask, points: points.into(), byte_offset, byte_size }
    }
}

impl From<&OctreeNode> for Node {
    fn from(node: &OctreeNode) -> Self {
        let OctreeNode { key, is_proxy, child_mask, points, byte_offset, byte_size } = *node;
        let node_type = match (is_proxy, child_mask) {
            (true, _) => NodeType::Proxy,
            (false, 0) => NodeType::Leaf,
            (false, _) => NodeType::Normal,
        };
        let points = u32::try_from(points).unwrap_or(u32::MAX);
        Self { key, record: NodeRecord { node_type: node_type as u8, child_mask, points, byte_offset, byte_size } }
    }
}
