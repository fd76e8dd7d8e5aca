//! The hierarchy, walked page by page; nothing in it is trusted.

use std::collections::{BTreeMap, HashMap, HashSet, VecDeque};
use std::ops::Range;
use std::path::Path;

use pointmill_format::bytes::read_exact_at;
use pointmill_format::copc::{Entry, Info};
use pointmill_format::potree2::NodeRecord;
use pointmill_format::{NodeKey, ReadError};

use super::front::Front;
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::memory::Budget;
use crate::octree::tree::{NODE_BYTES, Tree, TreeNode};

/// Entries that are read at once.
const STEP_BYTES: u64 = (Entry::LEN as u64) << 13;

/// Where the points of a node are.
#[derive(Debug, Default, Clone, Copy)]
struct Placed {
    offset: u64,
    bytes: u64,
    points: u64,
    /// Bytes of the page that begins with it.
    page_bytes: u64,
}

/// Where the walk is.
pub(super) struct Pages<'a> {
    pub(super) path: &'a Path,
    pub(super) front: &'a Front,
    pub(super) budget: &'a Budget,
    pub(super) findings: &'a Findings,
    nodes: HashMap<NodeKey, Placed>,
    /// Nodes that lead on to a page.
    queue: VecDeque<(NodeKey, Range<u64>)>,
    /// All that ever did.
    led_on: HashSet<NodeKey>,
    /// Pages that were read: first byte and end.
    taken: BTreeMap<u64, u64>,
}

impl<'a> Pages<'a> {
    pub(super) fn new(path: &'a Path, front: &'a Front, budget: &'a Budget, findings: &'a Findings) -> Self {
        let (nodes, queue, led_on, taken) = Default::default();
        Self { path, front, budget, findings, nodes, queue, led_on, taken }
    }

    /// Reads every page that is reached from the root's, and reports what is wrong with them.
    ///
    /// # Errors
    /// The operating system could not read the file, or the nodes do not fit memory.
    pub(super) fn walk(mut self, info: &Info) -> Result<Tree, ReadError> {
        let start = info.root_page_offset;
        self.queue.push_back((NodeKey::ROOT, start..start.saturating_add(info.root_page_size)));
        while let Some((root, range)) = self.queue.pop_front() {
            self.findings.checked(Check::Pages, 1);
            if self.is_sound(root, &range) {
                self.read(root, range)?;
            }
        }
        self.unused();
        Ok(self.tree())
    }

    fn blame(&self, key: NodeKey, subject: &'static str, expected: impl Into<String>, found: impl Into<String>) {
        let finding = Finding::new(Check::Pages, subject, expected.into(), found.into());
        self.findings.push(finding.at(key));
    }

    /// True if a page can be read; it is taken then.
    fn is_sound(&mut self, root: NodeKey, range: &Range<u64>) -> bool {
        let size = range.end - range.start;
        if size == 0 || !size.is_multiple_of(Entry::LEN as u64) {
            self.blame(root, "bytes of the page", format!("a multiple of {}", Entry::LEN), size.to_string());
            return false;
        }
        if range.end > self.front.file_bytes {
            let file = self.front.file_bytes;
            self.blame(
                root,
                "end of the page",
                format!("at most {file}, the bytes of the file"),
                range.end.to_string(),
            );
            return false;
        }
        let before = self.taken.range(..range.end).next_back();
        if let Some((first, end)) = before.filter(|(_, end)| **end > range.start) {
            let found = format!("bytes {} to {}, of which others have {first} to {end}", range.start, range.end);
            self.blame(root, "the page", "bytes of its own", found);
            return false;
        }
        self.taken.insert(range.start, range.end);
        let is_in = |data: &Range<u64>| data.start <= range.start && range.end <= data.end;
        if !self.records().any(|data| is_in(&data)) {
            let found = format!("bytes {} to {}", range.start, range.end);
            self.blame(root, "the page", "in the record copc 1000", found);
        }
        true
    }

    /// Where the data of the hierarchy's records is.
    fn records(&self) -> impl Iterator<Item = Range<u64>> + '_ {
        self.front.all("copc", 1000).map(|record| record.range.clone())
    }

    /// Bytes of the hierarchy that are in no page.
    fn unused(&self) {
        let all: u64 = self.records().map(|data| data.end - data.start).sum();
        let taken: u64 = self.taken.iter().map(|(first, end)| end - first).sum();
        if let Some(unused) = all.checked_sub(taken).filter(|unused| *unused > 0) {
            let finding = Finding::new(Check::Pages, "bytes of the record copc 1000 in no page", 0, unused);
            self.findings.push(finding.warning());
        }
    }

    fn read(&mut self, root: NodeKey, range: Range<u64>) -> Result<(), ReadError> {
        let mut buffer = Vec::new();
        let mut has_root = false;
        for at in range.clone().step_by(STEP_BYTES as usize) {
            buffer.resize(STEP_BYTES.min(range.end - at) as usize, 0);
            read_exact_at(&self.front.file, &mut buffer, at)
                .map_err(|e| ReadError::io(self.path, "reading the hierarchy", e))?;
            for bytes in buffer.as_chunks::<{ Entry::LEN }>().0 {
                let entry = Entry::from_bytes(bytes);
                has_root |= entry.points != Entry::PAGE && entry.node_key() == Some(root);
                self.take(root, &entry);
            }
            self.budget.require((self.nodes.len() + self.led_on.len()) as u64 * NODE_BYTES)?;
        }
        if !has_root {
            self.blame(root, "entry of the page's own node", "in it", "not there");
        } else if let Some(placed) = self.nodes.get_mut(&root) {
            placed.page_bytes = range.end - range.start;
        }
        Ok(())
    }

    fn take(&mut self, root: NodeKey, entry: &Entry) {
        let Entry { key: [level, x, y, z], offset, byte_size, points } = *entry;
        let Some(key) = entry.node_key() else {
            self.blame(root, "key of an entry", "a node", format!("{level}-{x}-{y}-{z}"));
            return;
        };
        if key.ancestor(root.level) != Some(root) {
            self.blame(key, "page of the node", "that of a node above it", format!("that of {root}"));
            return;
        }
        let bytes = u64::try_from(byte_size).unwrap_or(0);
        let shape = |expected: &str| {
            let found = format!("{points} points, offset {offset}, {byte_size} bytes");
            self.blame(key, "entry", expected, found);
        };
        match points {
            Entry::PAGE if key == root => shape("the true count of the page's own node"),
            Entry::PAGE => {
                if self.led_on.contains(&key) {
                    return shape("one page of the node");
                }
                self.led_on.insert(key);
                self.queue.push_back((key, offset..offset.saturating_add(bytes)));
                return;
            }
            ..0 => return shape("-1, 0 or more points"),
            0 if byte_size != 0 => shape("no bytes without points"),
            0 if offset != 0 => {
                let finding = Finding::new(Check::Pages, "offset without points", 0, offset);
                self.findings.push(finding.at(key).warning());
            }
            1.. if byte_size <= 0 => shape("bytes for the points"),
            _ => {}
        }
        let points = u64::try_from(points).unwrap_or(0);
        let placed = Placed { offset, bytes: if points == 0 { 0 } else { bytes }, points, page_bytes: 0 };
        if self.nodes.insert(key, placed).is_some() {
            self.blame(key, "entries of the node", "1", "2");
        }
    }

    /// The nodes that hang together.
    fn tree(self) -> Tree {
        let mut sorted: Vec<NodeKey> = self.nodes.keys().copied().collect();
        sorted.sort_unstable();
        let mut known: HashMap<NodeKey, usize> = HashMap::new();
        let mut nodes: Vec<TreeNode> = Vec::new();
        for key in sorted {
            let parent = key.parent().map(|parent| known.get(&parent).copied());
            match parent {
                Some(None) => {
                    self.blame(key, "parent of the node", "in the hierarchy, too", "not there");
                    continue;
                }
                Some(Some(parent)) => nodes[parent].record.child_mask |= 1 << key.child_index(),
                None => {}
            }
            known.insert(key, nodes.len());
            nodes.push(tree_node(key, self.nodes.get(&key).copied().unwrap_or_default()));
        }
        for node in &mut nodes {
            node.record.node_type = u8::from(node.record.child_mask == 0);
            if node.record.points == 0 && node.record.child_mask == 0 {
                let finding = Finding::new(Check::Pages, "points of a node without children", "1 or more", 0);
                self.findings.push(finding.at(node.key).warning());
            }
        }
        Tree::new(nodes)
    }
}

fn tree_node(key: NodeKey, placed: Placed) -> TreeNode {
    let Placed { offset, bytes, points, page_bytes } = placed;
    let points = u32::try_from(points).unwrap_or(u32::MAX);
    let record = NodeRecord { node_type: 0, child_mask: 0, points, byte_offset: offset, byte_size: bytes };
    TreeNode { key, record, chunk_bytes: page_bytes, readable: true }
}
