//! One `.hrc`: the levels of a subtree down to the next file, breadth first.

use std::collections::{HashMap, VecDeque};
use std::path::Path;

use crate::{NodeKey, ReadError};

use super::{IndexRecord, Node};

/// An index file as far as its bytes were taken in.
pub(super) struct Parser<'a> {
    root: NodeKey,
    /// The level whose nodes have their children elsewhere.
    border: u32,
    /// For messages.
    path: &'a Path,
    /// Nodes that masks announced, in the order in which their records follow.
    keys: VecDeque<NodeKey>,
    nodes: Vec<Node>,
}

impl<'a> Parser<'a> {
    /// The file `path` of the node `root`, which holds the levels from that of the root to `step` below it.
    pub(super) fn new(root: NodeKey, step: u32, path: &'a Path) -> Self {
        let border = u32::from(root.level).saturating_add(step);
        Self { root, border, path, keys: VecDeque::from([root]), nodes: Vec::new() }
    }

    /// Takes the next bytes, whole records. What nothing announced is refused at once, however long the file is.
    pub(super) fn take(&mut self, bytes: &[u8]) -> Result<(), ReadError> {
        let (records, _) = bytes.as_chunks::<{ IndexRecord::LEN }>();
        let room = self.nodes.try_reserve(records.len()).and_then(|()| self.keys.try_reserve(records.len()));
        room.map_err(|_| ReadError::memory(self.path, format!("the nodes of {} do not fit memory", self.root)))?;
        for bytes in records {
            let Some(key) = self.keys.pop_front() else {
                let what =
                    format!("the index of {} goes on after the {} nodes of its masks", self.root, self.nodes.len());
                return Err(ReadError::broken(self.path, self.at(), what));
            };
            self.add(key, IndexRecord::from_bytes(bytes))?;
        }
        Ok(())
    }

    fn add(&mut self, key: NodeKey, record: IndexRecord) -> Result<(), ReadError> {
        let is_proxy = u32::from(key.level) == self.border && record.child_mask != 0;
        if !is_proxy {
            for child in (0..8).filter(|child| record.has_child(*child)) {
                let Some(child) = key.child(child) else {
                    let what = format!("node {key} has children below level {}", NodeKey::MAX_LEVEL);
                    return Err(ReadError::broken(self.path, self.at(), what));
                };
                self.keys.push_back(child);
            }
        }
        let IndexRecord { child_mask, points } = record;
        self.nodes.push(Node { key, child_mask, declared: points.into(), is_proxy });
        Ok(())
    }

    /// The place of the next record.
    fn at(&self) -> u64 {
        (self.nodes.len() * IndexRecord::LEN) as u64
    }

    /// The nodes, breadth first.
    pub(super) fn finish(self) -> Result<Vec<Node>, ReadError> {
        match self.keys.front() {
            None => Ok(self.nodes),
            Some(missing) => {
                let what = format!("the index of {} ends before the record of {missing}", self.root);
                Err(ReadError::broken(self.path, self.at(), what))
            }
        }
    }
}

/// The nodes of a list in `cloud.js`, breadth first. `path`: for messages.
pub(super) fn from_list(list: &[(NodeKey, u64)], path: &Path) -> Result<Vec<Node>, ReadError> {
    let broken = |what| Err(ReadError::broken(path, None, what));
    let mut masks: HashMap<NodeKey, u8> = list.iter().map(|(key, _)| (*key, 0)).collect();
    if masks.len() < list.len() {
        return broken("hierarchy has a node twice".to_owned());
    }
    if !masks.contains_key(&NodeKey::ROOT) {
        return broken("hierarchy lacks the root".to_owned());
    }
    for (key, parent) in list.iter().filter_map(|(key, _)| Some((key, key.parent()?))) {
        match masks.get_mut(&parent) {
            Some(mask) => *mask |= 1 << key.child_index(),
            None => return broken(format!("hierarchy has node {key}, but not its parent")),
        }
    }
    let node = |&(key, declared): &(NodeKey, u64)| {
        let child_mask = masks.get(&key).copied().unwrap_or(0);
        Node { key, child_mask, declared, is_proxy: false }
    };
    let mut nodes: Vec<Node> = list.iter().map(node).collect();
    nodes.sort_by_cached_key(|node| node.key.breadth_first_rank());
    Ok(nodes)
}
