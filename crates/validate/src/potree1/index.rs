//! The index, walked file by file; nothing in it is trusted.

use std::collections::{HashMap, VecDeque};

use pointmill_format::NodeKey;
use pointmill_format::ReadError;
use pointmill_format::potree1::IndexRecord;

use super::expect::Names;
use super::files::Files;
use super::store::Store;
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::memory::Budget;
use crate::octree::tree::NODE_BYTES;

/// A node as the index has it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Indexed {
    pub(crate) key: NodeKey,
    pub(crate) record: IndexRecord,
    /// Bytes of the index that begins with it; 0 if none does.
    pub(crate) index_bytes: u64,
}

/// The index of a dataset: nodes once each, parents before their children.
pub(crate) struct Index<'a> {
    pub(crate) store: &'a Store,
    pub(crate) names: &'a Names,
    pub(crate) files: &'a Files,
    pub(crate) budget: &'a Budget,
    pub(crate) findings: &'a Findings,
}

/// Nodes that are to begin an index, each with the record that says so.
type Pending = VecDeque<(NodeKey, Option<IndexRecord>)>;

impl Index<'_> {
    /// Reads every index that is reached from the root's, and reports what is wrong with them.
    ///
    /// # Errors
    /// The operating system could not read a file.
    pub(crate) fn walk(&self) -> Result<Vec<Indexed>, ReadError> {
        let (mut nodes, mut queue) = (Vec::new(), Pending::from([(NodeKey::ROOT, None)]));
        while let Some((root, parent)) = queue.pop_front() {
            self.findings.checked(Check::IndexFiles, 1);
            let first = nodes.len();
            match self.files.indexes.get(&root) {
                Some(&bytes) => self.read(root, bytes, &mut nodes, &mut queue)?,
                None => self.blame(root, "index file", self.names.index(root), "no such file"),
            }
            match (nodes.get(first).copied(), parent) {
                (Some(Indexed { record, .. }), Some(parent)) if record != parent => {
                    self.blame(root, "record in both files", words(parent), words(record));
                }
                // what the file above says of it is all that is known
                (None, Some(record)) => nodes.push(Indexed { key: root, record, index_bytes: 0 }),
                _ => {}
            }
        }
        Ok(nodes)
    }

    fn blame(&self, key: NodeKey, subject: &'static str, expected: impl Into<String>, found: impl Into<String>) {
        let finding = Finding::new(Check::IndexFiles, subject, expected.into(), found.into());
        self.findings.push(finding.at(key));
    }

    /// Reads one file as far as there are nodes: it may be longer than anything in it.
    fn read(&self, root: NodeKey, bytes: u64, nodes: &mut Vec<Indexed>, queue: &mut Pending) -> Result<(), ReadError> {
        const STEP: usize = IndexRecord::LEN << 14;
        let file = self.names.index(root);
        let whole = bytes - bytes % IndexRecord::LEN as u64;
        if whole != bytes {
            let expected = format!("a multiple of {} bytes", IndexRecord::LEN);
            self.blame(root, "size of an index", expected, format!("{bytes} bytes"));
        }
        let border = u32::from(root.level).saturating_add(self.names.step);
        let (mut keys, mut taken, mut buffer) = (VecDeque::from([root]), 0u64, Vec::new());
        for at in (0..whole).step_by(STEP) {
            buffer.resize(STEP.min((whole - at) as usize), 0);
            self.store.read_at(&file, at, &mut buffer, "reading an index")?;
            for record in buffer.as_chunks::<{ IndexRecord::LEN }>().0 {
                let Some(key) = keys.pop_front() else { break };
                let record = IndexRecord::from_bytes(record);
                let index_bytes = if taken == 0 { bytes } else { 0 };
                taken += 1;
                if u32::from(key.level) == border && record.child_mask != 0 {
                    queue.push_back((key, Some(record)));
                    continue;
                }
                nodes.push(Indexed { key, record, index_bytes });
                for child in (0..8).filter(|child| record.has_child(*child)) {
                    match key.child(child) {
                        Some(child) => keys.push_back(child),
                        None => self.blame(key, "level", format!("at most {}", NodeKey::MAX_LEVEL), "deeper"),
                    }
                }
            }
            self.budget.require((nodes.len() + keys.len() + queue.len()) as u64 * NODE_BYTES)?;
            if keys.is_empty() {
                break;
            }
        }
        let (named, records) = (taken + keys.len() as u64, whole / IndexRecord::LEN as u64);
        if named != records {
            self.blame(root, "records of an index", named.to_string(), records.to_string());
        }
        Ok(())
    }
}

fn words(record: IndexRecord) -> String {
    format!("mask {:#04x}, {} points", record.child_mask, record.points)
}

/// The nodes of a list in `cloud.js`, parents before their children.
pub(crate) fn listed(list: &[(NodeKey, u64)], findings: &Findings) -> Vec<Indexed> {
    findings.checked(Check::IndexFiles, 1);
    let blame = |key: NodeKey, subject: &'static str, expected: &str, found: &str| {
        findings.push(Finding::new(Check::IndexFiles, subject, expected, found).at(key));
    };
    let mut masks: HashMap<NodeKey, u8> = HashMap::new();
    for (key, _) in list {
        if masks.insert(*key, 0).is_some() {
            blame(*key, "node of the list", "once", "twice");
        }
    }
    for (key, _) in list {
        let Some(parent) = key.parent() else { continue };
        match masks.get_mut(&parent) {
            Some(mask) => *mask |= 1 << key.child_index(),
            None => blame(*key, "parent of the node", "in the list, too", "not there"),
        }
    }
    let mut nodes: Vec<Indexed> = list
        .iter()
        .map(|&(key, points)| {
            let child_mask = masks.get(&key).copied().unwrap_or(0);
            let points = u32::try_from(points).unwrap_or(u32::MAX);
            Indexed { key, record: IndexRecord { child_mask, points }, index_bytes: 0 }
        })
        .collect();
    nodes.sort_by_key(|node| node.key);
    nodes.dedup_by_key(|node| node.key);
    nodes
}
