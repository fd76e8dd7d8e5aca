//! Records of leaves as the comparison with the sources wants them.

use std::sync::Arc;

use pointmill_format::bintree::NodeKind;
use pointmill_format::{Attribute, AttributeType, ReadError};
use rayon::prelude::*;
use serde_json::Value;

use super::leaf::Points;
use super::routes::{self, Routes};
use super::tree::Tree;
use crate::against::block::{BLOCK_POINTS, Block};
use crate::against::rules::{Channels, Conversion};
use crate::against::{self, Rules, Sink};
use crate::place::Place;

/// What is compared: class, and every column behind the core. Colours of 8 bits are compared as such; beside `rgb` they
/// were checked against it, point by point.
pub(super) fn rules(tree: &Tree<'_>) -> Rules {
    let header = tree.header();
    let extras = || header.record.extras().iter().map(|e| &e.attribute);
    let only_bytes = extras().all(|a| a.name != "rgb");
    let mut attributes = vec![Attribute::new("classification", AttributeType::Float32, 1)];
    for attribute in extras() {
        match is_rgba(attribute) {
            true if only_bytes => attributes.push(Attribute::new("rgb", AttributeType::UInt16, 3)),
            true => {}
            false => attributes.push(attribute.clone()),
        }
    }
    let own = if header.pointmill.is_empty() { Value::Null } else { Value::Object(header.pointmill.clone()) };
    let mut rules = Rules::new(attributes, header.lattice, &own);
    rules.conversions[0] = Conversion::WholeClass;
    if only_bytes && rules.rgb.is_some() {
        rules.channels = Channels::Rounded;
    }
    if !tree.is_certain() {
        rules.stored = Some(Arc::new(Routes::new(tree)));
    }
    rules
}

fn is_rgba(attribute: &Attribute) -> bool {
    attribute.name == "rgba" && attribute.ty == AttributeType::UInt8 && attribute.elements == 4
}

/// Where in a record the words of the compared attributes stand.
pub(super) struct Filler<'a> {
    tree: &'a Tree<'a>,
    /// Positions are compared as they are stored.
    as_stored: bool,
    stride: usize,
    /// For each attribute of the rules: byte, bytes of an element, elements.
    columns: Vec<(usize, usize, usize)>,
}

impl<'a> Filler<'a> {
    pub(super) fn new(tree: &'a Tree<'a>, rules: &Rules) -> Self {
        let header = tree.header();
        let place = |attribute: &Attribute| {
            let name = if rules.channels == Channels::Rounded && attribute.name == "rgb" {
                "rgba"
            } else {
                attribute.name.as_str()
            };
            let stored = header.record.columns().find(|c| c.attribute.name == name);
            stored.map_or((0, 0, 0), |c| (c.offset, c.attribute.ty.size(), attribute.elements))
        };
        let columns = rules.attributes.iter().map(place).collect();
        Self { tree, as_stored: rules.stored.is_some(), stride: header.record.stride(), columns }
    }

    /// Hands over a leaf's records in blocks.
    pub(super) fn fill(&self, leaf: u32, points: &Points, block: &mut Block, sink: &mut Sink<'_>) {
        for start in (0..points.len()).step_by(BLOCK_POINTS) {
            let end = points.len().min(start + BLOCK_POINTS);
            block.reset(self.columns.len());
            block.keep.resize(end - start, true);
            if self.as_stored {
                let node = Routes::node_of_leaf(self.tree, leaf) as usize;
                for i in start..end {
                    let words = routes::words(node, points.offset(i));
                    block.positions.iter_mut().zip(words).for_each(|(to, word)| to.push(word));
                }
            } else {
                for (to, from) in block.positions.iter_mut().zip(&points.steps) {
                    to.extend_from_slice(&from[start..end]);
                }
            }
            let bytes = points.bytes.get(start * self.stride..end * self.stride).unwrap_or_default();
            for (words, (at, size, elements)) in block.words.iter_mut().zip(&self.columns) {
                for record in bytes.chunks_exact(self.stride) {
                    words.extend((0..*elements).map(|e| word(&record[at + e * size..at + (e + 1) * size])));
                }
            }
            sink(block);
        }
    }
}

/// The bits of an element.
fn word(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}

/// All leaves of a dataset.
pub(super) struct Records<'a> {
    pub(super) tree: &'a Tree<'a>,
    pub(super) readable: &'a [bool],
}

impl against::Records for Records<'_> {
    fn each_block(&self, rules: &Rules, work: &(dyn Fn(&mut Block, Place) + Sync)) -> Result<(), ReadError> {
        let header = self.tree.header();
        let filler = Filler::new(self.tree, rules);
        let nodes = 0..self.tree.nodes().len() as u32;
        let readable = nodes.into_par_iter().filter(|index| self.readable[*index as usize]);
        readable.try_for_each_init(<(Points, Block)>::default, |(points, block), index| {
            let Some(NodeKind::Leaf { center, .. }) = self.tree.dataset.node(index).map(|n| n.kind) else {
                return Ok(());
            };
            match self.tree.dataset.read_leaf_bytes(index, &mut points.bytes) {
                Err(error) if !error.is_io() => return Ok(()), // reported by the pass
                other => other?,
            }
            points.decode(header.record.stride(), center, &header.lattice);
            let place = self.tree.place(index);
            filler.fill(index, points, block, &mut |block| work(block, place));
            Ok(())
        })
    }
}
