//! All files of a dataset in one archive, stored as they are: `cloud.js` first, nodes in the order of the tree, the index last.
//!
//! The bytes of a node have their head before them from the start, so that the tree decides where they are, and threads
//! write them side by side.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use pointmill_format::bytes::{ArchivedFile, MIN_ARCHIVE_PADDING, put_archive_end};
use pointmill_format::potree1::{IndexFile, METADATA_FILE, Metadata};
use pointmill_format::{DatasetKind, NodeKey};
use rawzip::{Crc32, crc32};

use crate::error::{ConvertError, Unsupported};
use crate::octree::FinishedNode;
use crate::outputs::staging::{OutputFile, StagedDataset};
use crate::runtime::{Consumer, DiskFile, Reservation, Runtime};

/// What the archive is called.
pub(super) const ARCHIVE_FILE: &str = "potree1.zip";

/// A head has fields of 64 bits where 32 do not do, and its length is known before the node is.
const TOO_LARGE: &str = "a node of 4 GiB or more, whose points share one place, in an archive";

const WRITING: &str = "writing the archive";

/// Where the head of a file has its checksum.
const CRC_AT: usize = 14;

/// Bytes that are written at once.
const STEP: usize = 1 << 20;

/// An archive while its nodes are made.
pub(super) struct Archive {
    file: DiskFile,
    /// Bytes before the nodes: the head and the room of `cloud.js`.
    start: u64,
    sums: Mutex<Sums>,
}

/// Checksums of nodes.
struct Sums {
    /// With the place of each node.
    nodes: Vec<(u64, u32)>,
    room: Reservation,
    /// Of nodes that come in parts, until they are complete.
    large: HashMap<NodeKey, Large>,
}

#[derive(Default)]
struct Large {
    sum: Crc32,
    bytes: u64,
}

/// The head of a node's file is put before its bytes, which follow.
pub(super) fn begin(metadata: &Metadata, key: NodeKey, out: &mut Vec<u8>) -> usize {
    let start = out.len();
    let name = metadata.node_file(key);
    ArchivedFile { name: &name, bytes: 0, crc: 0, at: 0 }.put_head(0, out);
    out.len() - start
}

/// Bytes of the head of a node's file.
pub(super) fn head_len(metadata: &Metadata, key: NodeKey) -> usize {
    ArchivedFile { name: &metadata.node_file(key), bytes: 0, crc: 0, at: 0 }.head_len()
}

/// The bytes of a node are there: its head, from `start` on and `head` bytes long, is completed.
pub(super) fn end(start: usize, head: usize, out: &mut [u8]) {
    let bytes = &out[start + head..];
    let fields = [crc32(bytes), bytes.len() as u32, bytes.len() as u32].map(u32::to_le_bytes);
    out[start + CRC_AT..start + CRC_AT + 12].copy_from_slice(fields.as_flattened());
}

impl Archive {
    /// Makes the archive, with room for `cloud.js` however many points it will state.
    pub(super) fn new(
        staged: &StagedDataset,
        metadata: &Metadata,
        name: &str,
        rt: &Runtime<'_>,
    ) -> Result<Self, ConvertError> {
        let mut longest = metadata.clone();
        longest.points = Some(u64::MAX);
        let longest = longest.to_json().len();
        let head = ArchivedFile { name: METADATA_FILE, bytes: 0, crc: 0, at: 0 }.head_len();
        let start = (head + MIN_ARCHIVE_PADDING + longest) as u64;
        let room = Reservation::new(&rt.memory, Consumer::Nodes);
        let sums = Mutex::new(Sums { nodes: Vec::new(), room, large: HashMap::new() });
        let OutputFile { file, .. } = staged.past_cache(name, OutputFile::new(staged.create(name)?));
        Ok(Self { file, start, sums })
    }

    /// Writes nodes, whose bytes begin at `offset` of the tree.
    pub(super) fn write(&self, nodes: &[FinishedNode], bytes: &[u8], offset: u64) -> Result<(), ConvertError> {
        self.file.write_at(bytes, self.start + offset, WRITING)?;
        self.file.start_write_back(self.start + offset, bytes.len());
        let mut sums = self.sums.lock().unwrap_or_else(PoisonError::into_inner);
        for node in nodes {
            let head = bytes.get((node.byte_offset - offset) as usize..).unwrap_or_default();
            let crc = head.get(CRC_AT..).and_then(|b| b.first_chunk()).map_or(0, |b| u32::from_le_bytes(*b));
            sums.nodes.push((node.byte_offset, crc));
        }
        let taken = sums.nodes.capacity() * size_of::<(u64, u32)>();
        sums.room.grow_to(taken as u64)
    }

    /// Writes the next part of a node; `name`: of its file, whose head stands before each part, and is written with the last.
    pub(super) fn write_part(&self, node: &FinishedNode, part: &[u8], name: &str) -> Result<(), ConvertError> {
        let mut file = ArchivedFile { name, bytes: 0, crc: 0, at: 0 };
        let head = file.head_len();
        let part = part.get(head..).unwrap_or_default();
        let place = self.start + node.byte_offset;
        let mut sums = self.sums.lock().unwrap_or_else(PoisonError::into_inner);
        let large = sums.large.entry(node.key).or_default();
        let at = place + head as u64 + large.bytes;
        large.bytes += part.len() as u64;
        large.sum.update(part);
        (file.bytes, file.crc) = (large.bytes, large.sum.checksum());
        let is_last = head as u64 + large.bytes == node.byte_size;
        if is_last {
            sums.large.remove(&node.key);
            sums.nodes.push((node.byte_offset, file.crc));
        }
        drop(sums);
        self.file.write_at(part, at, WRITING)?;
        if !is_last {
            return Ok(());
        }
        let mut bytes = Vec::new();
        file.put_head(0, &mut bytes);
        if bytes.len() != head {
            return Err(Unsupported::Format { kind: DatasetKind::Potree1, what: TOO_LARGE.to_owned() }.into());
        }
        self.file.write_at(&bytes, place, WRITING)
    }

    /// Writes all that is not a node, and syncs the archive; returns its bytes. `nodes` are in the order of the tree and have
    /// `bytes` bytes.
    pub(super) fn finish(
        self,
        nodes: &[FinishedNode],
        bytes: u64,
        indexes: &[IndexFile],
        metadata: &Metadata,
        rt: &Runtime<'_>,
    ) -> Result<u64, ConvertError> {
        let Self { file, start, sums } = self;
        let Sums { nodes: mut sums, room: _room, .. } = sums.into_inner().unwrap_or_else(PoisonError::into_inner);
        sums.sort_unstable();
        let mut end = End { file, at: start + bytes, list: Vec::new(), count: 0, list_bytes: 0, pending: Vec::new() };
        let mut files = Vec::with_capacity(indexes.len());
        for index in indexes {
            rt.check_stop()?;
            let name = metadata.index_file(index.root);
            let (at, crc, bytes) = (end.at, crc32(&index.bytes), index.bytes.len() as u64);
            let mut head = Vec::new();
            ArchivedFile { name: &name, bytes, crc, at }.put_head(0, &mut head);
            end.put(&head)?;
            end.put(&index.bytes)?;
            files.push((name, at, crc, bytes));
        }
        let cloud = end.cloud(start, metadata)?;
        end.list(&cloud)?;
        let mut sums = sums.iter();
        for node in nodes {
            let name = metadata.node_file(node.key);
            let Some((_, crc)) = sums.next() else { break };
            let named = ArchivedFile { name: &name, bytes: 0, crc: *crc, at: start + node.byte_offset };
            let file = ArchivedFile { bytes: node.byte_size - named.head_len() as u64, ..named };
            end.list(&file)?;
        }
        for (name, at, crc, bytes) in &files {
            end.list(&ArchivedFile { name, bytes: *bytes, crc: *crc, at: *at })?;
        }
        end.close()
    }
}

/// The archive behind its nodes, from front to back.
struct End {
    file: DiskFile,
    /// Where the next byte goes.
    at: u64,
    /// The directory, as far as it is not written.
    list: Vec<u8>,
    count: u64,
    list_bytes: u64,
    /// What is put and not written.
    pending: Vec<u8>,
}

impl End {
    /// `cloud.js`, in the room before the nodes; what it does not need is padding.
    fn cloud(&self, start: u64, metadata: &Metadata) -> Result<ArchivedFile<'static>, ConvertError> {
        let json = metadata.to_json();
        let file = ArchivedFile { name: METADATA_FILE, bytes: json.len() as u64, crc: crc32(json.as_bytes()), at: 0 };
        let padding = (start as usize).checked_sub(file.head_len() + json.len());
        let padding = padding.filter(|padding| *padding >= MIN_ARCHIVE_PADDING);
        let padding = padding.ok_or_else(|| ConvertError::Internal("cloud.js is longer than its room".into()))?;
        let mut bytes = Vec::new();
        file.put_head(padding, &mut bytes);
        bytes.extend(json.as_bytes());
        self.file.write_at(&bytes, 0, WRITING)?;
        Ok(file)
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), ConvertError> {
        self.pending.extend(bytes);
        self.at += bytes.len() as u64;
        if self.pending.len() >= STEP { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), ConvertError> {
        self.file.write_at(&self.pending, self.at - self.pending.len() as u64, WRITING)?;
        self.pending.clear();
        Ok(())
    }

    /// Adds a file to the directory.
    fn list(&mut self, file: &ArchivedFile<'_>) -> Result<(), ConvertError> {
        self.list.clear();
        file.put_entry(&mut self.list);
        self.count += 1;
        self.list_bytes += self.list.len() as u64;
        let entry = std::mem::take(&mut self.list);
        self.put(&entry)?;
        self.list = entry;
        Ok(())
    }

    /// Writes the end of the archive, and syncs it; returns its bytes.
    fn close(mut self) -> Result<u64, ConvertError> {
        let mut end = Vec::new();
        put_archive_end(self.count, self.at - self.list_bytes, self.list_bytes, &mut end);
        self.put(&end)?;
        self.flush()?;
        self.file.sync("syncing the archive")?;
        Ok(self.at)
    }
}
