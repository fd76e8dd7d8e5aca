//! No holes: whatever the level at which a viewer stops, something is drawn near every point of the cloud.
//!
//! The only point of an inner node is exempt. Where points lie farther apart than the spacing, an inner node would hand
//! all of its points to its parent; but nodes must not be empty, so it keeps one, which is then missing above.

use pointmill_format::NodeKey;
use serde_json::json;

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::potree2::expect::Geometry;
use crate::potree2::grid::{Grid, square};
use crate::potree2::quality::Tally;

/// How far a point may be from the nearest one drawn, in spacings of the level; one lattice step is allowed on top.
pub(crate) const LIMIT: f64 = 2.0;

/// Holes are measured up to this many spacings; wider ones count as this.
pub(crate) const REACH: f64 = 4.0;

/// Side of a grid cell that lets a search look at nothing but a cell and those around it.
pub(crate) fn cell_side(geometry: &Geometry, level: u8) -> f64 {
    LIMIT * geometry.spacing_at(level) + geometry.step()
}

/// Checks the points of node `key` against what is drawn at `level` (coarser than the node): `drawn` holds the points
/// of levels up to it, within [`REACH`] spacings around the node's ancestor.
pub(crate) fn check(
    key: NodeKey,
    positions: &[[i32; 3]],
    level: u8,
    drawn: &Grid,
    geometry: &Geometry,
    tally: &Tally,
    findings: &Findings,
) {
    findings.checked(Check::Coverage, positions.len() as u64);
    let spacing = geometry.spacing_at(level);
    let limit_squared = square(cell_side(geometry, level));
    let mut widest = tally.hole_squared();
    let (mut uncovered, mut worst) = (0, 0.0);
    for &position in positions {
        // Points nearer than the widest hole so far change nothing; most are settled by the first site looked at.
        if drawn.any_within(position, widest.min(limit_squared)) {
            continue;
        }
        let distance = drawn.nearest_squared(position, 2).min(square(REACH * spacing));
        widest = widest.max(distance);
        if distance > limit_squared {
            uncovered += 1;
            worst = f64::max(worst, distance);
        }
    }
    tally.widen_hole(widest);
    if uncovered > 0 {
        let subject = format!("distance to the nearest point drawn at levels up to {level}");
        let expected = json!(LIMIT * spacing);
        let finding = Finding::new(Check::Coverage, subject, expected, json!(worst.sqrt()));
        findings.push(finding.at(key).points(uncovered));
    }
}
