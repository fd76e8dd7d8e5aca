//! No holes: whatever the level at which a viewer stops, something is drawn near every point of the cloud.
//!
//! The only point of an inner node is exempt. Where points lie farther apart than the spacing, an inner node would hand
//! all of its points to its parent; but nodes must not be empty, so it keeps one, which is then missing above.

use pointmill_format::NodeKey;
use serde_json::json;

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::expect::Geometry;
use crate::octree::grid::{Grid, square};
use crate::octree::quality::Tally;
use crate::octree::spacing::Sampling;

/// How far a point may be from the nearest one drawn at any level above it, in spacings of that level; one lattice step is
/// allowed on top where nothing more precise is promised.
const LIMIT: f64 = 2.0;

/// How far a point may be from the sample of the node above it where the dataset promises a maximal Poisson-disk sample,
/// in spacings.
const SAMPLED: f64 = 1.00002;

/// Holes are measured up to this many spacings; wider ones count as this.
pub(crate) const REACH: f64 = 4.0;

/// Side of a grid cell that lets a search look at nothing but a cell and those around it.
pub(crate) fn cell_side(geometry: &Geometry, level: u8) -> f64 {
    LIMIT * geometry.spacing_at(level) + geometry.step()
}

/// How far a point of a node of level `of` may be from the nearest one drawn at `level`, which is coarser, world units.
///
/// A point that a sample omitted is near one that it took; of that one's place in the sample above the same is true. So
/// the distances of a point to ever coarser levels are sums of spacings, each twice the one before.
pub(crate) fn limit(geometry: &Geometry, sampling: Sampling, level: u8, of: u8) -> f64 {
    let most = cell_side(geometry, level);
    if sampling != Sampling::Poisson {
        return most;
    }
    let steps = f64::from(of.saturating_sub(level));
    let spacings = 2.0 - (1.0 - steps).exp2();
    (SAMPLED * spacings * geometry.spacing_at(level) + steps * geometry.sampling_slack()).min(most)
}

/// What is drawn at a level.
pub(crate) struct Drawn<'a> {
    pub(crate) level: u8,
    /// See [`limit`], world units.
    pub(crate) limit: f64,
    /// The points of levels up to it, within [`REACH`] spacings around an ancestor of the node that is checked.
    pub(crate) grid: &'a Grid,
}

/// Checks the points of node `key` against what is drawn at a level coarser than the node.
pub(crate) fn check(
    key: NodeKey,
    positions: &[[i32; 3]],
    drawn: &Drawn<'_>,
    geometry: &Geometry,
    tally: &Tally,
    findings: &Findings,
) {
    let Drawn { level, limit, grid } = *drawn;
    findings.checked(Check::Coverage, positions.len() as u64);
    let spacing = geometry.spacing_at(level);
    let (limit_squared, spacing_squared) = (square(limit), square(spacing));
    let mut widest = tally.hole_squared();
    let (mut within_1, mut within_1_5, mut uncovered, mut worst) = (0, 0, 0, 0.0);
    for &position in positions {
        // Points nearer than the widest hole so far change nothing else; most are settled by the first site looked at.
        if grid.any_within(position, spacing_squared.min(widest)) {
            within_1 += 1;
            within_1_5 += 1;
            continue;
        }
        let distance = grid.nearest_squared(position, 2).min(square(REACH * spacing));
        within_1 += u64::from(distance <= spacing_squared);
        within_1_5 += u64::from(distance <= square(1.5) * spacing_squared);
        widest = widest.max(distance);
        if distance > limit_squared {
            uncovered += 1;
            worst = f64::max(worst, distance);
        }
    }
    tally.widen_hole(widest);
    tally.add_below(positions.len() as u64, within_1, within_1_5, key.level == level + 1);
    if uncovered > 0 {
        let subject = format!("distance to the nearest point drawn at levels up to {level}");
        let expected = json!(limit);
        let finding = Finding::new(Check::Coverage, subject, expected, json!(worst.sqrt()));
        findings.push(finding.at(key).points(uncovered));
    }
}
