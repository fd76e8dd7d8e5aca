//! Records of nodes as the comparison with the sources wants them.

use pointmill_format::potree2::{Dataset, Node};
use pointmill_format::{NodePoints, ReadError};
use rayon::prelude::*;

use crate::against::block::{BLOCK_POINTS, Block, append_words};
use crate::against::{self, Rules, Sink};
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

/// Hands over a node's records in blocks.
pub(crate) fn fill_blocks(points: &NodePoints, rules: &Rules, block: &mut Block, sink: &mut Sink<'_>) {
    for start in (0..points.len()).step_by(BLOCK_POINTS) {
        let n = (points.len() - start).min(BLOCK_POINTS);
        block.reset(rules.attributes.len());
        block.keep.resize(n, true);
        for (to, from) in block.positions.iter_mut().zip(points.quantized().unwrap_or_default()) {
            to.extend(from[start..start + n].iter().map(|v| i64::from(*v)));
        }
        for (i, attribute) in rules.attributes.iter().enumerate() {
            let column = points.columns().get(i).map(|c| (c, attribute.elements));
            append_words(column, start, n, attribute, &mut block.words[i]);
        }
        sink(block);
    }
}
