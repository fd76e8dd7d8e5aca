//! Points of one place, more than a leaf may have: cut by number (§6.4 of the page).

use std::collections::HashMap;

use pointmill_format::bintree::NodeKind;

use super::scan::Ends;
use super::summary::Summary;
use super::tree::Tree;
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// A run of the runs that a place's points are cut into.
#[derive(Debug, Clone, Copy)]
struct Runs {
    /// Points of the place, and the runs that they make.
    points: u64,
    of: u64,
    /// Those at and below a node.
    first: u64,
    count: u64,
}

impl Runs {
    /// Points of the `first` run: larger ones come first.
    fn expected(&self) -> u64 {
        self.points / self.of + u64::from(self.first < self.points % self.of)
    }

    /// Of the two children.
    fn split(self) -> [Self; 2] {
        let low = self.count.div_ceil(2);
        [Self { count: low, ..self }, Self { first: self.first + low, count: self.count - low, ..self }]
    }
}

/// Nodes are degenerate exactly if they have to be, and cut as the page requires. `summaries`: of all nodes whose points are
/// known.
pub(super) fn check(tree: &Tree<'_>, summaries: &[Option<Summary>], ends: &HashMap<u32, Ends>, findings: &Findings) {
    let mut runs: HashMap<u32, Runs> = HashMap::new();
    // the last record of the leaf before, with the place's first leaf
    let mut before: Option<&Ends> = None;
    for (index, node) in tree.indexed() {
        let report = |subject: &'static str, expected: String, found: String| {
            let finding = Finding::new(Check::Degenerate, subject, expected, found);
            findings.push(finding.at(tree.place(index)).points(node.count));
        };
        let is_degenerate = matches!(node.kind, NodeKind::Degenerate { .. });
        if let Some(summary) = summaries[index as usize].filter(|_| !node.is_leaf()) {
            findings.checked(Check::Degenerate, 1);
            let words = |one_place: bool| if one_place { "one place" } else { "several places" };
            if summary.is_one_place() != is_degenerate {
                let kind = if is_degenerate { "cut by number" } else { "split by a plane" };
                report(
                    "points of a node",
                    format!("{}, as it is {kind}", words(is_degenerate)),
                    words(!is_degenerate).into(),
                );
            }
        }
        let given = runs.remove(&index);
        let own = match given {
            None if is_degenerate => {
                let of = node.count.div_ceil(tree.header().capacity.max(1)).max(1);
                before = None;
                Runs { points: node.count, of, first: 0, count: of }
            }
            None => continue,
            Some(given) => given,
        };
        let as_cut = is_degenerate == (own.count > 1) && (is_degenerate || node.is_leaf());
        if !as_cut {
            let found = if is_degenerate { "a node that is cut further" } else { "a leaf" };
            let found = if as_cut || is_degenerate || node.is_leaf() { found } else { "a node that is split" };
            report("cut by number", format!("{} leaves", own.count), found.into());
        } else if is_degenerate {
            for (child, runs_of_child) in tree.dataset.children(index).into_iter().flatten().zip(own.split()) {
                runs.insert(child, runs_of_child);
            }
        } else {
            if node.count != own.expected() {
                report("points of a run", own.expected().to_string(), node.count.to_string());
            }
            let these = ends.get(&index);
            if let (Some([_, last]), Some([first, _])) = (before, these)
                && last > first
            {
                report("order of runs", "ascending".into(), "begins below the end of the run before".into());
            }
            before = these;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_balanced_and_larger_ones_first() {
        let all = Runs { points: 17, of: 5, first: 0, count: 5 };
        let mut left = vec![all];
        let mut leaves = Vec::new();
        while let Some(runs) = left.pop() {
            match runs.count {
                1 => leaves.push(runs.expected()),
                _ => left.extend(runs.split().into_iter().rev()),
            }
        }
        assert_eq!(leaves, [4, 4, 3, 3, 3]);
        assert_eq!(all.split().map(|r| r.count), [3, 2]);
    }
}
