//! Axis and plane of every inner node, recomputed from the exact sums of the points below.

use pointmill_format::bintree::{Node, NodeKind, SplitRule};

use super::summary::Summary;
use super::tree::{AXES, Tree};
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// From this depth on planes are medians, whatever the rule.
const MEDIAN_DEPTH: usize = 64;

/// An inner node that is split, with what is known of its sides.
struct Split<'a> {
    tree: &'a Tree<'a>,
    index: u32,
    axis: usize,
    /// As stored.
    plane: f64,
    low: &'a Summary,
    high: &'a Summary,
}

/// Fills in the summaries of inner nodes, where those of all leaves below are known, and checks their splits.
pub(super) fn check(tree: &Tree<'_>, mut summaries: Vec<Option<Summary>>, findings: &Findings) -> Vec<Option<Summary>> {
    // children stand behind their parents
    for (index, Node { kind, .. }) in tree.indexed().rev() {
        let Some([(low, _), (high, _)]) = tree.children(index) else { continue };
        let (Some(low), Some(high)) = (summaries[low as usize], summaries[high as usize]) else { continue };
        let all = low.union(&high);
        summaries[index as usize] = Some(all);
        let NodeKind::Inner { axis, split: plane, .. } = *kind else { continue };
        if all.is_one_place() {
            continue; // has its finding with the degenerate nodes
        }
        let split = Split { tree, index, axis: usize::from(axis), plane, low: &low, high: &high };
        split.check_axis(&all, findings);
        split.check_sides(findings);
        split.check_plane(&all, findings);
    }
    summaries
}

impl Split<'_> {
    fn check_axis(&self, all: &Summary, findings: &Findings) {
        findings.checked(Check::SplitAxis, 1);
        let (longest, extents) = all.longest_axis(self.tree.header().lattice.scale);
        if longest != self.axis {
            let extent_of = |axis: usize| format!("{} ({})", AXES[axis], extents[axis]);
            let finding = Finding::new(Check::SplitAxis, "axis", extent_of(longest), extent_of(self.axis));
            findings.push(finding.at(self.tree.place(self.index)).points(all.count));
        }
    }

    /// The low side is at the plane or below, the high side above.
    fn check_sides(&self, findings: &Findings) {
        findings.checked(Check::Sides, 1);
        let place = self.tree.place(self.index);
        let m = self.tree.header().lattice.quantize(self.axis, self.plane);
        let (low, high) = (self.low.max[self.axis], self.high.min[self.axis]);
        if low > m {
            let (expected, found) = (format!("at most {}", self.plane), self.world(low.into()));
            let finding = Finding::new(Check::Sides, format!("{} of the low side", AXES[self.axis]), expected, found);
            findings.push(finding.at(place));
        }
        if high <= m {
            let (expected, found) = (format!("above {}", self.plane), self.world(high.into()));
            let finding = Finding::new(Check::Sides, format!("{} of the high side", AXES[self.axis]), expected, found);
            findings.push(finding.at(place));
        }
    }

    /// The plane is where the rule puts it.
    fn check_plane(&self, all: &Summary, findings: &Findings) {
        let axis = self.axis;
        let deep = self.tree.depth(self.index) >= MEDIAN_DEPTH;
        let (rule, m) = match self.tree.header().split {
            SplitRule::Mean if !deep => ("mean", all.sum[axis].div_euclid(i128::from(all.count))),
            SplitRule::Midpoint if !deep => {
                ("midpoint", (i128::from(all.min[axis]) + i128::from(all.max[axis])).div_euclid(2))
            }
            _ => return self.check_median(all, findings),
        };
        findings.checked(Check::Split, 1);
        let expected = self.world(m);
        if expected != self.plane {
            self.report(rule, expected, findings);
        }
    }

    /// The sides decide whether the plane is the median: the largest value of the low side has to be the one at the
    /// median's rank, or the largest below a maximum at that rank. Points on the wrong side, which have their finding,
    /// make this unanswerable.
    fn check_median(&self, all: &Summary, findings: &Findings) {
        let (axis, low, high) = (self.axis, self.low, self.high);
        if low.max[axis] >= high.min[axis] {
            return;
        }
        findings.checked(Check::Split, 1);
        // all points of the low side's largest coordinate are there, so they have these ranks
        let ranks = low.count - low.at_max[axis]..low.count;
        let median = (all.count - 1) / 2;
        let is_below_maximum = high.min[axis] == high.max[axis] && median >= low.count;
        let plane = self.world(low.max[axis].into());
        if !ranks.contains(&median) && !is_below_maximum {
            let expected = format!("the value at rank {median}");
            let found = format!("{}, at the ranks {} to {}", self.plane, ranks.start, ranks.end - 1);
            let finding = Finding::new(Check::Split, "median", expected, found);
            findings.push(finding.at(self.tree.place(self.index)).points(all.count));
        } else if plane != self.plane {
            self.report("median", plane, findings);
        }
    }

    fn report(&self, rule: &'static str, expected: f64, findings: &Findings) {
        let finding = Finding::new(Check::Split, rule, expected, self.plane);
        findings.push(finding.at(self.tree.place(self.index)).points(self.low.count + self.high.count));
    }

    fn world(&self, step: i128) -> f64 {
        let lattice = self.tree.header().lattice;
        step as f64 * lattice.scale[self.axis] + lattice.offset[self.axis]
    }
}
