//! A COPC file as an octree like any other.

use std::path::PathBuf;

use crate::octree::{Octree, OctreeInfo, OctreeNode};
use crate::{NodeKey, NodePoints, ReadError};

use super::Dataset;

impl Octree for Dataset {
    fn info(&self) -> &OctreeInfo {
        &self.info
    }

    fn root(&self) -> OctreeNode {
        let (byte_offset, byte_size) = (self.copc_info().root_page_offset, self.copc_info().root_page_size);
        OctreeNode { is_proxy: true, byte_offset, byte_size, ..OctreeNode::new(NodeKey::ROOT) }
    }

    fn chunk(&self, proxy: &OctreeNode) -> Result<Vec<OctreeNode>, ReadError> {
        self.read_page(proxy.key, proxy.byte_offset, proxy.byte_size)
    }

    fn count(&self, node: &OctreeNode) -> Result<u64, ReadError> {
        Ok(node.points)
    }

    fn points(&self, node: &OctreeNode, out: &mut NodePoints) -> Result<(), ReadError> {
        self.read_points(node, out)
    }

    fn locate_index(&self, _: &OctreeNode) -> PathBuf {
        self.path().to_path_buf()
    }
}
