//! Doubled planes: neighbouring inner nodes that were sampled as if they were alone, along a surface that lies on the
//! plane between them.

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::quality::Tally;
use crate::octree::spacing::Sampling;

/// So many points of a level may have one of another node nearer than the spacing, however few the level has.
const FEW: u64 = 8;

/// One of so many points of a level may, if that is more.
const ONE_IN: u64 = 1000;

/// Counts what the walk found at the borders of nodes, by level. Only pointmill promises anything about them.
pub(crate) fn check(tallies: &[Tally], sampling: Sampling, findings: &Findings) {
    if sampling == Sampling::Unknown {
        findings.skip(Check::Seams, "the dataset does not state its sampling");
        return;
    }
    for (level, tally) in tallies.iter().enumerate() {
        let sampled = tally.sampled();
        findings.checked(Check::Seams, sampled);
        let (found, allowed) = (tally.seam_faults(), FEW.max(sampled / ONE_IN));
        if found > allowed {
            let subject = format!("points of level {level} nearer than the spacing to one of another inner node");
            findings.push(Finding::new(Check::Seams, subject, format!("at most {allowed}"), found).points(found));
        }
    }
}

#[cfg(test)]
mod tests {
    use pointmill_format::DatasetKind;

    use super::*;
    use crate::octree::grid::Nearest;
    use crate::octree::quality::NodeFigures;

    /// Findings about a level of nodes of 100 points, a number of which are half a spacing from what `near` says.
    fn found(nodes: usize, close: usize, near: Nearest) -> u64 {
        let tally = Tally::default();
        let far = Nearest { own: 4.0, neighbour: f64::INFINITY, lone: f64::INFINITY };
        for node in 0..nodes {
            let mut figures = NodeFigures::new(100);
            for point in node * 100..(node + 1) * 100 {
                figures.add(if point < close { &near } else { &far }, 1.0, 1.0);
            }
            tally.add_node(&figures);
        }
        judge(tally)
    }

    fn judge(tally: Tally) -> u64 {
        let findings = Findings::new(DatasetKind::Potree2, 20);
        check(&[tally], Sampling::Poisson, &findings);
        let (checks, _) = findings.finish();
        checks.iter().find(|c| c.name == Check::Seams).map(|c| c.found).unwrap()
    }

    #[test]
    fn eight_points_or_one_of_a_thousand_are_allowed() {
        let near = Nearest { own: 4.0, neighbour: 0.25, lone: f64::INFINITY };
        for (nodes, allowed) in [(1, 8), (80, 8), (90, 9), (200, 20)] {
            assert_eq!(found(nodes, allowed, near), 0, "{nodes} nodes");
            assert_eq!(found(nodes, allowed + 1, near), 1, "{nodes} nodes");
        }
    }

    #[test]
    fn the_only_point_of_a_node_is_no_seam() {
        let near = Nearest { own: 4.0, neighbour: f64::INFINITY, lone: 0.25 };
        assert_eq!(found(10, 500, near), 0, "near the only point of another node");
        let tally = Tally::default();
        for _ in 0..500 {
            let mut figures = NodeFigures::new(1);
            figures.add(&Nearest { own: f64::INFINITY, neighbour: 0.25, lone: f64::INFINITY }, 1.0, 1.0);
            tally.add_node(&figures);
        }
        assert_eq!(tally.figures(0, 1.0).close_across, 500, "the figures have it");
        assert_eq!(judge(tally), 0, "the only point of this node");
    }
}
