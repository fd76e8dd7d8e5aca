//! A dataset that is open for reading.

use std::io;
use std::path::{Path, PathBuf};

use crate::bytes::{ByteSource, FolderTree, STEP, try_resize};
use crate::octree::OctreeInfo;
use crate::{NodeKey, ReadError};

use super::index::{Parser, from_list};
use super::{IndexRecord, METADATA_FILE, Metadata, Node, NodeFiles};

/// More JSON than this is not metadata, even with all nodes of version 1.4 in it.
const MAX_METADATA_BYTES: u64 = 256 << 20;

/// Default of [`Dataset::set_max_node_bytes`].
const MAX_NODE_BYTES: u64 = 512 << 20;

/// A Potree 1.x dataset. Threads may share it; every method reads what it needs and keeps nothing.
///
/// ```
/// use pointmill_format::potree1::Dataset;
/// use pointmill_format::NodePoints;
///
/// # fn main() -> Result<(), pointmill_format::ReadError> {
/// let dataset = Dataset::open(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/potree1/words"))?;
/// let mut points = NodePoints::default();
/// for node in dataset.read_hierarchy()? {
///     dataset.read_points(node.key, &mut points)?;
///     assert_eq!(points.len() as u64, dataset.count(node.key)?);
///     println!("{}: {} points, {} by the index", node.key, points.len(), node.declared);
/// }
/// # Ok(())
/// # }
/// ```
pub struct Dataset {
    pub(super) source: Box<dyn ByteSource>,
    pub(super) metadata: Metadata,
    pub(super) info: OctreeInfo,
    /// The nodes are those of [`Metadata::nodes`].
    is_list: bool,
    pub(super) max_node_bytes: u64,
}

impl Dataset {
    /// Opens the dataset in the folder `path` (or beside the `cloud.js` that is named) and reads its metadata.
    ///
    /// # Errors
    /// A missing file, or those of [`Metadata::from_json`]; of datasets of LAS or LAZ files, the first of these.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let path = path.as_ref();
        let is_marker = path.file_name().is_some_and(|name| name == METADATA_FILE);
        let folder = if is_marker { path.parent().unwrap_or(path) } else { path };
        Self::from_source(FolderTree::new(folder))
    }

    /// Opens a dataset wherever its bytes are, by names as `data/r/01234/r01234.bin`. LAS and LAZ files have to be files,
    /// where [`ByteSource::locate`] says.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn from_source(source: impl ByteSource + 'static) -> Result<Self, ReadError> {
        let path = source.locate(METADATA_FILE);
        let advice = "a Potree 1.x dataset is a folder with cloud.js and the folder that it names";
        let size = source.size(METADATA_FILE).map_err(|e| ReadError::io(&path, "opening", e).advise(advice))?;
        if size > MAX_METADATA_BYTES {
            let what = format!("{size} bytes are too many for metadata (at most {MAX_METADATA_BYTES})");
            return Err(ReadError::broken(path, None, what));
        }
        let bytes = read(&source, METADATA_FILE, size)?;
        let metadata = Metadata::from_json(&bytes, &path)?;
        let has_index = || source.size(&metadata.index_file(NodeKey::ROOT)).is_ok();
        let is_list = metadata.nodes.is_some() && !(metadata.has_folders() && has_index());
        let info = metadata.octree_info();
        let mut dataset = Self { source: Box::new(source), metadata, info, is_list, max_node_bytes: MAX_NODE_BYTES };
        if dataset.metadata.files != NodeFiles::Bin {
            dataset.info.attributes = dataset.las_attributes()?;
        }
        Ok(dataset)
    }

    /// What `cloud.js` says.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// What a file of the dataset is called in messages.
    pub fn locate(&self, file: &str) -> PathBuf {
        self.source.locate(file)
    }

    /// The largest file of a node that [`Self::read_points`] accepts, in bytes (of LAZ files: of the points in memory); 512
    /// MiB if nothing is set.
    pub fn set_max_node_bytes(&mut self, bytes: u64) {
        self.max_node_bytes = bytes;
    }

    /// Reads one index file: the node `root` and what is below it, breadth first, down to the proxies; of version 1.4 all
    /// nodes.
    ///
    /// # Errors
    /// A missing file, or records that do not form a tree.
    pub fn read_index(&self, root: NodeKey) -> Result<Vec<Node>, ReadError> {
        if let Some(list) = self.metadata.nodes.as_ref().filter(|_| self.is_list) {
            return from_list(list, &self.locate(METADATA_FILE));
        }
        let file = self.metadata.index_file(root);
        let path = self.locate(&file);
        let size = self.size(&file)?;
        if !size.is_multiple_of(IndexRecord::LEN as u64) || size == 0 {
            let what = format!("the index of {root} has {size} bytes, not a multiple of {}", IndexRecord::LEN);
            return Err(ReadError::broken(path, None, what));
        }
        let mut parser = Parser::new(root, self.metadata.step, &path);
        let step = STEP - STEP % IndexRecord::LEN as u64;
        let mut bytes = Vec::new();
        for at in (0..size).step_by(step as usize) {
            bytes.resize((size - at).min(step) as usize, 0);
            self.source.read_at(&file, at, &mut bytes).map_err(|e| ReadError::io(&path, "reading", e))?;
            parser.take(&bytes)?;
        }
        parser.finish()
    }

    /// Reads all nodes, by level and then by name. Every node appears once; there are no proxies among them.
    ///
    /// # Errors
    /// As [`Self::read_index`].
    pub fn read_hierarchy(&self) -> Result<Vec<Node>, ReadError> {
        let (mut nodes, mut waiting) = (Vec::new(), vec![NodeKey::ROOT]);
        while let Some(root) = waiting.pop() {
            for node in self.read_index(root)? {
                if node.is_proxy { waiting.push(node.key) } else { nodes.push(node) }
            }
        }
        nodes.sort_by_cached_key(|node| node.key.breadth_first_rank());
        Ok(nodes)
    }

    /// How many points a node has, by the size of its file (of LAS files by their header).
    ///
    /// # Errors
    /// A missing file, or one that does not end with a whole record.
    pub fn count(&self, key: NodeKey) -> Result<u64, ReadError> {
        if self.metadata.files != NodeFiles::Bin {
            return self.las_count(key);
        }
        let file = self.metadata.node_file(key);
        let (size, record_len) = (self.size(&file)?, self.metadata.record_len() as u64);
        if size.is_multiple_of(record_len) {
            return Ok(size / record_len);
        }
        let what = format!("node {key} has {size} bytes, no whole number of records of {record_len}");
        Err(ReadError::broken(self.locate(&file), size - size % record_len, what).advise(crate::Advice::CutShort))
    }

    /// Reads the file of a node as stored; replaces the contents of `out`.
    ///
    /// # Errors
    /// As [`Self::count`]; more bytes than [`Self::set_max_node_bytes`] allows, or than there is memory for
    /// ([`crate::Advice::MoreMemory`]).
    pub fn read_payload(&self, key: NodeKey, out: &mut Vec<u8>) -> Result<(), ReadError> {
        let file = self.metadata.node_file(key);
        let size = self.size(&file)?;
        if size > self.max_node_bytes {
            return Err(self.no_room(key, size));
        }
        out.clear();
        try_resize(out, size).map_err(|_| self.no_room(key, size))?;
        let read = self.source.read_at(&file, 0, out);
        read.map_err(|e| ReadError::io(self.locate(&file), &format!("reading node {key}"), e))
    }

    /// A node that takes more memory than there is, or than is allowed.
    pub(super) fn no_room(&self, key: NodeKey, bytes: u64) -> ReadError {
        let allowed = self.max_node_bytes;
        let why = if bytes > allowed { format!("{allowed} are allowed") } else { "which is not there".into() };
        let what = format!("node {key} would take {bytes} bytes of memory, {why}");
        ReadError::memory(self.locate(&self.metadata.node_file(key)), what)
    }

    /// Bytes of a file that the index promises.
    fn size(&self, file: &str) -> Result<u64, ReadError> {
        self.source.size(file).map_err(|e| match e.kind() {
            // a dataset is there, but not all of it
            io::ErrorKind::NotFound => ReadError::broken(self.locate(file), None, "is missing")
                .advise("the dataset was copied in part, or deleted in part; copy or convert it again"),
            _ => ReadError::io(self.locate(file), "opening", e),
        })
    }
}

/// A whole file of `size` bytes.
fn read(source: &impl ByteSource, file: &str, size: u64) -> Result<Vec<u8>, ReadError> {
    let mut bytes = Vec::new();
    let read = try_resize(&mut bytes, size).and_then(|()| source.read_at(file, 0, &mut bytes));
    read.map_err(|e| ReadError::io(source.locate(file), "reading", e))?;
    Ok(bytes)
}

impl std::fmt::Debug for Dataset {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Dataset").field("at", &self.locate(METADATA_FILE)).finish_non_exhaustive()
    }
}
