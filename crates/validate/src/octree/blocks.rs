//! Nodes whose positions are those of one lattice, as records for the comparison with the sources.

use pointmill_format::NodePoints;

use crate::against::block::{BLOCK_POINTS, Block, append_words};
use crate::against::{Rules, Sink};

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
