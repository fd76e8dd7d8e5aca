//! From a node to points.

use pointmill_format::NodePoints;
use pointmill_format::batches::{BatchScratch, Precision};

use crate::dataset::{Content, PmDataset};
use crate::status::{Fault, Outcome, PmStatus};

/// Points of a node, with memory that is reused from node to node.
#[derive(Debug, Default)]
pub(crate) struct Decoder {
    pub(crate) points: NodePoints,
    scratch: BatchScratch,
}

impl Decoder {
    /// Decodes node `id`. `bits` of a position on each axis, of batches: 10, 20, 30, or 0 for all there are.
    pub(crate) fn decode(&mut self, dataset: &PmDataset, id: u32, bits: u32) -> Outcome {
        match &dataset.content {
            Content::Octree(tree) => {
                let (node, _) = tree.node(id).ok_or_else(|| dataset.no_node(id))?;
                if node.is_proxy {
                    let text =
                        format!("node {} is a proxy: its chunk of the hierarchy is to be loaded first", node.key);
                    return Err(Fault::new(PmStatus::Missing, text));
                }
                tree.octree.points(&node, &mut self.points)?;
            }
            Content::Bintree(leaves) => {
                dataset.node_bounds(id)?;
                leaves.tree.read_leaf(id, &mut self.points)?;
            }
            Content::Batches(batches) => {
                dataset.node_bounds(id)?;
                let precision = match bits {
                    0 => Precision::Thirty,
                    bits => Precision::from_bits(bits).ok_or_else(|| {
                        Fault::argument(format!("bits are {bits}; there are 10, 20 and 30, and 0 for all"))
                    })?,
                };
                batches.read_batch(id, precision, &mut self.scratch, &mut self.points)?;
            }
        }
        Ok(())
    }
}
