//! The outputs that every case goes through, and what a decoder that follows `docs/formats` gets from them.

use std::path::Path;

use pointmill_format::batches::{BatchScratch, Batches, Precision};
use pointmill_format::bintree::Bintree;
use pointmill_format::octree::OctreeNodes;
use pointmill_format::{NodeKey, NodePoints, open_octree};

/// An output of a case.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Output {
    pub(crate) name: &'static str,
    pub(crate) rule: Rule,
    /// Of [`RUNS`].
    pub(crate) run: usize,
    /// In the folder of the run.
    pub(crate) folder: &'static str,
}

/// What a format does to positions: a section of `docs/design/numerics.md`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Rule {
    /// Integers, scale and offset: Potree 2.0 and COPC.
    Integers,
    /// Integers from the corner of each node: Potree 1.x.
    FromCorners,
    /// Single precision from the center of a leaf.
    Singles,
    /// The middle of a cell of this many bits.
    Cells(u32),
}

/// What is converted together: the options of each format after its name.
pub(crate) const RUNS: [&[&[&str]]; 3] = [
    &[&["potree2"], &["potree1"], &["copc"], &["bintree"], &["batches", "--planes", "30"]],
    &[
        &["potree2", "--encoding", "brotli", "--brotli-quality", "1", "--leaf-capacity", "20"],
        &["potree1", "--potree1-version", "1.8"],
        &["bintree", "--capacity", "16"],
        &["batches", "--planes", "20"],
    ],
    &[&["batches", "--planes", "10"]],
];

const fn output(name: &'static str, rule: Rule, run: usize, folder: &'static str) -> Output {
    Output { name, rule, run, folder }
}

/// A new output is a row here.
pub(crate) const OUTPUTS: [Output; 10] = [
    output("Potree 2.0", Rule::Integers, 0, "potree2"),
    output("Potree 1.7", Rule::FromCorners, 0, "potree1"),
    output("COPC", Rule::Integers, 0, "copc"),
    output("binary tree", Rule::Singles, 0, "bintree"),
    output("batches of 30 bits", Rule::Cells(30), 0, "batches"),
    output("Potree 2.0, Brotli, small leaves", Rule::Integers, 1, "potree2"),
    output("Potree 1.8, small leaves", Rule::FromCorners, 1, "potree1"),
    output("binary tree, small leaves", Rule::Singles, 1, "bintree"),
    output("batches of 20 bits", Rule::Cells(20), 1, "batches"),
    output("batches of 10 bits", Rule::Cells(10), 2, ""),
];

/// A point of a dataset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Decoded {
    /// Which one it is: its intensity.
    pub(crate) number: u16,
    /// Where it decodes.
    pub(crate) world: [f64; 3],
    /// Of its node; 0 in formats without levels.
    pub(crate) level: u8,
}

impl Output {
    /// All points of the dataset.
    pub(crate) fn decode(&self, dataset: &Path) -> Vec<Decoded> {
        let mut all = Vec::new();
        match self.rule {
            Rule::Integers | Rule::FromCorners => octree(dataset, &mut all),
            Rule::Singles => bintree(dataset, &mut all),
            Rule::Cells(_) => batches(dataset, &mut all),
        }
        all
    }
}

fn take(points: &NodePoints, level: u8, all: &mut Vec<Decoded>) {
    if !points.is_empty() {
        let numbers = points.column::<u16>("intensity").unwrap();
        let decoded = |(i, number): (usize, &u16)| Decoded { number: *number, world: points.world(i).unwrap(), level };
        all.extend(numbers.iter().enumerate().map(decoded));
    }
}

fn octree(dataset: &Path, all: &mut Vec<Decoded>) {
    let octree = open_octree(dataset).unwrap();
    let mut nodes = OctreeNodes::new(&*octree).unwrap();
    let (mut points, mut stack) = (NodePoints::default(), vec![NodeKey::ROOT]);
    while let Some(key) = stack.pop() {
        nodes.load(&*octree, key).unwrap();
        stack.extend(nodes.children(key).map(|child| child.key));
        octree.points(nodes.get(key).unwrap(), &mut points).unwrap();
        take(&points, key.level, all);
    }
}

fn bintree(dataset: &Path, all: &mut Vec<Decoded>) {
    let (tree, mut points) = (Bintree::open(dataset).unwrap(), NodePoints::default());
    for leaf in tree.leaves() {
        tree.read_leaf(leaf, &mut points).unwrap();
        take(&points, 0, all);
    }
}

fn batches(dataset: &Path, all: &mut Vec<Decoded>) {
    let batches = Batches::open(dataset).unwrap();
    let (mut scratch, mut points) = (BatchScratch::default(), NodePoints::default());
    for slot in 0..batches.header().batches {
        batches.read_batch(slot, Precision::Thirty, &mut scratch, &mut points).unwrap();
        take(&points, 0, all);
    }
}
