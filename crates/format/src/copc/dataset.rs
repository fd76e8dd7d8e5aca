//! A COPC file that is open for reading.

use std::collections::VecDeque;
use std::path::Path;

use crate::bytes::{ByteSource, STEP};
use crate::octree::{ChunkRanges, OctreeInfo, OctreeNode};
use crate::scan::las::{ChunkFile, ChunkPlace};
use crate::{Aabb, Advice, Crs, Fault, Lattice, NodeKey, NodePoints, Positions, ReadError, ScanWarning};

use super::page::{Limits, Page};
use super::{Entry, Info};

/// Default of [`Dataset::set_max_node_bytes`].
const MAX_NODE_BYTES: u64 = 512 << 20;

/// A COPC file. Threads may share it; every method reads what it needs and keeps nothing of it.
///
/// ```
/// use pointmill_format::bytes::Memory;
/// use pointmill_format::copc::Dataset;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/copc/pages.copc.laz");
/// let dataset = Dataset::open(file)?;
/// // the same from any source of bytes
/// let source = Memory::from([("a.copc.laz".to_owned(), std::fs::read(file)?)]);
/// let again = Dataset::from_source(source, "a.copc.laz")?;
/// assert_eq!(dataset.read_hierarchy()?, again.read_hierarchy()?);
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Dataset {
    file: ChunkFile,
    copc: Info,
    pub(super) info: OctreeInfo,
    max_node_bytes: u64,
}

impl Dataset {
    /// Opens the file at `path`: reads its header and records, no points and no hierarchy.
    ///
    /// # Errors
    /// No LAS file, or none that is COPC; an info record that makes no sense.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        Self::new(ChunkFile::open(path.as_ref())?)
    }

    /// Opens the file `file` of a source, wherever its bytes are.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn from_source(source: impl ByteSource + 'static, file: &str) -> Result<Self, ReadError> {
        Self::new(ChunkFile::from_source(source, file)?)
    }

    fn new(file: ChunkFile) -> Result<Self, ReadError> {
        let copc = info_record(&file)?;
        let mut info = OctreeInfo::new(file.format.clone(), copc.cube(), copc.spacing, file.attributes().to_vec());
        info.points = Some(file.points);
        Ok(Self { file, copc, info, max_node_bytes: MAX_NODE_BYTES })
    }

    /// What the info record says.
    pub fn copc_info(&self) -> &Info {
        &self.copc
    }

    /// LAS point format: 6, 7 or 8.
    pub fn point_format(&self) -> u8 {
        self.file.point_format
    }

    /// The number of points by the header of the file, unchecked.
    pub fn points_declared(&self) -> u64 {
        self.file.points
    }

    /// The box of the points by the header of the file, unchecked; `None` if it says nothing or nonsense.
    pub fn bounds_declared(&self) -> Option<Aabb> {
        self.file.bounds
    }

    /// What the positions of all nodes are on.
    pub fn lattice(&self) -> Lattice {
        self.file.lattice
    }

    /// The coordinate reference system.
    pub fn crs(&self) -> &Crs {
        &self.file.crs
    }

    /// Disagreements in the header and the records that did not stop the reader.
    pub fn warnings(&self) -> &[ScanWarning] {
        &self.file.warnings
    }

    /// Bytes of the file.
    pub fn file_bytes(&self) -> u64 {
        self.file.len()
    }

    /// What the file is called in messages.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// The most bytes that the points of a node may have, stored or as records, in [`Self::read_points`]; 512 MiB if nothing is
    /// set.
    pub fn set_max_node_bytes(&mut self, bytes: u64) {
        self.max_node_bytes = bytes;
    }

    /// Reads one page of the hierarchy: the subtree of `root`, breadth first, `root` first, down to the nodes of other pages
    /// ([`OctreeNode::is_proxy`]).
    ///
    /// `byte_offset` and `byte_size` are those of the proxy of `root`, or of the info record.
    ///
    /// # Errors
    /// Bytes outside of the file; entries that make no tree, or refer to what is not in the file.
    pub fn read_page(&self, root: NodeKey, byte_offset: u64, byte_size: u64) -> Result<Vec<OctreeNode>, ReadError> {
        let (path, file_bytes, chunks_start) = (self.file.path(), self.file.len(), self.file.chunks_start());
        let range = byte_offset..byte_offset.saturating_add(byte_size);
        let mut page = Page::new(root, range, Limits { path, chunks_start, file_bytes })?;
        let step = STEP - STEP % Entry::LEN as u64;
        let mut bytes = Vec::new();
        for at in (0..byte_size).step_by(step as usize) {
            bytes.resize((byte_size - at).min(step) as usize, 0);
            self.file.read_at(byte_offset + at, &mut bytes)?;
            page.take(&bytes)?;
        }
        page.finish()
    }

    /// Reads the page of the root.
    ///
    /// # Errors
    /// As [`Self::read_page`].
    pub fn read_root_page(&self) -> Result<Vec<OctreeNode>, ReadError> {
        self.read_page(NodeKey::ROOT, self.copc.root_page_offset, self.copc.root_page_size)
    }

    /// Reads all nodes, by level and then by name. Every node appears once; there are no proxies among them.
    ///
    /// # Errors
    /// As [`Self::read_page`]; pages (and so also those that go round in circles) or chunks that overlap.
    pub fn read_hierarchy(&self) -> Result<Vec<OctreeNode>, ReadError> {
        let (mut ranges, mut nodes) = (ChunkRanges::default(), Vec::new());
        let Info { root_page_offset: offset, root_page_size: size, .. } = self.copc;
        let mut queue = VecDeque::from([(NodeKey::ROOT, offset, size)]);
        while let Some((root, offset, size)) = queue.pop_front() {
            ranges.claim(root, offset, size, self.file.path())?;
            for node in self.read_page(root, offset, size)? {
                if node.is_proxy {
                    queue.push_back((node.key, node.byte_offset, node.byte_size));
                } else {
                    nodes.push(node);
                }
            }
        }
        nodes.sort_by_cached_key(|node| node.key.breadth_first_rank());
        self.check_chunks(&nodes)?;
        Ok(nodes)
    }

    /// An error if two nodes share bytes.
    fn check_chunks(&self, nodes: &[OctreeNode]) -> Result<(), ReadError> {
        let mut chunks: Vec<&OctreeNode> = nodes.iter().filter(|node| node.byte_size > 0).collect();
        chunks.sort_unstable_by_key(|node| node.byte_offset);
        for pair in chunks.windows(2) {
            if let [before, after] = pair
                && before.byte_offset.saturating_add(before.byte_size) > after.byte_offset
            {
                let what = format!("the chunks of nodes {} and {} overlap", before.key, after.key);
                let broken = ReadError::broken(self.file.path(), after.byte_offset, what);
                return Err(broken.advise(Advice::ExportAgain));
            }
        }
        Ok(())
    }

    /// Reads the points of a node; replaces the contents of `out`. Positions are integers on [`Self::lattice`].
    ///
    /// # Errors
    /// A proxy; a chunk that is not in the file, or says something else of itself than the hierarchy; bytes that do not decode; more
    /// of them than [`Self::set_max_node_bytes`] allows, or than there is memory for ([`Advice::MoreMemory`]).
    pub fn read_points(&self, node: &OctreeNode, out: &mut NodePoints) -> Result<(), ReadError> {
        out.reset(self.info.attributes.iter().map(|a| (a.name.as_str(), a.ty)));
        let mut positions = out.take_quantized();
        let NodePoints { columns, stored, .. } = out;
        let read = self.decode(node, stored, &mut positions, columns);
        out.positions = Positions::Quantized(positions);
        out.lattice = self.file.lattice;
        read
    }

    fn decode(
        &self,
        node: &OctreeNode,
        stored: &mut Vec<u8>,
        positions: &mut [Vec<i32>; 3],
        columns: &mut Vec<crate::Column>,
    ) -> Result<(), ReadError> {
        let OctreeNode { key, points, byte_offset: offset, byte_size: bytes, is_proxy, .. } = *node;
        stored.clear();
        if is_proxy {
            let what = format!("the points of node {key} are known when its hierarchy page is read");
            return Err(ReadError::unsupported(self.file.path(), what));
        }
        if points == 0 {
            return Ok(());
        }
        let place = ChunkPlace { offset, bytes, points, most_bytes: self.max_node_bytes };
        self.file.decode(place, &format!("node {key}"), stored, positions, columns)
    }
}

/// The info record of a file that is COPC.
fn info_record(file: &ChunkFile) -> Result<Info, ReadError> {
    let path = file.path();
    let Some((at, data)) = file.info_record() else {
        let what = format!("{} without the info record of COPC: no octree", file.format);
        return Err(ReadError::unsupported(path, what).advise("read it as a scan"));
    };
    let broken =
        |at: u64, what: String| Err(ReadError::broken(path, at, Fault::Header(what)).advise(Advice::ExportAgain));
    if at != Info::OFFSET {
        return broken(
            at,
            format!("the info record of COPC has to be the first, with its data at byte {}", Info::OFFSET),
        );
    }
    let Some(bytes) = data.first_chunk() else {
        return broken(at, format!("the info record of COPC has {} of {} bytes", data.len(), Info::LEN));
    };
    let (version, format) = (file.version, file.point_format);
    if version.1 < 4 || !matches!(format, 6..=8) {
        let what = format!("LAS 1.{} with point format {format}; COPC is LAS 1.4 with 6, 7 or 8", version.1);
        return broken(24, what);
    }
    let info = Info::from_bytes(bytes);
    match info.check() {
        Ok(()) => Ok(info),
        Err((field, what)) => broken(at + field, what),
    }
}
