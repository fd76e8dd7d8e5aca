//! One pass over all points: depth first, every node decoded once, the coarser points around it kept at hand.
//!
//! A node's points are checked alone (box, order, ranges, checksum) and against a [`Grid`] for each of its ancestors:
//! the points drawn at that level and above, in the ancestor's box and a little around it. The grids live on the
//! stack of the walk, so memory is bounded by depth × threads × points of inner nodes. Points beyond a node's border
//! come from its neighbours of the same level, through a cache of limited size, and from the parent's grid.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

use pointmill_format::{ErrorKind, NodeKey, NodePoints, ReadError};
use rayon::prelude::*;

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::cache::{Cache, Positions};
use crate::octree::expect::Geometry;
use crate::octree::grid::{Grid, Origin, Site};
use crate::octree::quality::Tally;
use crate::octree::spacing::Sampling;
use crate::octree::tree::{Tree, TreeNode};
use crate::octree::{coverage, spacing};
use crate::options::{Progress, ProgressFn};

/// The nodes of a dataset, as its format has them.
pub(crate) trait Nodes: Sync {
    /// Reads the points of a node.
    ///
    /// # Errors
    /// Points that are not there, or not as their format wants them.
    fn read(&self, node: &TreeNode, points: &mut NodePoints) -> Result<(), ReadError>;

    /// Where points that [`Self::read`] gave are on [`Geometry::lattice`].
    fn positions(&self, node: &TreeNode, points: &NodePoints) -> Vec<[i32; 3]>;

    /// Checks what needs no other node, of the points that [`Self::read`] gave for node `index`. True if all of them are in
    /// the node's box.
    fn check(&self, index: usize, node: &TreeNode, points: &NodePoints) -> bool;
}

/// What to walk over, and how.
pub(crate) struct Task<'a> {
    pub(crate) nodes: &'a dyn Nodes,
    pub(crate) tree: &'a Tree,
    pub(crate) geometry: Geometry,
    pub(crate) findings: &'a Findings,
    /// Check spacing and coverage, and measure quality.
    pub(crate) neighbourhoods: bool,
    pub(crate) sampling: Sampling,
    /// Points far from all that is drawn are a fault.
    pub(crate) promises_coverage: bool,
    pub(crate) progress: &'a ProgressFn<'a>,
    pub(crate) cache_bytes: usize,
    pub(crate) max_problems: usize,
}

/// What the walk found beside the findings that it pushed.
pub(crate) struct Walked {
    /// By level.
    pub(crate) tallies: Vec<Tally>,
    /// Nodes whose points could not be read.
    pub(crate) unreadable: u64,
    /// Threads that had room to read nodes.
    pub(crate) threads: usize,
}

/// Visits every node.
///
/// # Errors
/// The operating system could not read; broken payloads are findings.
pub(crate) fn walk(task: &Task<'_>) -> Result<Walked, ReadError> {
    let levels = task.tree.nodes.iter().map(|n| usize::from(n.key.level) + 1).max().unwrap_or(0);
    let walk = Walk {
        task,
        total: task.tree.nodes.iter().map(|n| u64::from(n.record.points)).sum(),
        cache: Cache::new(task.cache_bytes),
        scratch: Mutex::default(),
        tallies: (0..levels).map(|_| Tally::default()).collect(),
        pairs: Findings::new(task.findings.format(), task.max_problems),
        cells: Findings::new(task.findings.format(), task.max_problems),
        unreadable: AtomicU64::new(0),
        done: AtomicU64::new(0),
        stop: AtomicBool::new(false),
        failure: Mutex::default(),
    };
    if !task.tree.nodes.is_empty() {
        walk.visit(0, None);
    }
    if let Some(error) = walk.failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(error);
    }
    let kept = match task.sampling {
        Sampling::Poisson => walk.pairs,
        Sampling::Cells => walk.cells,
        // the rule that is broken less is the one that was meant
        Sampling::Unknown if walk.cells.found(Check::Spacing) == 0 => walk.cells,
        Sampling::Unknown => walk.pairs,
    };
    task.findings.absorb(Check::Spacing, &kept);
    Ok(Walked {
        tallies: walk.tallies,
        unreadable: walk.unreadable.into_inner(),
        threads: rayon::current_num_threads(),
    })
}

struct Walk<'a> {
    task: &'a Task<'a>,
    total: u64,
    cache: Cache,
    scratch: Mutex<Vec<NodePoints>>,
    tallies: Vec<Tally>,
    /// Findings for both sampling rules, until it is known which one applies.
    pairs: Findings,
    cells: Findings,
    unreadable: AtomicU64,
    done: AtomicU64,
    stop: AtomicBool,
    failure: Mutex<Option<ReadError>>,
}

/// The grids of a node's ancestors, deepest first.
struct Above<'a> {
    level: u8,
    grid: &'a Grid,
    up: Option<&'a Above<'a>>,
}

impl Walk<'_> {
    fn visit(&self, index: usize, above: Option<&Above<'_>>) {
        if self.stop.load(Relaxed) {
            return;
        }
        let node = &self.task.tree.nodes[index];
        let positions = self.check_alone(index);
        let children = self.task.tree.children(node);
        if !self.task.neighbourhoods {
            children.into_par_iter().for_each(|child| self.visit(child, None));
            return;
        }
        // An inner node keeps one point even where its parent would have taken all: no node is empty.
        let kept_for_form = !children.is_empty() && node.record.points == 1;
        if let (Some(positions), false) = (&positions, kept_for_form) {
            self.check_coverage(node, positions, above);
        }
        if children.is_empty() {
            return;
        }
        let grid = self.surroundings(index, positions.as_ref(), above);
        if let Some(positions) = &positions {
            self.check_sampling(node, positions, &grid);
        }
        drop(positions);
        let here = Above { level: node.key.level, grid: &grid, up: above };
        children.into_par_iter().for_each(|child| self.visit(child, Some(&here)));
    }

    /// Decodes a node and checks what needs no other node. Returns its positions if neighbours matter.
    fn check_alone(&self, index: usize) -> Option<Positions> {
        let task = self.task;
        let node = &task.tree.nodes[index];
        let checked = self.with_points(node, |points| {
            task.findings.checked(Check::Payloads, 1);
            let all_inside = task.nodes.check(index, node, points);
            task.neighbourhoods.then(|| {
                let mut positions = task.nodes.positions(node, points);
                if !all_inside {
                    // a stray point has its finding; judged by the neighbourhood of this node it would get more
                    let limits = task.geometry.node_limits(node.key);
                    let inside = |p: &[i32; 3]| (0..3).all(|a| (limits[a].0..=limits[a].1).contains(&i64::from(p[a])));
                    positions.retain(inside);
                }
                Arc::new(positions)
            })
        });
        let done = self.done.fetch_add(u64::from(node.record.points), Relaxed) + u64::from(node.record.points);
        (task.progress)(Progress { phase: "points", done, total: self.total });
        match checked {
            Ok(positions) => {
                let positions = positions?;
                self.cache.put(index, positions.clone());
                Some(positions)
            }
            Err(error) => {
                self.unreadable.fetch_add(1, Relaxed);
                self.blame(node, error);
                None
            }
        }
    }

    /// A broken payload is a finding, a disk that does not answer ends the walk.
    fn blame(&self, node: &TreeNode, error: Option<ReadError>) {
        let Some(error) = error else { return };
        if !matches!(error.kind(), ErrorKind::Broken) {
            self.stop.store(true, Relaxed);
            self.failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        } else {
            let expected = format!("{} points", node.record.points);
            self.task.findings.push(Finding::new(Check::Payloads, "payload", expected, error.what()).at(node.key));
        }
    }

    /// Lends the decoded points of a node. An error without a cause: the payload's range is unsound, which was
    /// reported with the ranges.
    fn with_points<T>(&self, node: &TreeNode, work: impl FnOnce(&NodePoints) -> T) -> Result<T, Option<ReadError>> {
        if !node.readable {
            return Err(None);
        }
        let pop = self.scratch.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut points = pop.unwrap_or_default();
        let read = self.task.nodes.read(node, &mut points);
        let result = read.map(|()| work(&points)).map_err(Some);
        self.scratch.lock().unwrap_or_else(PoisonError::into_inner).push(points);
        result
    }

    /// Positions of a neighbour, decoded again if they are not at hand. Its faults are reported on its own visit.
    fn positions(&self, index: usize) -> Option<Positions> {
        if let Some(positions) = self.cache.get(index) {
            return Some(positions);
        }
        let node = &self.task.tree.nodes[index];
        let positions = Arc::new(self.with_points(node, |points| self.task.nodes.positions(node, points)).ok()?);
        self.cache.put(index, positions.clone());
        Some(positions)
    }

    fn check_coverage(&self, node: &TreeNode, positions: &[[i32; 3]], above: Option<&Above<'_>>) {
        // The only point of a leaf may come from any level below: a node whose children are all gone took it back.
        let of = if node.record.points == 1 { NodeKey::MAX_LEVEL } else { node.key.level };
        let mut next = above;
        while let Some(Above { level, grid, up }) = next {
            let tally = &self.tallies[usize::from(*level)];
            let limit = match self.task.promises_coverage {
                true => coverage::limit(&self.task.geometry, self.task.sampling, *level, of),
                false => f64::INFINITY,
            };
            let drawn = coverage::Drawn { level: *level, limit, grid };
            coverage::check(node.key, positions, &drawn, &self.task.geometry, tally, self.task.findings);
            next = *up;
        }
    }

    fn check_sampling(&self, node: &TreeNode, positions: &[[i32; 3]], grid: &Grid) {
        let tally = &self.tallies[usize::from(node.key.level)];
        spacing::pairs(node.key, grid, self.task.sampling, &self.task.geometry, tally, &self.pairs);
        if self.task.sampling != Sampling::Poisson {
            spacing::cells(node.key, positions, &self.task.geometry, &self.cells);
        }
    }

    /// The points drawn at the node's level and above, in its box and [`coverage::REACH`] spacings around it.
    fn surroundings(&self, index: usize, own: Option<&Positions>, above: Option<&Above<'_>>) -> Grid {
        let Task { tree, geometry, .. } = self.task;
        let key = tree.nodes[index].key;
        let limits = geometry.around(key, coverage::REACH * geometry.spacing_at(key.level));
        let near = |p: &[i32; 3]| (0..3).all(|axis| (limits[axis].0..=limits[axis].1).contains(&i64::from(p[axis])));
        let mut sites: Vec<Site> = Vec::new();
        if let Some(own) = own {
            sites.extend(own.iter().map(|p| Site { position: *p, origin: Origin::Own }));
        }
        if let Some(above) = above {
            let coarser = above.grid.sites().iter().filter(|s| near(&s.position));
            sites.extend(coarser.map(|s| Site { origin: Origin::Other, ..*s }));
        }
        for neighbour in tree.neighbours(key) {
            let origin = match tree.nodes[neighbour].record {
                record if record.child_mask == 0 => Origin::Other,
                record if record.points == 1 => Origin::Lone,
                _ => Origin::Neighbour,
            };
            let Some(positions) = self.positions(neighbour) else { continue };
            sites.extend(positions.iter().filter(|p| near(p)).map(|p| Site { position: *p, origin }));
        }
        Grid::new(&sites, coverage::cell_side(geometry, key.level), &geometry.lattice)
    }
}
