//! Records of nodes as the comparison with the sources wants them.

use pointmill_format::potree2::{Dataset, Node};
use pointmill_format::{NodePoints, ReadError};
use rayon::prelude::*;

use crate::against::block::Block;
use crate::against::{self, Rules};
use crate::octree::blocks::fill_blocks;
use crate::octree::tree::Tree;
use crate::place::Place;

/// All nodes of a dataset.
pub(crate) struct Records<'a> {
    pub(crate) dataset: &'a Dataset,
    pub(crate) tree: &'a Tree,
}

impl against::Records for Records<'_> {
    fn each_block(&self, rules: &Rules, work: &(dyn Fn(&mut Block, Place) + Sync)) -> Result<(), ReadError> {
        let readable = self.tree.nodes.par_iter().filter(|n| n.readable);
        readable.try_for_each_init(<(NodePoints, Block)>::default, |(points, block), node| {
            match self.dataset.read_points(&Node::new(node.key, node.record), points) {
                Err(error) if !error.is_io() => return Ok(()), // reported by the walk
                other => other?,
            }
            fill_blocks(points, rules, block, &mut |block| work(block, node.key.into()));
            Ok(())
        })
    }
}
