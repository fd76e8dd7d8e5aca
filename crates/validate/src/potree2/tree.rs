//! The octree in `hierarchy.bin`, walked chunk by chunk; nothing in it is trusted.

use std::collections::{BTreeMap, VecDeque};

use pointmill_format::bytes::ByteSource;
use pointmill_format::potree2::{HIERARCHY_FILE, NodeRecord};
use pointmill_format::{NodeKey, ReadError};

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::memory::Budget;
use crate::octree::tree::{NODE_BYTES, Tree, TreeNode};

/// A chunk that is still to be read.
struct Pending {
    root: NodeKey,
    offset: u64,
    size: u64,
    /// The record of the proxy that led here; `None` for the root chunk.
    points: Option<u32>,
}

/// Reads every chunk and reports what is wrong with them.
///
/// # Errors
/// The operating system could not read the file.
pub(crate) fn walk(
    source: &dyn ByteSource,
    first_chunk_size: u64,
    budget: &Budget,
    findings: &Findings,
) -> Result<Tree, ReadError> {
    let file_size = size_of(source, HIERARCHY_FILE)?;
    let mut tree = Tree::default();
    let mut chunks = BTreeMap::<u64, u64>::new(); // start → end, disjoint: this bounds the walk by the file
    let mut queue = VecDeque::from([Pending { root: NodeKey::ROOT, offset: 0, size: first_chunk_size, points: None }]);
    while let Some(chunk) = queue.pop_front() {
        findings.checked(Check::Hierarchy, 1);
        let Some(end) = admit(&chunk, file_size, &chunks, findings) else { continue };
        chunks.insert(chunk.offset, end);
        let mut chunk = Open { chunk: &chunk, keys: VecDeque::from([chunk.root]), taken: 0 };
        chunk.read(source, end, &mut tree, &mut queue, budget, findings)?;
    }
    orphans(&chunks, file_size, findings);
    tree.link();
    Ok(tree)
}

/// Bytes of a file of the dataset.
pub(crate) fn size_of(source: &dyn ByteSource, file: &str) -> Result<u64, ReadError> {
    source.size(file).map_err(|e| ReadError::io(source.locate(file), "asking for the size", e))
}

/// The end of the part of the chunk that can be read, if any.
fn admit(chunk: &Pending, file_size: u64, chunks: &BTreeMap<u64, u64>, findings: &Findings) -> Option<u64> {
    let record = NodeRecord::LEN as u64;
    let blame = |subject, expected: String, found: String| {
        findings.push(Finding::new(Check::Hierarchy, subject, expected, found).at(chunk.root));
    };
    if chunk.size < record || !chunk.size.is_multiple_of(record) {
        blame("size of a chunk", format!("a multiple of {record} bytes"), format!("{} bytes", chunk.size));
    }
    let end = chunk.offset.saturating_add(chunk.size);
    if end > file_size {
        blame("end of a chunk", format!("at most byte {file_size}"), format!("byte {end}"));
    }
    let whole = end.min(file_size).saturating_sub(chunk.offset) / record * record;
    if whole == 0 {
        return None;
    }
    let before = chunks.range(..chunk.offset + whole).next_back();
    if let Some((&start, &other_end)) = before.filter(|(_, e)| **e > chunk.offset) {
        let expected = format!("bytes of no other chunk, from {}", chunk.offset);
        blame("range of a chunk", expected, format!("bytes {start} to {other_end} belong to another chunk"));
        return None;
    }
    Some(chunk.offset + whole)
}

/// A chunk as far as it was read.
struct Open<'a> {
    chunk: &'a Pending,
    /// The nodes that come next.
    keys: VecDeque<NodeKey>,
    /// Records so far.
    taken: u64,
}

impl Open<'_> {
    /// Reads the part of a chunk up to `end`, or as far as there are nodes: a file may be longer than anything in it.
    fn read(
        &mut self,
        source: &dyn ByteSource,
        end: u64,
        tree: &mut Tree,
        queue: &mut VecDeque<Pending>,
        budget: &Budget,
        findings: &Findings,
    ) -> Result<(), ReadError> {
        const STEP: usize = NodeRecord::LEN << 14;
        let Pending { root, offset, .. } = *self.chunk;
        let mut bytes = Vec::new();
        for at in (offset..end).step_by(STEP) {
            bytes.resize(STEP.min((end - at) as usize), 0);
            let read = source.read_at(HIERARCHY_FILE, at, &mut bytes);
            read.map_err(|e| ReadError::io(source.locate(HIERARCHY_FILE), "reading a hierarchy chunk", e))?;
            if !self.take(&bytes, tree, queue, findings) {
                return Ok(());
            }
            budget.require((tree.nodes.len() + self.keys.len() + queue.len()) as u64 * NODE_BYTES)?;
            if self.keys.is_empty() {
                break;
            }
        }
        let records = (end - offset) / NodeRecord::LEN as u64;
        let named = self.taken + self.keys.len() as u64;
        if named != records {
            findings.push(Finding::new(Check::Hierarchy, "records of a chunk", named, records).at(root));
        }
        Ok(())
    }

    /// Takes records in. False if the chunk is none.
    fn take(&mut self, bytes: &[u8], tree: &mut Tree, queue: &mut VecDeque<Pending>, findings: &Findings) -> bool {
        let (records, _) = bytes.as_chunks::<{ NodeRecord::LEN }>();
        for bytes in records {
            let Some(key) = self.keys.pop_front() else { break };
            let (i, chunk) = (self.taken, self.chunk);
            self.taken += 1;
            let record = NodeRecord::from_bytes(bytes);
            let blame = |subject, expected: String, found: String| {
                findings.push(Finding::new(Check::Hierarchy, subject, expected, found).at(key));
            };
            if record.node_type > 2 {
                blame("type", "0, 1 or 2".into(), record.node_type.to_string());
            }
            if record.is_proxy() {
                if i == 0 {
                    blame("first record of a chunk", "type 0 or 1".into(), "a proxy".into());
                    return false;
                }
                let (offset, size) = (record.byte_offset, record.byte_size);
                queue.push_back(Pending { root: key, offset, size, points: Some(record.points) });
                continue;
            }
            if let Some(points) = chunk.points.filter(|p| i == 0 && *p != record.points) {
                blame("numPoints of a proxy", record.points.to_string(), points.to_string());
            }
            let chunk_bytes = if i == 0 { chunk.size } else { 0 };
            tree.nodes.push(TreeNode { key, record, chunk_bytes, readable: false });
            for child in (0..8).filter(|c| record.child_mask >> c & 1 == 1) {
                match key.child(child) {
                    Some(child) => self.keys.push_back(child),
                    None => blame("level", format!("at most {}", NodeKey::MAX_LEVEL), "deeper".into()),
                }
            }
        }
        true
    }
}

fn orphans(chunks: &BTreeMap<u64, u64>, file_size: u64, findings: &Findings) {
    let mut covered = 0;
    for (start, end) in chunks.iter().map(|(s, e)| (*s, *e)).chain([(file_size, file_size)]) {
        if start > covered {
            let found = format!("bytes {covered} to {start} belong to no chunk");
            findings.push(Finding::new(Check::Hierarchy, "orphaned bytes of hierarchy.bin", "none", found));
        }
        covered = covered.max(end);
    }
}
