//! Types, counts and depth in the records of the hierarchy.

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::tree::Tree;

/// Types, empty nodes, depth and the sum of points. `points` and `depth` are from the metadata.
pub(crate) fn check(tree: &Tree, points: u64, depth: u32, findings: &Findings) {
    let nodes = tree.nodes.len() as u64;
    findings.checked(Check::NodeTypes, nodes);
    findings.checked(Check::EmptyNodes, nodes);
    findings.checked(Check::Depth, nodes);
    findings.checked(Check::PointCount, nodes);
    for node in &tree.nodes {
        let expected = if node.record.child_mask == 0 { 1 } else { 0 };
        // other values were reported with the chunk
        if node.record.node_type <= 2 && node.record.node_type != expected {
            let finding = Finding::new(Check::NodeTypes, "type", expected, node.record.node_type);
            findings.push(finding.at(node.key));
        }
        if node.record.points == 0 {
            findings.push(Finding::new(Check::EmptyNodes, "numPoints", "at least 1", 0).at(node.key));
        }
    }
    let deepest = tree.nodes.iter().map(|n| u32::from(n.key.level)).max().unwrap_or(0);
    if deepest != depth {
        findings.push(Finding::new(Check::Depth, "hierarchy.depth", deepest, depth));
    }
    let sum: u64 = tree.nodes.iter().map(|n| u64::from(n.record.points)).sum();
    if sum != points {
        findings.push(Finding::new(Check::PointCount, "points", sum, points));
    }
}
