//! A dataset that is open for reading.

use std::io;
use std::path::{Path, PathBuf};

use crate::bytes::{ByteSource, Folder, try_resize};
use crate::{NodePoints, ReadError};

use super::read_index::read_index;
use super::{Header, INDEX_FILE, Node, NodeKind, NodePath, PACKED_FILE, leaf_file_name, leaf_points};

/// A mean-split binary tree: its index in memory, its leaves where they are. Threads may share it; reading a leaf keeps
/// nothing.
///
/// Nodes are identified by their index in preorder; the root, if there is one, is 0.
///
/// ```
/// use pointmill_format::bintree::{Bintree, Frustum, switch_distance};
///
/// # fn main() -> Result<(), pointmill_format::ReadError> {
/// let tree = Bintree::open(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/bintree/packed"))?;
/// let bounds = tree.nodes()[0].bounds;
/// let (eye, fov) = ([bounds.min[0] - 10.0, bounds.center()[1], bounds.center()[2]], 60f64.to_radians());
/// let frustum = Frustum::perspective(eye, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0], fov, 16.0 / 9.0, [0.1, 1e4]);
/// for (leaf, material) in tree.draw_list(eye, switch_distance(0.05, fov, 1080.0), Some(&frustum)) {
///     println!("{}: {material:?}", tree.leaf_name(leaf));
/// }
/// # Ok(())
/// # }
/// ```
pub struct Bintree {
    source: Box<dyn ByteSource>,
    header: Header,
    nodes: Vec<Node>,
    max_leaf_bytes: u64,
}

/// Default of [`Bintree::set_max_leaf_bytes`].
const MAX_LEAF_BYTES: u64 = 512 << 20;

impl Bintree {
    /// Opens the dataset in the folder `path` (or beside the `index.json` that is named) and reads its index, flat or nested.
    ///
    /// # Errors
    /// A missing file; an index that section 9 of `docs/formats/bintree.md` refuses, with the byte; byte ranges that
    /// leave `leaves.bin` or overlap.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        Self::from_source(Folder::with_marker(path.as_ref(), INDEX_FILE))
    }

    /// Opens a dataset wherever its bytes are.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn from_source(source: impl ByteSource + 'static) -> Result<Self, ReadError> {
        Self::from_source_within(source, u32::MAX as usize)
    }

    /// As [`Self::from_source`], of at most `most_nodes` nodes: about 100 bytes each, 300 while the nested form is read,
    /// of which a third is accepted.
    ///
    /// # Errors
    /// As [`Self::open`]; more nodes ([`crate::Advice::MoreMemory`]).
    pub fn from_source_within(source: impl ByteSource + 'static, most_nodes: usize) -> Result<Self, ReadError> {
        let (header, nodes) = read_index(&source, most_nodes)?;
        let tree = Self { source: Box::new(source), header, nodes, max_leaf_bytes: MAX_LEAF_BYTES };
        tree.check_ranges()?;
        Ok(tree)
    }

    /// The largest leaf that [`Self::read_leaf`] accepts, in bytes as stored; 512 MiB if nothing is set.
    pub fn set_max_leaf_bytes(&mut self, bytes: u64) {
        self.max_leaf_bytes = bytes;
    }

    /// Everything in the index but the nodes.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// All nodes in preorder; none if the cloud is empty.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// The node of that index, if there is one.
    pub fn node(&self, index: u32) -> Option<&Node> {
        self.nodes.get(index as usize)
    }

    /// The children of a node, low and high; none of a leaf.
    pub fn children(&self, index: u32) -> Option<[u32; 2]> {
        let high = self.node(index)?.high()?;
        Some([index + 1, high])
    }

    /// The indices of all leaves, in preorder.
    pub fn leaves(&self) -> impl Iterator<Item = u32> + '_ {
        (0u32..).zip(&self.nodes).filter(|(_, node)| node.is_leaf()).map(|(index, _)| index)
    }

    /// The way from the root down to a node.
    ///
    /// ```
    /// use pointmill_format::bintree::Bintree;
    ///
    /// # fn main() -> Result<(), pointmill_format::ReadError> {
    /// let tree = Bintree::open(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/bintree/files"))?;
    /// let paths: Vec<String> = tree.leaves().map(|leaf| tree.path(leaf).to_string()).collect();
    /// assert_eq!(paths[..3], ["00", "0100", "01010"]);
    /// # Ok(())
    /// # }
    /// ```
    #[must_use]
    pub fn path(&self, index: u32) -> NodePath {
        let (mut path, mut at) = (Vec::new(), 0);
        while at < index
            && let Some([low, high]) = self.children(at)
        {
            path.push(index >= high);
            at = if index >= high { high } else { low };
        }
        path.into_iter().collect()
    }

    /// What a leaf's file is called in layout `files`; in layout `packed` a name all the same.
    pub fn leaf_name(&self, index: u32) -> String {
        leaf_file_name(self.path(index))
    }

    /// What a file of the dataset is called in messages.
    pub fn locate(&self, file: &str) -> PathBuf {
        self.source.locate(file)
    }

    /// Reads the records of a leaf as stored; replaces the contents of `out`.
    ///
    /// # Errors
    /// An index that is no leaf's; a file that is missing, or not as long as the leaf's points; more bytes than
    /// [`Self::set_max_leaf_bytes`] allows, or than there is memory for ([`crate::Advice::MoreMemory`]).
    pub fn read_leaf_bytes(&self, index: u32, out: &mut Vec<u8>) -> Result<(), ReadError> {
        let Some(&Node { kind: NodeKind::Leaf { start, .. }, count, .. }) = self.node(index) else {
            let what = format!("node {index} is no leaf: only leaves have points");
            return Err(ReadError::unsupported(self.locate(INDEX_FILE), what));
        };
        out.clear();
        let file = if start.is_some() { PACKED_FILE.to_owned() } else { self.leaf_name(index) };
        let io = |e| unread(&self.locate(&file), &format!("reading leaf {index}"), e);
        let (start, needed) = (start.unwrap_or(0), u128::from(count) * self.header.record.stride() as u128);
        // In layout packed the range was checked when the index was read.
        if file != PACKED_FILE {
            let size = self.source.size(&file).map_err(io)?;
            if u128::from(size) != needed {
                let stride = self.header.record.stride();
                let what =
                    format!("leaf {index} has {count} points of {stride} bytes, {needed}, but the file has {size}");
                let at = u64::try_from(needed).unwrap_or(u64::MAX).min(size);
                return Err(ReadError::broken(self.locate(&file), at, what).advise(COPY_AGAIN));
            }
        }
        let room = u64::try_from(needed).ok().filter(|len| *len <= self.max_leaf_bytes);
        let room = room.and_then(|len| try_resize(out, len).ok());
        room.ok_or_else(|| {
            let allowed = self.max_leaf_bytes;
            let why =
                if needed > allowed.into() { format!("{allowed} are allowed") } else { "which is not there".into() };
            let what = format!("leaf {index} would take {needed} bytes of memory, {why}");
            ReadError::memory(self.locate(&file), what)
        })?;
        self.source.read_at(&file, start, out).map_err(io)
    }

    /// Reads the points of a leaf; replaces the contents of `out`. Positions are world coordinates in double, as the
    /// index's boxes are, which contain them exactly. The columns are `classification` (float: whole numbers, if
    /// pointmill wrote them), then those of [`super::RecordLayout::extras`].
    ///
    /// # Errors
    /// As [`Self::read_leaf_bytes`].
    pub fn read_leaf(&self, index: u32, out: &mut NodePoints) -> Result<(), ReadError> {
        let record = &self.header.record;
        leaf_points::reset(out, record);
        self.read_leaf_bytes(index, &mut out.stored)?;
        if let Some(Node { kind: NodeKind::Leaf { center, .. }, .. }) = self.node(index) {
            leaf_points::fill(out, record, *center);
        }
        Ok(())
    }

    /// Layout `packed`: every range is in the file, and no byte is in two.
    fn check_ranges(&self) -> Result<(), ReadError> {
        let stride = self.header.record.stride() as u64;
        let mut ranges = Vec::new();
        for (index, node) in (0u32..).zip(&self.nodes) {
            if let NodeKind::Leaf { start: Some(start), .. } = node.kind {
                let end = node.count.checked_mul(stride).and_then(|bytes| start.checked_add(bytes));
                ranges.push((start, end, index));
            }
        }
        if ranges.is_empty() {
            return Ok(());
        }
        let path = self.locate(PACKED_FILE);
        let size = self.source.size(PACKED_FILE).map_err(|e| unread(&path, "opening", e))?;
        ranges.sort_unstable();
        let (mut last_end, mut last) = (0, 0);
        for (start, end, index) in ranges {
            let Some(end) = end.filter(|end| *end <= size) else {
                let count = self.nodes[index as usize].count;
                let what =
                    format!("leaf {index} has {count} points from byte {start} on, but the file has {size} bytes");
                return Err(ReadError::broken(path, start, what).advise(COPY_AGAIN));
            };
            if start < last_end {
                let what =
                    format!("the points of leaf {index} begin before those of leaf {last} end, at byte {last_end}");
                return Err(ReadError::broken(path, start, what).advise("convert the sources again"));
            }
            (last_end, last) = (end, index);
        }
        Ok(())
    }
}

const COPY_AGAIN: &str = "the file was cut short or belongs to another dataset; copy or convert it again";

/// A file of leaves that is not there is a fault of the dataset, not of the system.
fn unread(path: &Path, doing: &str, error: io::Error) -> ReadError {
    match error.kind() {
        io::ErrorKind::NotFound => ReadError::broken(path, None, "is missing"),
        _ => ReadError::io(path, doing, error),
    }
    .advise(COPY_AGAIN)
}

impl std::fmt::Debug for Bintree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let at = self.locate(INDEX_FILE);
        f.debug_struct("Bintree").field("at", &at).field("nodes", &self.nodes.len()).finish_non_exhaustive()
    }
}
