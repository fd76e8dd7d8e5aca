//! The chunks of the nodes, and the chunk table of LASzip: both say the same of the same bytes.

use std::path::Path;

use pointmill_format::ReadError;
use pointmill_format::bytes::read_exact_at;
use pointmill_format::copc::chunk_table_entries;

use super::front::{Front, bytes};
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::memory::Budget;
use crate::octree::tree::{Tree, TreeNode};

/// Bytes of the place of the chunk table, before the chunks, and of the table's head.
const EIGHT: u64 = 8;

/// Points that a byte can hold at most: a symbol of the coder takes more than 1/128 bit.
const POINTS_A_BYTE: u64 = 2048;

/// An entry of the chunk table takes no more bytes, and as much memory.
const ENTRY_BYTES: u64 = 16;

/// More entries than nodes that are read: some writers close chunks that they never fill.
const EMPTY_CHUNKS: u64 = 16;

/// Checks all chunks against the file and the chunk table, and marks the nodes that may be read.
///
/// # Errors
/// The operating system could not read the file, or the table does not fit memory.
pub(super) fn check(
    tree: &mut Tree,
    front: &Front,
    path: &Path,
    budget: &Budget,
    findings: &Findings,
) -> Result<(), ReadError> {
    let table = table_at(front, path, findings)?;
    let first = front.points_start().saturating_add(EIGHT);
    let end = table.unwrap_or(front.file_bytes);
    findings.checked(Check::Chunks, tree.nodes.len() as u64);
    for node in tree.nodes.iter_mut().filter(|n| n.record.points > 0) {
        node.readable = can_be(node, first, end, front, findings);
    }
    let mut chunks: Vec<&TreeNode> = tree.nodes.iter().filter(|n| n.record.byte_size > 0).collect();
    chunks.sort_by_key(|n| (n.record.byte_offset, n.key));
    cover(&chunks, first, table, findings);
    match table {
        Some(table) => self::table(&chunks, table, front, (path, budget), findings),
        None => Ok(()),
    }
}

/// Where the chunk table is; `None` if that is not in the file.
fn table_at(front: &Front, path: &Path, findings: &Findings) -> Result<Option<u64>, ReadError> {
    findings.checked(Check::Chunks, 1);
    let start = front.points_start();
    let (first, last) = (start.saturating_add(EIGHT), front.file_bytes.saturating_sub(EIGHT));
    if start > last {
        return Ok(None); // reported with the header
    }
    let mut at = [0; 8];
    read_exact_at(&front.file, &mut at, start).map_err(|e| ReadError::io(path, "reading the place of chunks", e))?;
    let at = i64::from_le_bytes(at);
    let table = u64::try_from(at).ok().filter(|at| (first..=last).contains(at));
    if table.is_none() {
        let expected = format!("from {first} to {last}");
        findings.push(Finding::new(Check::Chunks, "place of the chunk table", expected, at));
    }
    Ok(table)
}

/// True if a chunk lies among the points and can have so many of them.
fn can_be(node: &TreeNode, first: u64, end: u64, front: &Front, findings: &Findings) -> bool {
    let record = &node.record;
    let (points, len) = (u64::from(record.points), record.byte_size);
    if len == 0 {
        return false; // reported with its entry
    }
    let blame = |subject: &'static str, expected: String, found: u64| {
        findings.push(Finding::new(Check::Chunks, subject, expected, found).at(node.key));
        false
    };
    let chunk_end = record.byte_offset.saturating_add(len);
    if record.byte_offset < first {
        return blame("start of the chunk", format!("at least {first}, where chunks begin"), record.byte_offset);
    }
    if chunk_end > end {
        return blame("end of the chunk", format!("at most {end}, where chunks end"), chunk_end);
    }
    let least = u64::from(front.u16(105));
    if len < least {
        return blame("bytes of the chunk", format!("{least} or more, those of a point"), len);
    }
    let most = (len - least) * POINTS_A_BYTE + 1;
    if points > most {
        return blame("points of the chunk", format!("at most {most} in {len} bytes"), points);
    }
    true
}

/// Bytes of two chunks, and of none.
fn cover(chunks: &[&TreeNode], first: u64, table: Option<u64>, findings: &Findings) {
    let mut covered = first;
    let gap = |from: u64, to: u64| {
        if from < to {
            let found = format!("bytes {from} to {to}");
            findings.push(Finding::new(Check::Chunks, "bytes of no node", "none", found));
        }
    };
    for node in chunks {
        let start = node.record.byte_offset;
        gap(covered, start.min(table.unwrap_or(start)));
        if start < covered && start >= first {
            let expected = format!("at least {covered}, where the one before ends");
            findings.push(Finding::new(Check::Chunks, "start of the chunk", expected, start).at(node.key));
        }
        covered = covered.max(start.saturating_add(node.record.byte_size));
    }
    if let Some(table) = table {
        gap(covered, table);
    }
}

/// The chunk table against the chunks, which are in the order of the file.
fn table(
    chunks: &[&TreeNode],
    at: u64,
    front: &Front,
    (path, budget): (&Path, &Budget),
    findings: &Findings,
) -> Result<(), ReadError> {
    let read = |buffer: &mut [u8], at| {
        read_exact_at(&front.file, buffer, at).map_err(|e| ReadError::io(path, "reading the chunk table", e))
    };
    let mut head = [0; EIGHT as usize];
    read(&mut head, at)?;
    let (version, count) = (u32::from_le_bytes(bytes(&head, 0)), u64::from(u32::from_le_bytes(bytes(&head, 4))));
    let nodes = chunks.len() as u64;
    findings.checked(Check::Chunks, nodes);
    let blame = |subject: &'static str, expected: u64, found: u64| {
        findings.push(Finding::new(Check::Chunks, subject, expected, found));
    };
    if version != 0 {
        blame("version of the chunk table", 0, version.into());
        return Ok(());
    }
    if count < nodes || count > nodes + EMPTY_CHUNKS {
        blame("entries of the chunk table", nodes, count);
        return Ok(());
    }
    let len = (EIGHT + ENTRY_BYTES * count + 64).min(front.file_bytes - at);
    budget.require(2 * len)?;
    let mut coded = vec![0; len as usize];
    read(&mut coded, at)?;
    let Some(entries) = chunk_table_entries(&coded) else {
        findings.push(Finding::new(
            Check::Chunks,
            "the chunk table",
            format!("{count} entries"),
            "bytes that end before",
        ));
        return Ok(());
    };
    let first = front.points_start().saturating_add(EIGHT);
    compare(chunks, &entries, first, findings);
    let more = entries.get(chunks.len()..).unwrap_or_default();
    if more.iter().any(|entry| *entry != (0, 0)) {
        blame("entries of the chunk table", nodes, count);
    } else if !more.is_empty() {
        findings.push(Finding::new(Check::Chunks, "empty entries of the chunk table", 0, more.len()).warning());
    }
    Ok(())
}

/// Entries, one behind the other from `at` on, against the chunks that begin where they do.
fn compare(chunks: &[&TreeNode], entries: &[(u32, u32)], mut at: u64, findings: &Findings) {
    let mut entries = entries.iter().peekable();
    for node in chunks {
        let record = &node.record;
        while let Some((_, len)) = entries.next_if(|_| at < record.byte_offset) {
            at += u64::from(*len);
        }
        let words = |points: u32, len: u64| format!("{points} points in {len} bytes");
        let found = match entries.peek() {
            Some((points, len)) if at == record.byte_offset => {
                if (record.points, record.byte_size) == (*points, u64::from(*len)) {
                    continue;
                }
                words(*points, u64::from(*len))
            }
            _ => "none that begins there".to_owned(),
        };
        let expected = words(record.points, record.byte_size);
        findings.push(Finding::new(Check::Chunks, "entry of the chunk table", expected, found).at(node.key));
    }
}
