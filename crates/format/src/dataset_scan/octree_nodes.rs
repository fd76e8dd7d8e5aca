//! The nodes of an octree, of whatever format.

use crate::octree::{Octree, OctreeNode};
use crate::{NodePoints, ReadError, Scan};

use super::described::Described;
use super::node_scan::{NodeScan, Nodes};
use super::pieces::Place;

/// An octree, and the nodes of it that are read.
struct OctreeNodes {
    octree: Box<dyn Octree>,
    nodes: Vec<OctreeNode>,
}

/// The scan of an octree. `nodes`: with their true counts, each with its place among the bytes of all.
pub(super) fn scan(octree: impl Octree + 'static, described: Described, mut nodes: Vec<OctreeNode>) -> Box<dyn Scan> {
    nodes.retain(|node| node.points > 0);
    Box::new(NodeScan::new(OctreeNodes { octree: Box::new(octree), nodes }, described))
}

impl Nodes for OctreeNodes {
    type Scratch = ();

    fn len(&self) -> usize {
        self.nodes.len()
    }

    fn place(&self, node: usize) -> Place {
        let OctreeNode { points, byte_offset, byte_size, .. } = self.nodes[node];
        Place { points, byte_offset, byte_size }
    }

    fn name(&self, node: usize) -> String {
        format!("node {}", self.nodes[node].key)
    }

    fn read(&self, node: usize, (): &mut (), out: &mut NodePoints) -> Result<(), ReadError> {
        self.octree.points(&self.nodes[node], out)
    }
}
