//! Payload ranges: right size, aligned, disjoint, and together exactly `octree.bin`.

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::tree::{Tree, TreeNode};

/// Checks all ranges and marks the nodes whose payload may be read.
///
/// `record_len`: bytes per point if payloads are interleaved records (DEFAULT), else `None`.
pub(crate) fn check(tree: &mut Tree, file_size: u64, record_len: Option<u64>, findings: &Findings) {
    findings.checked(Check::PayloadRanges, tree.nodes.len() as u64);
    for node in &mut tree.nodes {
        node.readable = node_range(node, file_size, record_len, findings);
    }
    let mut ranges: Vec<_> = tree.nodes.iter().filter(|n| n.record.byte_size > 0).collect();
    ranges.sort_by_key(|n| (n.record.byte_offset, n.key));
    let mut covered = 0;
    for node in ranges {
        let start = node.record.byte_offset;
        if start > covered {
            gap(covered, start.min(file_size), findings);
        }
        if start < covered {
            let finding = Finding::new(
                Check::PayloadRanges,
                "start of the payload",
                format!("at least {covered}, where the one before ends"),
                start,
            );
            findings.push(finding.at(node.key));
        }
        covered = covered.max(start.saturating_add(node.record.byte_size));
    }
    gap(covered, file_size, findings);
}

fn gap(from: u64, to: u64, findings: &Findings) {
    if from < to {
        let found = format!("bytes {from} to {to} belong to no node");
        findings.push(Finding::new(Check::PayloadRanges, "unused bytes of octree.bin", "none", found));
    }
}

/// True if the payload lies in the file and may have the right size.
fn node_range(node: &TreeNode, file_size: u64, record_len: Option<u64>, findings: &Findings) -> bool {
    let record = &node.record;
    let blame = |subject: &'static str, expected: String, found: u64| {
        findings.push(Finding::new(Check::PayloadRanges, subject, expected, found).at(node.key));
        false
    };
    let points = u64::from(record.points);
    let end = record.byte_offset.saturating_add(record.byte_size);
    if end > file_size {
        return blame("end of the payload", format!("at most {file_size}, the size of octree.bin"), end);
    }
    match record_len {
        Some(len) if record.byte_size != points * len => {
            blame("byteSize", format!("{} for {points} points of {len} bytes", points * len), record.byte_size)
        }
        Some(len) if !record.byte_offset.is_multiple_of(len) => {
            // readable all the same, but renderers that derive point indices from offsets go astray
            blame("byteOffset", format!("a multiple of {len}"), record.byte_offset);
            true
        }
        None if points > 0 && record.byte_size == 0 => blame("byteSize", format!("the bytes of {points} points"), 0),
        None if points == 0 && record.byte_size > 0 => blame("byteSize", "0 for no points".into(), record.byte_size),
        _ => true,
    }
}
