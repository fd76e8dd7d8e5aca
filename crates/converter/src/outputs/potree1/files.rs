//! Where the bytes of nodes go: a file each, in nested folders, or in one archive.

use std::collections::HashSet;
use std::sync::{Mutex, PoisonError};

use pointmill_format::NodeKey;
use pointmill_format::potree1::Metadata;

use super::archive::{ARCHIVE_FILE, Archive};
use super::encoder::{Encoding, RecordEncoder};
use crate::error::ConvertError;
use crate::job::{KeptFile, decode};
use crate::octree::{FinishedNode, NodeSink};
use crate::outputs::staging::StagedDataset;
use crate::runtime::{Consumer, Reservation, Runtime};

/// The system is asked to begin writing files of this size at once: of smaller ones the requests cost more than they gain.
const LARGE_BYTES: usize = 128 << 10;

const WRITING: &str = "writing a node";

/// The files of nodes while they are made.
pub(super) struct NodeFiles<'a> {
    encoding: Encoding<'a>,
    /// Says what files are called.
    metadata: Metadata,
    staged: &'a StagedDataset,
    folders: Mutex<Folders>,
    /// In place of files.
    archive: Option<Archive>,
}

/// Folders that were made.
struct Folders {
    /// By the node that they are named after.
    made: HashSet<NodeKey>,
    room: Reservation,
}

impl<'a> NodeFiles<'a> {
    pub(super) fn new(
        encoding: Encoding<'a>,
        metadata: Metadata,
        staged: &'a StagedDataset,
        rt: &Runtime<'_>,
    ) -> Result<Self, ConvertError> {
        let archive = match &encoding.archived {
            Some(_) => Some(Archive::new(staged, &metadata, ARCHIVE_FILE, rt)?),
            None => {
                staged.create_folder(&metadata.octree_dir)?;
                None
            }
        };
        let folders = Folders { made: HashSet::new(), room: Reservation::new(&rt.memory, Consumer::Nodes) };
        Ok(Self { encoding, metadata, staged, folders: Mutex::new(folders), archive })
    }

    /// What is known of the dataset.
    pub(super) fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// What they were made with, once all are; and the archive, if that is where nodes went.
    pub(super) fn into_parts(self) -> (Encoding<'a>, Metadata, Option<Archive>) {
        (self.encoding, self.metadata, self.archive)
    }

    /// Writes the file of a node.
    fn put(&self, node: &FinishedNode, bytes: &[u8]) -> Result<(), ConvertError> {
        self.make_folders(node.key)?;
        let file = self.staged.create(&self.metadata.node_file(node.key))?;
        file.write_at(bytes, 0, WRITING)?;
        if bytes.len() >= LARGE_BYTES {
            file.start_write_back(0, bytes.len());
        }
        Ok(())
    }

    /// The folder that is named after a node.
    fn folder(&self, key: NodeKey) -> String {
        let file = self.metadata.node_file(key);
        file.rsplit_once('/').map_or_else(String::new, |(folder, _)| folder.to_owned())
    }

    /// Makes the folder of a node, and those above it.
    fn make_folders(&self, key: NodeKey) -> Result<(), ConvertError> {
        let step = self.metadata.step.max(1) as usize;
        let mut folders = self.folders.lock().unwrap_or_else(PoisonError::into_inner);
        let level = usize::from(key.level) / step * step;
        let own = |level: usize| key.ancestor(level as u8);
        if own(level).is_some_and(|folder| folders.made.contains(&folder)) {
            return Ok(());
        }
        for folder in (0..=level).step_by(step).filter_map(own) {
            if folders.made.insert(folder) {
                self.staged.create_folder(&self.folder(folder))?;
            }
        }
        let bytes = folders.made.capacity() * 2 * size_of::<NodeKey>();
        folders.room.grow_to(bytes as u64)
    }

    /// Waits until all files of these nodes and of these index files, and their names, are safe.
    pub(super) fn sync(
        &self,
        nodes: &[FinishedNode],
        indexes: &[NodeKey],
        rt: &Runtime<'_>,
    ) -> Result<(), ConvertError> {
        let folders = self.folders.lock().unwrap_or_else(PoisonError::into_inner);
        let mut names: Vec<String> = folders.made.iter().map(|key| self.folder(*key)).collect();
        names.push(self.metadata.octree_dir.clone());
        let file = |i: usize| match nodes.get(i) {
            Some(node) => self.metadata.node_file(node.key),
            None => self.metadata.index_file(indexes[i - nodes.len()]),
        };
        self.staged.sync_all(rt, nodes.len() + indexes.len(), file, &names)
    }
}

impl NodeSink for NodeFiles<'_> {
    type Encoder<'s>
        = RecordEncoder<'s>
    where
        Self: 's;

    fn encoder(&self) -> RecordEncoder<'_> {
        RecordEncoder::new(&self.encoding)
    }

    fn write(&self, nodes: &[FinishedNode], bytes: &[u8], offset: u64) -> Result<(), ConvertError> {
        if let Some(archive) = &self.archive {
            return archive.write(nodes, bytes, offset);
        }
        for node in nodes {
            let from = (node.byte_offset - offset) as usize;
            self.put(node, &bytes[from..from + node.byte_size as usize])?;
        }
        Ok(())
    }

    fn add_notes(&self, notes: &[u8]) -> Result<(), ConvertError> {
        let notes = decode(notes)?;
        self.encoding.tally.lock().unwrap_or_else(PoisonError::into_inner).merge(&notes);
        Ok(())
    }

    fn kept(&self) -> Option<KeptFile<'_>> {
        None // a file for each node
    }

    fn write_part(&self, node: &FinishedNode, bytes: &[u8], at: u64) -> Result<(), ConvertError> {
        if let Some(archive) = &self.archive {
            return archive.write_part(node, bytes, &self.metadata.node_file(node.key));
        }
        if at == 0 {
            return self.put(node, bytes);
        }
        self.staged.open(&self.metadata.node_file(node.key))?.write_at(bytes, at, WRITING)
    }
}
