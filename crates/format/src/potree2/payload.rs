//! The points of nodes: payloads as stored, decompressed, taken apart. What a record claims is compared with the file, with
//! what a stream can give and with what is allowed, before memory is taken for it.

#[cfg(doc)]
use crate::Advice;
use crate::bytes::try_resize;
use crate::{Column, NodePoints, Positions, ReadError, with_column};

use super::brotli::{self, Fault};
use super::{Dataset, Encoding, Node, NodeRecord, OCTREE_FILE, node_points};

/// No Brotli stream gives more bytes than this per compressed byte: a meta-block gives at most 16 MiB and has a header
/// of more than a byte (RFC 7932, section 9.2).
const MAX_BROTLI_RATIO: u64 = 1 << 24;

/// A payload that is to become that much more than it is, and larger than [`COUNTED_FROM`], is decompressed twice: first
/// only to count what it gives, so that memory is taken for what is there, not for what is claimed.
const COUNTED_RATIO: u64 = 64;

/// See [`COUNTED_RATIO`].
const COUNTED_FROM: u64 = 16 << 20;

impl Dataset {
    /// Reads the payload of a node as stored; replaces the contents of `out`.
    ///
    /// # Errors
    /// A proxy (load its chunk first), or a range outside `octree.bin`; more bytes than
    /// [`Self::set_max_node_bytes`] allows, or than there is memory for ([`Advice::MoreMemory`]).
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
        let no_room = || self.no_room(node, record.byte_size.into());
        if record.byte_size > self.max_node_bytes {
            return Err(no_room());
        }
        try_resize(out, record.byte_size).map_err(|_| no_room())?;
        let read = self.source.read_at(OCTREE_FILE, record.byte_offset, out);
        read.map_err(|e| ReadError::io(path, &format!("reading node {key}"), e))
    }

    /// True if the payload of a node claims to be so much more than it is that [`Self::check_payload`] is worth its time.
    pub fn is_doubtful(&self, node: &Node) -> bool {
        let claimed = u128::from(node.record.points) * self.metadata.planar_len() as u128;
        self.metadata.encoding == Encoding::Brotli && is_doubtful(claimed, node.record.byte_size)
    }

    /// Finds out whether the payload of a BROTLI node holds just as many points as the record says, in the memory of the
    /// stored bytes alone. Does nothing for other datasets.
    ///
    /// # Errors
    /// As [`Self::read_points`].
    pub fn check_payload(&self, node: &Node) -> Result<(), ReadError> {
        if self.metadata.encoding != Encoding::Brotli || node.record.byte_size == 0 {
            return Ok(());
        }
        let mut stored = Vec::new();
        self.read_payload(node, &mut stored)?;
        let expected = self.claimed(node)?;
        let len = usize::try_from(expected).map_err(|_| self.no_room(node, expected))?;
        brotli::count(&stored, len).map_err(|fault| self.fault(node, &fault, expected))
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
        let NodeRecord { byte_offset, byte_size, .. } = node.record;
        if self.metadata.encoding == Encoding::Default && byte_size > 0 && !node.record.is_proxy() {
            self.check_range(OCTREE_FILE, byte_offset, byte_size, || format!("node {}", node.key))?;
            self.check_record_count(node)?;
        }
        self.read_payload(node, &mut out.stored)?;
        if out.stored.is_empty() {
            return Ok(());
        }
        match self.metadata.encoding {
            Encoding::Default => {
                self.make_room(node, positions, &mut out.columns)?;
                node_points::fill_from_records(&out.stored, &self.metadata, positions, &mut out.columns);
            }
            Encoding::Brotli => {
                self.decompress(node, &out.stored, &mut out.unpacked)?;
                self.make_room(node, positions, &mut out.columns)?;
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
        let expected = self.claimed(node)?;
        let len = usize::try_from(expected).ok().filter(|_| expected <= u128::from(self.max_node_bytes));
        let Some(len) = len else { return Err(self.no_room(node, expected)) };
        let counted = if is_doubtful(expected, stored.len() as u64) { brotli::count(stored, len) } else { Ok(()) };
        let unpacked = counted.and_then(|()| brotli::decompress(stored, len, planes));
        unpacked.map_err(|fault| self.fault(node, &fault, expected))
    }

    /// The decompressed bytes that the record of a node asks for, unless no stream can give them.
    fn claimed(&self, node: &Node) -> Result<u128, ReadError> {
        let NodeRecord { points, byte_size, .. } = node.record;
        let expected = u128::from(points) * self.metadata.planar_len() as u128;
        if expected <= u128::from(byte_size) * u128::from(MAX_BROTLI_RATIO) {
            return Ok(expected);
        }
        Err(self.broken(node, &format!("claims {points} points, more than {byte_size} compressed bytes can hold")))
    }

    /// What is wrong with the stream of a node that should give `len` bytes.
    fn fault(&self, node: &Node, fault: &Fault, len: u128) -> ReadError {
        let points = node.record.points;
        match *fault {
            Fault::Memory => self.no_room(node, len),
            Fault::Corrupt => self.broken(node, "is not a Brotli stream, or a damaged one"),
            Fault::Short(got) => {
                self.broken(node, &format!("decompresses to {got} bytes, its {points} points need {len}"))
            }
            Fault::Long => {
                self.broken(node, &format!("decompresses to more than the {len} bytes of its {points} points"))
            }
        }
    }

    fn broken(&self, node: &Node, what: &str) -> ReadError {
        let what = format!("node {} {what}", node.key);
        ReadError::broken(self.locate(OCTREE_FILE), node.record.byte_offset, what)
    }

    /// Memory for the columns of a node whose payload is there.
    fn make_room(&self, node: &Node, positions: &mut [Vec<i32>; 3], columns: &mut [Column]) -> Result<(), ReadError> {
        let points = node.record.points as usize;
        let attributes = self.metadata.attributes.iter().map(|a| &a.attribute).filter(|a| a.name != "position");
        let mut room = positions.iter_mut().try_for_each(|axis| axis.try_reserve(points));
        for (column, attribute) in columns.iter_mut().zip(attributes) {
            let values = points.saturating_mul(attribute.elements);
            room = room.and_then(|()| with_column!(column, column => column.try_reserve(values)));
        }
        room.map_err(|_| self.no_room(node, u128::from(node.record.points) * self.metadata.planar_len() as u128))
    }

    /// A node that takes more memory than there is, or than is allowed.
    fn no_room(&self, node: &Node, bytes: u128) -> ReadError {
        let (key, allowed) = (node.key, self.max_node_bytes);
        let why = if bytes > allowed.into() { format!("{allowed} are allowed") } else { "which is not there".into() };
        let what = format!("node {key} would take {bytes} bytes of memory, {why}");
        ReadError::memory(self.locate(OCTREE_FILE), what).at(node.record.byte_offset)
    }
}

/// See [`COUNTED_RATIO`].
fn is_doubtful(claimed: u128, stored: u64) -> bool {
    claimed > COUNTED_FROM.into() && claimed > u128::from(stored) * u128::from(COUNTED_RATIO)
}
