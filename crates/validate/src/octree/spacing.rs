//! Sampling of inner nodes: no pair closer than the spacing, or at most one point a cell.

use pointmill_format::NodeKey;
use serde_json::json;

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::expect::Geometry;
use crate::octree::grid::{Grid, Origin, square};
use crate::octree::quality::{NodeFigures, Tally};

/// How inner nodes are sampled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sampling {
    /// No two points of a node closer than the spacing of its level.
    Poisson,
    /// At most one point in each cell of the node's grid (grid and random sampling).
    Cells,
    /// Not stated in the dataset: one of the two, throughout.
    Unknown,
}

impl Sampling {
    /// Reads the word that pointmill leaves in the metadata.
    pub(crate) fn from_word(word: Option<&str>) -> Self {
        match word {
            Some("poisson") => Self::Poisson,
            Some("grid" | "random") => Self::Cells,
            _ => Self::Unknown,
        }
    }
}

/// How far the nearest neighbour inside the node is looked for, in cells of two spacings.
const RINGS: i32 = 4;

impl Sampling {
    /// The square of the least distance that two points of an inner node may have. A dataset that does not state its rule
    /// may have compared rounded positions.
    fn allowed_squared(self, spacing: f64, geometry: &Geometry) -> f64 {
        let slack = if self == Self::Unknown { geometry.rounding } else { geometry.sampling_slack() };
        // squares of doubles are off by a few of their last bits
        square((spacing - slack).max(0.0)) * (1.0 - 1e-12)
    }
}

/// Measures the nearest neighbour of each point of an inner node, within the node and across its borders, and reports
/// pairs closer than the spacing.
pub(crate) fn pairs(
    key: NodeKey,
    grid: &Grid,
    sampling: Sampling,
    geometry: &Geometry,
    tally: &Tally,
    findings: &Findings,
) {
    let spacing = geometry.spacing_at(key.level);
    let allowed_squared = sampling.allowed_squared(spacing, geometry);
    let (mut close, mut closest, mut looked_at) = (0, f64::INFINITY, 0);
    let own = || grid.sites().iter().enumerate().filter(|(_, s)| s.origin == Origin::Own);
    let mut node = NodeFigures::new(own().count());
    for (i, _) in own() {
        let nearest = grid.nearest_by_origin(i, RINGS);
        looked_at += 1;
        tally.add_nearest(node.add(&nearest, spacing, allowed_squared));
        if nearest.own < allowed_squared {
            close += 1;
            closest = f64::min(closest, nearest.own.sqrt());
        }
    }
    tally.add_node(&node);
    findings.checked(Check::Spacing, looked_at);
    if close > 0 {
        let expected = json!(spacing);
        let finding = Finding::new(Check::Spacing, "distance of the nearest pair", expected, json!(closest));
        findings.push(finding.at(key).points(close));
    }
}

/// Reports cells of an inner node's grid that hold more than one point.
pub(crate) fn cells(key: NodeKey, positions: &[[i32; 3]], geometry: &Geometry, findings: &Findings) {
    findings.checked(Check::Spacing, positions.len() as u64);
    let node = geometry.node_box(key);
    let mut cells: Vec<u64> = positions.iter().filter_map(|p| geometry.sample_cell(key.level, &node, *p)).collect();
    cells.sort_unstable();
    let surplus = cells.windows(2).filter(|w| w[0] == w[1]).count() as u64;
    if surplus > 0 {
        let fullest = cells.chunk_by(|a, b| a == b).map(<[u64]>::len).max();
        let finding = Finding::new(Check::Spacing, "points of a cell of the grid", 1, fullest);
        findings.push(finding.at(key).points(surplus));
    }
}
