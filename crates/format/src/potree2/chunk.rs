//! One chunk of `hierarchy.bin`: a subtree down to its proxies, breadth first.

use std::collections::BTreeMap;
use std::path::Path;

use crate::{NodeKey, ReadError};

use super::{Node, NodeRecord};

/// Parses a chunk whose first record is `root`; `byte_offset` (of the chunk) and `path` are for messages.
pub(super) fn parse(root: NodeKey, bytes: &[u8], byte_offset: u64, path: &Path) -> Result<Vec<Node>, ReadError> {
    let (records, rest) = bytes.as_chunks::<{ NodeRecord::LEN }>();
    if records.is_empty() || !rest.is_empty() {
        let what = format!("the hierarchy chunk of {root} has {} bytes, not a multiple of 22", bytes.len());
        return Err(ReadError::broken(path, byte_offset, what));
    }
    let at = |index: usize| byte_offset + (index * NodeRecord::LEN) as u64;
    // Nodes that the masks announced, in the order in which their records follow.
    let mut keys = Vec::with_capacity(records.len());
    keys.push(root);
    let mut nodes = Vec::with_capacity(records.len());
    for (index, bytes) in records.iter().enumerate() {
        let Some(&key) = keys.get(index) else {
            let what = format!(
                "the hierarchy chunk of {root} has {} records, its child masks account for {index}",
                records.len()
            );
            return Err(ReadError::broken(path, at(index), what));
        };
        let record = NodeRecord::from_bytes(bytes);
        nodes.push(Node { key, record });
        for child in (0..8).filter(|c| record.has_child(*c)) {
            let Some(child) = key.child(child) else {
                let what = format!("node {key} has children below level {}", NodeKey::MAX_LEVEL);
                return Err(ReadError::broken(path, at(index), what));
            };
            keys.push(child);
        }
        if keys.len() > records.len() {
            let what = format!(
                "the hierarchy chunk of {root} has {} records, its child masks call for more (node {key})",
                records.len()
            );
            return Err(ReadError::broken(path, at(index), what));
        }
    }
    Ok(nodes)
}

/// The byte ranges of the chunks read so far. No two may overlap: that is what keeps a walk over hostile proxies from
/// going round in circles, and the number of nodes below what `hierarchy.bin` can hold.
#[derive(Debug, Clone, Default)]
pub(super) struct ChunkRanges {
    /// Start → (end, root of the chunk).
    by_start: BTreeMap<u64, (u64, NodeKey)>,
}

impl ChunkRanges {
    /// Adds the chunk of `root`, or reports which chunk is there already.
    pub(super) fn claim(&mut self, root: NodeKey, start: u64, size: u64, path: &Path) -> Result<(), ReadError> {
        let end = start.saturating_add(size);
        if let Some((_, (other_end, other))) = self.by_start.range(..end).next_back()
            && *other_end > start
        {
            let what = format!("the hierarchy chunk of {root} overlaps the one of {other}");
            return Err(ReadError::broken(path, start, what));
        }
        self.by_start.insert(start, (end, root));
        Ok(())
    }
}
