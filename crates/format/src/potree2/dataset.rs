//! A dataset that is open for reading.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};

use crate::bytes::{ByteSource, Folder};
use crate::{NodeKey, NodePoints, Positions, ReadError};

use super::brotli::{self, Fault};
use super::chunk::{self, ChunkRanges};
use super::morton::breadth_first_rank;
use super::{Encoding, HIERARCHY_FILE, METADATA_FILE, Metadata, Node, NodeRecord, OCTREE_FILE, node_points};

/// More JSON than this is not metadata.
const MAX_METADATA_BYTES: u64 = 16 << 20;

/// No Brotli stream gives more bytes than this per compressed byte: a meta-block gives at most 16 MiB and has a header
/// of more than a byte (RFC 7932, section 9.2).
const MAX_BROTLI_RATIO: u64 = 1 << 24;

/// Default of [`Dataset::set_max_node_bytes`].
const MAX_NODE_BYTES: u64 = 4 << 30;

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
    source: Box<dyn ByteSource>,
    metadata: Metadata,
    hierarchy_bytes: u64,
    octree_bytes: u64,
    max_node_bytes: u64,
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
                ReadError::io(source.locate(file), "opening", e)
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
        let source = Box::new(source);
        Ok(Self { source, metadata, hierarchy_bytes, octree_bytes, max_node_bytes: MAX_NODE_BYTES })
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

    /// The largest decompressed payload that [`Self::read_points`] accepts, in bytes; 4 GiB if nothing is set. Only
    /// BROTLI datasets need it: others hold no more than the file.
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
        let mut bytes = vec![0; as_len(byte_size, &path)?];
        self.source.read_at(file, byte_offset, &mut bytes).map_err(|e| ReadError::io(&path, "reading", e))?;
        chunk::parse(root, &bytes, byte_offset, &path)
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
        nodes.sort_by_cached_key(|n| breadth_first_rank(n.key));
        Ok(nodes)
    }

    /// Reads the payload of a node as stored; replaces the contents of `out`.
    ///
    /// # Errors
    /// A proxy (load its chunk first), or a range outside `octree.bin`.
    pub fn read_payload(&self, node: &Node, out: &mut Vec<u8>) -> Result<(), ReadError> {
        let Node { key, record } = *node;
        let path = self.locate(OCTREE_FILE);
        if record.is_proxy() {
            let what = format!("node {key} is a proxy: its hierarchy chunk describes the payload");
            return Err(ReadError::unsupported(path, what));
        }
        out.clear();
        if record.byte_size == 0 {
            return Ok(());
        }
        self.check_range(OCTREE_FILE, record.byte_offset, record.byte_size, || format!("node {key}"))?;
        out.resize(as_len(record.byte_size, &path)?, 0);
        let read = self.source.read_at(OCTREE_FILE, record.byte_offset, out);
        read.map_err(|e| ReadError::io(path, &format!("reading node {key}"), e))
    }

    /// Reads the points of a node; replaces the contents of `out`. A node without payload has no points, whatever its
    /// record claims (PotreeConverter 2.0 wrote such nodes).
    ///
    /// # Errors
    /// As [`Self::read_payload`]; a payload that does not hold just as many points as the record says.
    pub fn read_points(&self, node: &Node, out: &mut NodePoints) -> Result<(), ReadError> {
        let columns = self.metadata.attributes.iter().map(|a| &a.attribute).filter(|a| a.name != "position");
        out.reset(columns.map(|a| (a.name.as_str(), a.ty)));
        let mut positions = out.take_quantized();
        let filled = self.fill(node, &mut positions, out);
        out.positions = Positions::Quantized(positions);
        out.lattice = self.metadata.lattice;
        filled
    }

    fn fill(&self, node: &Node, positions: &mut [Vec<i32>; 3], out: &mut NodePoints) -> Result<(), ReadError> {
        self.read_payload(node, &mut out.stored)?;
        if out.stored.is_empty() {
            return Ok(());
        }
        match self.metadata.encoding {
            Encoding::Default => {
                self.check_record_count(node)?;
                node_points::fill_from_records(&out.stored, &self.metadata, positions, &mut out.columns);
            }
            Encoding::Brotli => {
                self.decompress(node, &out.stored, &mut out.unpacked)?;
                let points = node.record.points as usize;
                node_points::fill_from_planes(&out.unpacked, points, &self.metadata, positions, &mut out.columns);
            }
        }
        Ok(())
    }

    fn check_record_count(&self, node: &Node) -> Result<(), ReadError> {
        let NodeRecord { points, byte_size, byte_offset, .. } = node.record;
        let expected = u128::from(points) * self.metadata.record_len() as u128;
        if expected == u128::from(byte_size) {
            return Ok(());
        }
        let what = format!(
            "node {} has {byte_size} bytes, but {points} points of {} bytes are {expected}",
            node.key,
            self.metadata.record_len()
        );
        Err(ReadError::broken(self.locate(OCTREE_FILE), byte_offset, what))
    }

    fn decompress(&self, node: &Node, stored: &[u8], planes: &mut Vec<u8>) -> Result<(), ReadError> {
        let NodeRecord { points, byte_size, byte_offset, .. } = node.record;
        let broken = |what: String| {
            let what = format!("node {} {what}", node.key);
            ReadError::broken(self.locate(OCTREE_FILE), byte_offset, what)
        };
        let expected = u128::from(points) * self.metadata.planar_len() as u128;
        if expected > u128::from(byte_size) * u128::from(MAX_BROTLI_RATIO) {
            return Err(broken(format!("claims {points} points, more than {byte_size} compressed bytes can hold")));
        }
        let len = usize::try_from(expected).ok().filter(|_| expected <= u128::from(self.max_node_bytes));
        let Some(len) = len else {
            let what = format!("would take {expected} bytes of memory, {} are allowed", self.max_node_bytes);
            return Err(broken(what));
        };
        brotli::decompress(stored, len, planes).map_err(|fault| match fault {
            Fault::Corrupt => broken("is not a Brotli stream, or a damaged one".into()),
            Fault::Short(got) => broken(format!("decompresses to {got} bytes, its {points} points need {len}")),
            Fault::Long => broken(format!("decompresses to more than the {len} bytes of its {points} points")),
        })
    }

    fn check_range(&self, file: &str, offset: u64, size: u64, who: impl Fn() -> String) -> Result<(), ReadError> {
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

/// `size`, already checked against the file, as a length in memory.
fn as_len(size: u64, path: &Path) -> Result<usize, ReadError> {
    usize::try_from(size).map_err(|_| ReadError::unsupported(path, format!("{size} bytes at once do not fit memory")))
}
