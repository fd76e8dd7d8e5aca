//! A dataset that is open for reading.

use std::collections::VecDeque;
use std::io;
use std::path::{Path, PathBuf};

use crate::bytes::{ByteSource, Folder, STEP};
use crate::octree::{ChunkRanges, OctreeInfo};
use crate::{NodeKey, ReadError};

use super::chunk::Parser;
use super::{HIERARCHY_FILE, METADATA_FILE, Metadata, Node, NodeRecord, OCTREE_FILE};

/// More JSON than this is not metadata.
const MAX_METADATA_BYTES: u64 = 16 << 20;

/// Default of [`Dataset::set_max_node_bytes`].
const MAX_NODE_BYTES: u64 = 512 << 20;

/// A Potree 2.0 dataset. Threads may share it; every method reads what it needs and keeps nothing.
///
/// ```
/// use pointmill_format::bytes::Folder;
/// use pointmill_format::potree2::Dataset;
///
/// # fn main() -> Result<(), pointmill_format::ReadError> {
/// let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/potree2/default");
/// let dataset = Dataset::open(folder)?;
/// // the same from any source of bytes
/// let again = Dataset::from_source(Folder::new(folder))?;
/// assert_eq!(dataset.read_root_chunk()?, again.read_root_chunk()?);
/// # Ok(())
/// # }
/// ```
pub struct Dataset {
    pub(super) source: Box<dyn ByteSource>,
    pub(super) metadata: Metadata,
    pub(super) info: OctreeInfo,
    hierarchy_bytes: u64,
    octree_bytes: u64,
    pub(super) max_node_bytes: u64,
}

impl Dataset {
    /// Opens the dataset in the folder `path` (or beside the `metadata.json` that is named) and reads its metadata.
    ///
    /// # Errors
    /// A missing file, or those of [`Metadata::from_json`].
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        Self::from_source(Folder::with_marker(path.as_ref(), METADATA_FILE))
    }

    /// Opens a dataset wherever its bytes are.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn from_source(source: impl ByteSource + 'static) -> Result<Self, ReadError> {
        let size = |file| {
            source.size(file).map_err(|e| {
                let path = source.locate(file);
                match e.kind() {
                    // a dataset is there, but not all of it
                    io::ErrorKind::NotFound if file != METADATA_FILE => ReadError::broken(path, None, "is missing"),
                    _ => ReadError::io(path, "opening", e),
                }
                .advise("a Potree 2.0 dataset is a folder with metadata.json, hierarchy.bin and octree.bin")
            })
        };
        let path = source.locate(METADATA_FILE);
        let metadata_bytes = size(METADATA_FILE)?;
        let (hierarchy_bytes, octree_bytes) = (size(HIERARCHY_FILE)?, size(OCTREE_FILE)?);
        if metadata_bytes > MAX_METADATA_BYTES {
            let what = format!("{metadata_bytes} bytes are too many for metadata (at most {MAX_METADATA_BYTES})");
            return Err(ReadError::broken(path, None, what));
        }
        let mut bytes = vec![0; metadata_bytes as usize];
        source.read_at(METADATA_FILE, 0, &mut bytes).map_err(|e| ReadError::io(&path, "reading", e))?;
        let metadata = Metadata::from_json(&bytes, &path)?;
        let (source, info) = (Box::new(source), metadata.octree_info());
        Ok(Self { source, metadata, info, hierarchy_bytes, octree_bytes, max_node_bytes: MAX_NODE_BYTES })
    }

    /// What `metadata.json` says.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Bytes of `hierarchy.bin`.
    pub fn hierarchy_bytes(&self) -> u64 {
        self.hierarchy_bytes
    }

    /// Bytes of `octree.bin`.
    pub fn octree_bytes(&self) -> u64 {
        self.octree_bytes
    }

    /// What a file of the dataset is called in messages.
    pub fn locate(&self, file: &str) -> PathBuf {
        self.source.locate(file)
    }

    /// The largest payload, stored or decompressed, that [`Self::read_points`] accepts, in bytes; 512 MiB if nothing is
    /// set.
    pub fn set_max_node_bytes(&mut self, bytes: u64) {
        self.max_node_bytes = bytes;
    }

    /// Reads one hierarchy chunk: the subtree of `root`, breadth first, `root` first, proxies as they stand.
    ///
    /// `byte_offset` and `byte_size` are those of the proxy record of `root`.
    ///
    /// # Errors
    /// A range outside the file, or records that do not form a tree.
    pub fn read_chunk(&self, root: NodeKey, byte_offset: u64, byte_size: u64) -> Result<Vec<Node>, ReadError> {
        let file = HIERARCHY_FILE;
        self.check_range(file, byte_offset, byte_size, || format!("the hierarchy chunk of {root}"))?;
        let path = self.locate(file);
        let mut chunk = Parser::new(root, byte_offset, byte_size, &path)?;
        let step = STEP - STEP % NodeRecord::LEN as u64;
        let mut bytes = Vec::new();
        for at in (0..byte_size).step_by(step as usize) {
            bytes.resize((byte_size - at).min(step) as usize, 0);
            let read = self.source.read_at(file, byte_offset + at, &mut bytes);
            read.map_err(|e| ReadError::io(&path, "reading", e))?;
            chunk.take(&bytes)?;
        }
        Ok(chunk.finish())
    }

    /// Reads the chunk of the root.
    ///
    /// # Errors
    /// As [`Self::read_chunk`].
    pub fn read_root_chunk(&self) -> Result<Vec<Node>, ReadError> {
        self.read_chunk(NodeKey::ROOT, 0, self.metadata.first_chunk_size)
    }

    /// Reads all nodes, by level and then by name. Every node appears once; there are no proxies among them.
    ///
    /// # Errors
    /// As [`Self::read_chunk`]; chunks that overlap (and so also proxies that go round in circles).
    pub fn read_hierarchy(&self) -> Result<Vec<Node>, ReadError> {
        let path = self.locate(HIERARCHY_FILE);
        let mut ranges = ChunkRanges::default();
        let mut nodes = Vec::new();
        let mut queue = VecDeque::from([(NodeKey::ROOT, 0, self.metadata.first_chunk_size)]);
        while let Some((root, offset, size)) = queue.pop_front() {
            ranges.claim(root, offset, size, &path)?;
            for node in self.read_chunk(root, offset, size)? {
                if !node.record.is_proxy() {
                    nodes.push(node);
                } else if node.key == root {
                    let what = format!("the hierarchy chunk of {root} begins with a proxy");
                    return Err(ReadError::broken(path, offset, what));
                } else {
                    queue.push_back((node.key, node.record.byte_offset, node.record.byte_size));
                }
            }
        }
        nodes.sort_by_cached_key(|n| n.key.breadth_first_rank());
        Ok(nodes)
    }

    pub(super) fn check_range(
        &self,
        file: &str,
        offset: u64,
        size: u64,
        who: impl Fn() -> String,
    ) -> Result<(), ReadError> {
        let available = match file {
            HIERARCHY_FILE => self.hierarchy_bytes,
            _ => self.octree_bytes,
        };
        match offset.checked_add(size) {
            Some(end) if end <= available => Ok(()),
            _ => {
                let what = format!("{} needs {size} bytes, but {} has {available}", who(), file);
                let advice = "the file was cut short or belongs to another dataset; copy or convert it again";
                Err(ReadError::broken(self.locate(file), offset, what).advise(advice))
            }
        }
    }
}

impl std::fmt::Debug for Dataset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Dataset").field("at", &self.locate(METADATA_FILE)).finish_non_exhaustive()
    }
}
