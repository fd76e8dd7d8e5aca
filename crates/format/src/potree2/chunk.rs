//! One chunk of `hierarchy.bin`: a subtree down to its proxies, breadth first.

use std::collections::VecDeque;
use std::path::Path;

use crate::{NodeKey, ReadError};

use super::{Node, NodeRecord};

/// A chunk as far as its bytes were taken in, whose first record is that of its root.
pub(super) struct Parser<'a> {
    root: NodeKey,
    /// Records that the chunk is said to have.
    records: u64,
    /// Of the chunk, for messages; so is `path`.
    byte_offset: u64,
    path: &'a Path,
    /// Nodes that the masks announced, in the order in which their records follow.
    keys: VecDeque<NodeKey>,
    nodes: Vec<Node>,
}

impl<'a> Parser<'a> {
    /// A chunk of `byte_size` bytes at `byte_offset` of the file `path`.
    pub(super) fn new(root: NodeKey, byte_offset: u64, byte_size: u64, path: &'a Path) -> Result<Self, ReadError> {
        if byte_size == 0 || !byte_size.is_multiple_of(NodeRecord::LEN as u64) {
            let what = format!("the hierarchy chunk of {root} has {byte_size} bytes, not a multiple of 22");
            return Err(ReadError::broken(path, byte_offset, what));
        }
        let records = byte_size / NodeRecord::LEN as u64;
        Ok(Self { root, records, byte_offset, path, keys: VecDeque::from([root]), nodes: Vec::new() })
    }

    fn broken(&self, index: usize, what: &str) -> ReadError {
        let what = format!("the hierarchy chunk of {} has {} records, {what}", self.root, self.records);
        ReadError::broken(self.path, self.at(index), what)
    }

    fn at(&self, index: usize) -> u64 {
        self.byte_offset + (index * NodeRecord::LEN) as u64
    }

    /// Takes the next records. What they cannot be followed by is refused at once, however long the chunk is.
    pub(super) fn take(&mut self, bytes: &[u8]) -> Result<(), ReadError> {
        let (records, _) = bytes.as_chunks::<{ NodeRecord::LEN }>();
        let room = self.nodes.try_reserve(records.len()).and_then(|()| self.keys.try_reserve(records.len()));
        room.map_err(|_| ReadError::memory(self.path, format!("the nodes of {} do not fit memory", self.root)))?;
        for bytes in records {
            let index = self.nodes.len();
            let Some(key) = self.keys.pop_front() else {
                return Err(self.broken(index, &format!("its child masks account for {index}")));
            };
            let record = NodeRecord::from_bytes(bytes);
            self.nodes.push(Node { key, record });
            for child in (0..8).filter(|c| record.has_child(*c)) {
                let Some(child) = key.child(child) else {
                    let what = format!("node {key} has children below level {}", NodeKey::MAX_LEVEL);
                    return Err(ReadError::broken(self.path, self.at(index), what));
                };
                self.keys.push_back(child);
            }
            if (self.nodes.len() + self.keys.len()) as u64 > self.records {
                return Err(self.broken(index, &format!("its child masks call for more (node {key})")));
            }
        }
        Ok(())
    }

    /// The nodes, breadth first.
    pub(super) fn finish(self) -> Vec<Node> {
        self.nodes
    }
}
