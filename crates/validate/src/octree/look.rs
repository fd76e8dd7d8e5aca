//! Looks at all nodes of an octree, as far as memory and the geometry allow, and judges what only all of them together show.

use std::path::Path;

use pointmill_format::ReadError;

use super::expect::Geometry;
use super::seams;
use super::spacing::Sampling;
use super::tree::Tree;
use super::walk::{Nodes, Task, Walked, walk};
use crate::check::Check;
use crate::finding::Findings;
use crate::memory::{Budget, on_threads};
use crate::options::{Options, ProgressFn};
use crate::outcome::LevelQuality;

/// Positions that neighbours ask for again; more of them hardly ever are.
const MAX_CACHE_BYTES: u64 = 512 << 20;

/// What to look at, and how.
pub(crate) struct Look<'a> {
    pub(crate) folder: &'a Path,
    pub(crate) nodes: &'a dyn Nodes,
    pub(crate) tree: &'a Tree,
    pub(crate) geometry: Geometry,
    pub(crate) sampling: Sampling,
    /// Why coverage is measured, but not judged: nodes that may not hold the whole sample leave holes.
    pub(crate) no_coverage: Option<&'static str>,
    /// Of the largest node in memory.
    pub(crate) node_bytes: u64,
    pub(crate) options: &'a Options,
    pub(crate) progress: &'a ProgressFn<'a>,
    pub(crate) findings: &'a Findings,
}

impl Look<'_> {
    /// Visits every node, with as many threads as memory allows.
    ///
    /// # Errors
    /// The operating system could not read, or a single node takes more memory than is left.
    pub(crate) fn at_all(&self, budget: &mut Budget) -> Result<Walked, ReadError> {
        let out_of_reach = self.out_of_reach();
        let neighbourhoods = out_of_reach.is_none();
        let around = if neighbourhoods { self.tree.surroundings_bytes() } else { 0 };
        let threads = budget.threads(self.node_bytes + around)?;
        let task = Task {
            nodes: self.nodes,
            tree: self.tree,
            geometry: self.geometry,
            findings: self.findings,
            neighbourhoods,
            sampling: self.sampling,
            promises_coverage: self.no_coverage.is_none(),
            progress: self.progress,
            cache_bytes: usize::try_from((budget.left() / 2).min(MAX_CACHE_BYTES)).unwrap_or(usize::MAX),
            max_problems: self.options.max_problems,
        };
        let walked = on_threads(threads, self.folder, || walk(&task))?;
        budget.give_back(threads as u64 * around);
        self.conclude(&walked, out_of_reach);
        Ok(walked)
    }

    /// Why spacing and coverage are not looked at, if they are not.
    fn out_of_reach(&self) -> Option<&'static str> {
        let deepest = self.tree.nodes.iter().map(|n| n.key.level).max().unwrap_or(0);
        match self.options.neighbourhoods {
            false => Some("not asked for"),
            true if !self.geometry.spacing_is_sane() => Some("the spacing is out of proportion"),
            true if !self.geometry.resolves(deepest) => {
                Some("the spacing is below the rounding of coordinates so large")
            }
            true => None,
        }
    }

    /// Judges seams, and notes what was not looked at.
    fn conclude(&self, walked: &Walked, out_of_reach: Option<&'static str>) {
        if let Some(why) = out_of_reach {
            [Check::Spacing, Check::Seams, Check::Coverage].into_iter().for_each(|c| self.findings.skip(c, why));
            return;
        }
        seams::check(&walked.tallies, self.sampling, self.findings);
        if let Some(why) = self.no_coverage {
            self.findings.skip(Check::Coverage, why);
        }
        if walked.unreadable > 0 {
            let why = format!("the points of {} nodes could not be read", walked.unreadable);
            self.findings.skip(Check::Coverage, why);
        }
    }

    /// Figures of all levels.
    pub(crate) fn quality(&self, walked: &Walked) -> Vec<LevelQuality> {
        let levels = walked.tallies.iter().zip(0..);
        let mut quality: Vec<_> = levels.map(|(t, level)| t.figures(level, self.geometry.spacing_at(level))).collect();
        for node in &self.tree.nodes {
            let level = &mut quality[usize::from(node.key.level)];
            level.nodes += 1;
            level.inner_nodes += u64::from(node.record.child_mask != 0);
            level.points += u64::from(node.record.points);
        }
        quality
    }
}
