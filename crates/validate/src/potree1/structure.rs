//! The nodes of the index against the files that are there.

use std::collections::HashSet;

use pointmill_format::NodeKey;
use pointmill_format::potree1::{Dataset, NodeFiles};
use pointmill_format::potree2::NodeRecord;
use pointmill_format::{ErrorKind, ReadError};

use super::files::Files;
use super::index::Indexed;
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::tree::{Tree, TreeNode};

/// Makes a tree of the nodes, each with the points that its file holds.
///
/// # Errors
/// The operating system could not read a file.
pub(crate) fn tree(
    indexed: &[Indexed],
    files: &Files,
    dataset: &Dataset,
    findings: &Findings,
) -> Result<Tree, ReadError> {
    let mut nodes = Vec::with_capacity(indexed.len());
    for node in indexed {
        nodes.push(tree_node(node, files, dataset, findings)?);
    }
    strays(indexed, files, findings);
    let sum: u64 = nodes.iter().map(|n| u64::from(n.record.points)).sum();
    findings.checked(Check::PointCount, nodes.len() as u64);
    match dataset.metadata().points {
        Some(points) if points != sum => findings.push(Finding::new(Check::PointCount, "points", sum, points)),
        Some(_) => {}
        None => findings.skip(Check::PointCount, "cloud.js does not state points"),
    }
    Ok(Tree::new(nodes))
}

fn tree_node(node: &Indexed, files: &Files, dataset: &Dataset, findings: &Findings) -> Result<TreeNode, ReadError> {
    let Indexed { key, record, index_bytes } = *node;
    let blame = |check, subject: &'static str, expected: String, found: String| {
        findings.push(Finding::new(check, subject, expected, found).at(key));
    };
    findings.checked(Check::NodeFiles, 1);
    findings.checked(Check::EmptyNodes, 1);
    let byte_size = files.nodes.get(&key).copied();
    let points = match byte_size {
        None => {
            blame(Check::NodeFiles, "file of the node", dataset.metadata().node_file(key), "no such file".into());
            None
        }
        Some(bytes) => held(key, bytes, dataset, findings)?,
    };
    if points == Some(0) {
        blame(Check::EmptyNodes, "points of the file", "at least 1".into(), "0".into());
    }
    if let Some(points) = points {
        findings.checked(Check::NodeCounts, 1);
        if points != u64::from(record.points) {
            blame(Check::NodeCounts, "points in the index", points.to_string(), record.points.to_string());
        }
    }
    let record = NodeRecord {
        node_type: u8::from(record.child_mask == 0),
        child_mask: record.child_mask,
        points: points.map_or(0, |points| u32::try_from(points).unwrap_or(u32::MAX)),
        byte_offset: 0,
        byte_size: byte_size.unwrap_or(0),
    };
    Ok(TreeNode { key, record, chunk_bytes: index_bytes, readable: points.is_some() })
}

/// How many points a file holds; `None` if it cannot be read.
fn held(key: NodeKey, bytes: u64, dataset: &Dataset, findings: &Findings) -> Result<Option<u64>, ReadError> {
    let metadata = dataset.metadata();
    if metadata.files != NodeFiles::Bin {
        return match dataset.count(key) {
            Err(error) if !matches!(error.kind(), ErrorKind::Io(_)) => {
                findings.push(Finding::new(Check::NodeFiles, "file of the node", "a LAS file", error.what()).at(key));
                Ok(None)
            }
            count => count.map(Some),
        };
    }
    let len: u64 = metadata.attributes.iter().map(|a| (a.elements * a.ty.size()) as u64).sum();
    if bytes.is_multiple_of(len) {
        return Ok(Some(bytes / len));
    }
    let finding = Finding::new(Check::NodeFiles, "bytes of the file", format!("a multiple of {len}"), bytes);
    findings.push(finding.at(key));
    Ok(None)
}

/// Files of nodes that the index does not have. An index of a leaf at a border is what the reference writes, too.
fn strays(indexed: &[Indexed], files: &Files, findings: &Findings) {
    let known: HashSet<NodeKey> = indexed.iter().map(|node| node.key).collect();
    let unknown = |keys: &mut dyn Iterator<Item = NodeKey>, what: &str| {
        let mut keys: Vec<NodeKey> = keys.filter(|key| !known.contains(key)).collect();
        keys.sort_unstable();
        for key in keys {
            let finding = Finding::new(Check::NodeFiles, "node", "in the index", format!("{what}, but not there"));
            findings.push(finding.at(key));
        }
    };
    unknown(&mut files.nodes.keys().copied(), "a file of points");
    unknown(&mut files.indexes.keys().copied(), "an index of its own");
}
