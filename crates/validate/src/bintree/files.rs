//! Sizes of leaf files and ranges, and files that no leaf names.

use std::fs;
use std::io;
use std::path::Path;

use pointmill_format::ReadError;
use pointmill_format::bintree::{Layout, Node, NodeKind, PACKED_FILE, leaf_file_name};

use super::tree::Tree;
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Which nodes are leaves that can be read.
///
/// # Errors
/// The operating system cannot report it; a missing file is a finding.
pub(super) fn check(folder: &Path, tree: &Tree<'_>, findings: &Findings) -> Result<Vec<bool>, ReadError> {
    let readable = match tree.header().layout {
        Layout::Files => files(folder, tree, findings)?,
        Layout::Packed => ranges(folder, tree, findings)?,
    };
    orphans(folder, tree, findings)?;
    Ok(readable)
}

fn bytes_of(node: &Node, tree: &Tree<'_>) -> u128 {
    u128::from(node.count) * tree.header().record.stride() as u128
}

/// Bytes of a file; none if it is not there.
fn size(path: &Path) -> Result<Option<u64>, ReadError> {
    match fs::metadata(path) {
        Ok(about) => Ok(Some(about.len())),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(ReadError::io(path, "opening", error)),
    }
}

fn files(folder: &Path, tree: &Tree<'_>, findings: &Findings) -> Result<Vec<bool>, ReadError> {
    let mut readable = vec![false; tree.nodes().len()];
    for (index, node) in tree.leaves() {
        findings.checked(Check::LeafFiles, 1);
        let name = tree.dataset.leaf_name(index);
        let expected = bytes_of(node, tree);
        let found = size(&folder.join(&name))?;
        if found.map(u128::from) == Some(expected) {
            readable[index as usize] = true;
            continue;
        }
        let found = found.map_or_else(|| "no such file".to_owned(), |bytes| format!("{bytes} bytes"));
        let finding = Finding::new(Check::LeafFiles, name, format!("{expected} bytes"), found);
        findings.push(finding.at(tree.place(index)).points(node.count));
    }
    Ok(readable)
}

/// Ranges lie in the file, and cover it; that they are disjoint the reader has seen to.
fn ranges(folder: &Path, tree: &Tree<'_>, findings: &Findings) -> Result<Vec<bool>, ReadError> {
    let mut readable = vec![false; tree.nodes().len()];
    let bytes = size(&folder.join(PACKED_FILE))?;
    if bytes.is_none() && !tree.nodes().is_empty() {
        findings.push(Finding::new(Check::LeafFiles, PACKED_FILE, "the points of all leaves", "no such file"));
        findings.checked(Check::LeafFiles, tree.leaves().count() as u64);
        return Ok(readable);
    }
    let bytes = bytes.unwrap_or(0);
    let mut ranges = Vec::new();
    for (index, node) in tree.leaves() {
        findings.checked(Check::LeafFiles, 1);
        let NodeKind::Leaf { start: Some(start), .. } = node.kind else { continue };
        let end = u128::from(start) + bytes_of(node, tree);
        readable[index as usize] = end <= u128::from(bytes);
        if !readable[index as usize] {
            let found = format!("the range {start} to {end}");
            let finding = Finding::new(Check::LeafFiles, PACKED_FILE, format!("ranges below {bytes}"), found);
            findings.push(finding.at(tree.place(index)).points(node.count));
        }
        ranges.push((u128::from(start), end));
    }
    ranges.sort_unstable();
    ranges.push((u128::from(bytes), u128::from(bytes)));
    let mut covered = 0;
    for (start, end) in ranges {
        if start > covered {
            let found = format!("the bytes {covered} to {start} belong to no leaf");
            findings.push(Finding::new(Check::LeafFiles, PACKED_FILE, "nothing but leaves", found));
        }
        covered = covered.max(end);
    }
    Ok(readable)
}

/// Files named like those of leaves that the index does not name.
fn orphans(folder: &Path, tree: &Tree<'_>, findings: &Findings) -> Result<(), ReadError> {
    let io = |error| ReadError::io(folder, "listing", error);
    for entry in fs::read_dir(folder).map_err(io)? {
        let name = entry.map_err(io)?.file_name();
        let Some(name) = name.to_str() else { continue };
        let orphaned = match tree.header().layout {
            _ if name == PACKED_FILE => tree.header().layout != Layout::Packed,
            layout => is_leaf_name(name) && !(layout == Layout::Files && is_named(name, tree)),
        };
        if orphaned {
            let found = "the file belongs to no leaf";
            findings.push(Finding::new(Check::LeafFiles, name.to_owned(), "files that the index names", found));
        }
    }
    Ok(())
}

fn steps(name: &str) -> Option<&str> {
    name.strip_prefix('n')?.strip_suffix(".bin")
}

fn is_leaf_name(name: &str) -> bool {
    steps(name).is_some_and(|path| path.bytes().all(|b| matches!(b, b'0' | b'1')))
}

/// Follows the path in a name; false if no leaf is there.
fn is_named(name: &str, tree: &Tree<'_>) -> bool {
    let mut at = 0;
    for step in steps(name).unwrap_or_default().bytes() {
        match tree.dataset.children(at) {
            Some([low, high]) => at = if step == b'1' { high } else { low },
            None => return false,
        }
    }
    tree.dataset.node(at).is_some_and(Node::is_leaf) && name == leaf_file_name(tree.dataset.path(at))
}
