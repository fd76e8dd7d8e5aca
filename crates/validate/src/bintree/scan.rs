//! One pass over all leaves, in parallel, each read once.

use std::collections::HashMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use pointmill_format::bintree::NodeKind;
use pointmill_format::{ErrorKind, ReadError};
use rayon::prelude::*;

use super::leaf::{Exactness, Leaf, Points};
use super::records::Filler;
use super::summary::Summary;
use super::tree::Tree;
use crate::accuracy::Deviation;
use crate::against::Sums;
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::options::{Progress, ProgressFn};
use crate::outcome::LeafQuality;

/// What to pass over, and how.
pub(super) struct Scan<'a> {
    pub(super) tree: &'a Tree<'a>,
    /// By node: a leaf whose bytes are there.
    pub(super) readable: &'a [bool],
    /// The index states the lattice.
    pub(super) lattice_known: bool,
    /// Where records are summed for the comparison with the sources.
    pub(super) sums: Option<&'a Sums>,
    pub(super) findings: &'a Findings,
    pub(super) progress: &'a ProgressFn<'a>,
}

/// The bytes that the first and last record of a leaf are ordered by among points of its place.
pub(super) type Ends = [Box<[u8]>; 2];

/// What the pass found beside the findings that it pushed.
pub(super) struct Scanned {
    /// By node: of leaves whose integers are certain.
    pub(super) summaries: Vec<Option<Summary>>,
    /// Of leaves below degenerate nodes.
    pub(super) ends: HashMap<u32, Ends>,
    pub(super) quality: LeafQuality,
    /// Of decoded positions from the lattice, over the leaves whose integers are certain.
    pub(super) deviation: Deviation,
}

impl Scan<'_> {
    /// Visits every leaf.
    ///
    /// # Errors
    /// The operating system could not read.
    pub(super) fn run(&self) -> Result<Scanned, ReadError> {
        let done = AtomicU64::new(0);
        let ends: Mutex<HashMap<u32, Ends>> = Mutex::default();
        let leaves: Vec<u32> = self.tree.leaves().map(|l| l.0).filter(|l| self.readable[*l as usize]).collect();
        let visits = leaves.par_iter().map_init(Points::default, |points, index| {
            let index = *index;
            let visit = self.visit(index, points, &ends)?;
            let count = points.len() as u64;
            let done = done.fetch_add(count, Relaxed) + count;
            (self.progress)(Progress { phase: "points", done, total: self.tree.header().points });
            Ok(visit)
        });
        let visits = visits.collect::<Result<Vec<_>, ReadError>>()?;
        let quality = self.quality(visits.iter().flatten().map(|(_, exactness)| exactness));
        let mut deviation = Deviation::default();
        visits.iter().flatten().for_each(|(_, exactness)| deviation.merge(&exactness.deviation));
        Ok(Scanned {
            deviation,
            summaries: self.by_node(leaves, visits),
            ends: ends.into_inner().unwrap_or_default(),
            quality,
        })
    }

    /// What is known of each node: of leaves what was found, of others nothing.
    fn by_node(&self, leaves: Vec<u32>, visits: Vec<Option<(Option<Summary>, Exactness)>>) -> Vec<Option<Summary>> {
        let mut summaries = vec![None; self.tree.nodes().len()];
        for (leaf, visit) in leaves.into_iter().zip(visits) {
            summaries[leaf as usize] = visit.and_then(|(summary, _)| summary);
        }
        summaries
    }

    /// Checks a leaf; nothing if it turns out not to be readable.
    fn visit(
        &self,
        index: u32,
        points: &mut Points,
        ends: &Mutex<HashMap<u32, Ends>>,
    ) -> Result<Option<(Option<Summary>, Exactness)>, ReadError> {
        let (tree, header) = (self.tree, self.tree.header());
        let Some(node) = tree.dataset.node(index) else { return Ok(None) };
        let NodeKind::Leaf { center, .. } = node.kind else { return Ok(None) };
        let place = tree.place(index);
        if let Err(error) = tree.dataset.read_leaf_bytes(index, &mut points.bytes) {
            if !matches!(error.kind(), ErrorKind::Broken) {
                return Err(error);
            }
            let expected = format!("{} points", node.count);
            self.findings.push(Finding::new(Check::LeafFiles, "leaf", expected, error.what()).at(place));
            return Ok(None);
        }
        let stride = header.record.stride();
        points.decode(stride, center, &header.lattice);
        let leaf = Leaf { place, bounds: &node.bounds, center, header, findings: self.findings };
        leaf.check_box(points);
        leaf.check_values(points);
        leaf.check_padding(points);
        if matches!(tree.parent(index).map(|p| p.1.kind), Some(NodeKind::Degenerate { .. }))
            && let Ok(mut ends) = ends.lock()
        {
            ends.insert(index, points.ends(stride));
        }
        let unknown = Exactness { certain: false, error: 0.0, bound: 0.0, deviation: Deviation::default() };
        let exactness = if self.lattice_known { leaf.check_positions(points) } else { unknown };
        let summary = if exactness.certain { Summary::of(&points.steps) } else { None };
        if let Some(summary) = &summary {
            leaf.check_center(summary);
            leaf.check_order(points, summary.min);
        }
        if let Some(sums) = self.sums {
            let filler = Filler::new(tree, sums.rules());
            sums.add(|block, sink| filler.fill(index, points, block, sink));
        }
        Ok(Some((summary, exactness)))
    }

    fn quality<'e>(&self, exactness: impl Iterator<Item = &'e Exactness>) -> LeafQuality {
        let mut quality = LeafQuality { depth: self.tree.deepest(), ..LeafQuality::default() };
        for (_, node) in self.tree.leaves() {
            let sides = [0, 1, 2].map(|a| node.bounds.max[a] - node.bounds.min[a]);
            quality.volume += sides[0] * sides[1] * sides[2];
            quality.points_min = if quality.leaves == 0 { node.count } else { quality.points_min.min(node.count) };
            quality.points_max = quality.points_max.max(node.count);
            quality.leaves += 1;
        }
        if quality.leaves > 0 {
            quality.points_mean = self.tree.header().points as f64 / quality.leaves as f64;
        }
        for exactness in exactness {
            quality.uncertain += u64::from(!exactness.certain);
            if exactness.certain {
                quality.largest_error = quality.largest_error.max(exactness.error);
                quality.largest_bound = quality.largest_bound.max(exactness.bound);
            }
        }
        quality
    }
}
