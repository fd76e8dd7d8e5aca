//! Formats that are written of one tree: each has a stream of bytes of its own.

use pointmill_format::NodeKey;

use super::sink::{EarlierTree, FinishedNode, NodeEncoder, NodeSink};
use crate::cloud::{Checksum, copy_record};
use crate::error::ConvertError;
use crate::job::KeptFile;

/// The bytes that one format has of a unit, while it is made.
#[derive(Default)]
pub(super) struct Stream {
    pub(super) nodes: Vec<FinishedNode>,
    pub(super) bytes: Vec<u8>,
    /// Of the records that were encoded.
    pub(super) written: Checksum,
}

impl Stream {
    /// Writes to `bytes`, a buffer to use again.
    pub(super) fn new(mut bytes: Vec<u8>) -> Self {
        bytes.clear();
        Self { bytes, ..Self::default() }
    }
}

/// The records of a node up to this size keep their memory for the next one; that of larger ones was reserved for them.
const KEPT_BYTES: usize = 4 << 20;

/// What is done with finished nodes, a format for each stream.
pub(super) trait Sinks: Sync {
    /// One thread's means to encode nodes.
    type Encoders<'s>: Encoders + Send
    where
        Self: 's;

    /// Number of streams.
    fn count(&self) -> usize;

    /// Means for one more thread.
    fn encoders(&self) -> Self::Encoders<'_>;

    /// As [`NodeSink::write`].
    fn write(&self, stream: usize, nodes: &[FinishedNode], bytes: &[u8], offset: u64) -> Result<(), ConvertError>;

    /// As [`NodeSink::add_notes`], of each stream.
    fn add_notes(&self, notes: &[Vec<u8>]) -> Result<(), ConvertError>;

    /// As [`NodeSink::kept`].
    fn kept(&self, stream: usize) -> Option<KeptFile<'_>>;

    /// As [`NodeSink::earlier`]; never of several streams.
    fn earlier(&self) -> Option<&dyn EarlierTree>;

    /// As [`NodeSink::write_part`].
    fn write_part(&self, stream: usize, node: &FinishedNode, bytes: &[u8], at: u64) -> Result<(), ConvertError>;
}

/// Makes the bytes of nodes, for each stream.
pub(super) trait Encoders {
    /// Number of streams.
    fn count(&self) -> usize;

    /// As [`NodeEncoder::encode`].
    fn encode<'r>(
        &mut self,
        key: NodeKey,
        records: impl ExactSizeIterator<Item = &'r [u8]>,
        streams: &mut [Stream],
    ) -> Result<(), ConvertError>;

    /// As [`NodeEncoder::take_notes`], of each stream.
    fn take_notes(&mut self) -> Result<Vec<Vec<u8>>, ConvertError>;

    /// As [`NodeEncoder::notice`]; never of several streams.
    fn notice(&mut self, records: &mut [u8], but_for: &mut [u8]);

    /// Bytes of a node that is encoded in parts.
    fn large_bytes(&self, stream: usize, key: NodeKey, points: u64) -> Option<u64>;

    /// True if nodes may be encoded in parts.
    fn takes_parts(&self) -> bool;

    /// As [`NodeEncoder::bytes_per_point`], of all streams.
    fn bytes_per_point(&self) -> u64;
}

/// One format needs no more than itself.
impl<S: NodeSink> Sinks for S {
    type Encoders<'s>
        = S::Encoder<'s>
    where
        S: 's;

    fn count(&self) -> usize {
        1
    }

    fn encoders(&self) -> S::Encoder<'_> {
        self.encoder()
    }

    fn write(&self, _: usize, nodes: &[FinishedNode], bytes: &[u8], offset: u64) -> Result<(), ConvertError> {
        NodeSink::write(self, nodes, bytes, offset)
    }

    fn add_notes(&self, notes: &[Vec<u8>]) -> Result<(), ConvertError> {
        notes.iter().try_for_each(|notes| NodeSink::add_notes(self, notes))
    }

    fn kept(&self, _: usize) -> Option<KeptFile<'_>> {
        NodeSink::kept(self)
    }

    fn earlier(&self) -> Option<&dyn EarlierTree> {
        NodeSink::earlier(self)
    }

    fn write_part(&self, _: usize, node: &FinishedNode, bytes: &[u8], at: u64) -> Result<(), ConvertError> {
        NodeSink::write_part(self, node, bytes, at)
    }
}

impl<E: NodeEncoder> Encoders for E {
    fn count(&self) -> usize {
        1
    }

    fn encode<'r>(
        &mut self,
        key: NodeKey,
        records: impl ExactSizeIterator<Item = &'r [u8]>,
        streams: &mut [Stream],
    ) -> Result<(), ConvertError> {
        let [Stream { written, bytes, .. }] = streams else { return Err(uneven()) };
        NodeEncoder::encode(self, key, records, written, bytes)
    }

    fn take_notes(&mut self) -> Result<Vec<Vec<u8>>, ConvertError> {
        Ok(vec![NodeEncoder::take_notes(self)?])
    }

    fn notice(&mut self, records: &mut [u8], but_for: &mut [u8]) {
        NodeEncoder::notice(self, records, but_for);
    }

    fn large_bytes(&self, _: usize, key: NodeKey, points: u64) -> Option<u64> {
        NodeEncoder::row_bytes(self)?.checked_mul(points)?.checked_add(NodeEncoder::head_bytes(self, key))
    }

    fn takes_parts(&self) -> bool {
        NodeEncoder::row_bytes(self).is_some()
    }

    fn bytes_per_point(&self) -> u64 {
        NodeEncoder::bytes_per_point(self)
    }
}

/// [`NodeSink`] of any format.
pub(crate) trait AnySink: Sync {
    /// As [`NodeSink::encoder`].
    fn any_encoder(&self) -> Box<dyn AnyEncoder + Send + '_>;

    /// As [`NodeSink::write`].
    fn write_any(&self, nodes: &[FinishedNode], bytes: &[u8], offset: u64) -> Result<(), ConvertError>;

    /// As [`NodeSink::add_notes`].
    fn add_any_notes(&self, notes: &[u8]) -> Result<(), ConvertError>;

    /// As [`NodeSink::kept`].
    fn any_kept(&self) -> Option<KeptFile<'_>>;

    /// As [`NodeSink::write_part`].
    fn write_any_part(&self, node: &FinishedNode, bytes: &[u8], at: u64) -> Result<(), ConvertError>;
}

/// [`NodeEncoder`] of any format.
pub(crate) trait AnyEncoder {
    /// As [`NodeEncoder::encode`], of records of `stride` bytes that lie behind one another.
    fn encode_rows(
        &mut self,
        key: NodeKey,
        rows: &[u8],
        stride: usize,
        written: &mut Checksum,
        out: &mut Vec<u8>,
    ) -> Result<(), ConvertError>;

    /// As [`NodeEncoder::take_notes`].
    fn take_any_notes(&mut self) -> Result<Vec<u8>, ConvertError>;

    /// As [`Encoders::large_bytes`]; `None`: nodes are not encoded in parts.
    fn any_large_bytes(&self, key: NodeKey, points: u64) -> Option<u64>;

    /// As [`NodeEncoder::bytes_per_point`].
    fn any_bytes_per_point(&self) -> u64;
}

impl<S: NodeSink> AnySink for S {
    fn any_encoder(&self) -> Box<dyn AnyEncoder + Send + '_> {
        Box::new(self.encoder())
    }

    fn write_any(&self, nodes: &[FinishedNode], bytes: &[u8], offset: u64) -> Result<(), ConvertError> {
        NodeSink::write(self, nodes, bytes, offset)
    }

    fn add_any_notes(&self, notes: &[u8]) -> Result<(), ConvertError> {
        NodeSink::add_notes(self, notes)
    }

    fn any_kept(&self) -> Option<KeptFile<'_>> {
        NodeSink::kept(self)
    }

    fn write_any_part(&self, node: &FinishedNode, bytes: &[u8], at: u64) -> Result<(), ConvertError> {
        NodeSink::write_part(self, node, bytes, at)
    }
}

impl<E: NodeEncoder> AnyEncoder for E {
    fn encode_rows(
        &mut self,
        key: NodeKey,
        rows: &[u8],
        stride: usize,
        written: &mut Checksum,
        out: &mut Vec<u8>,
    ) -> Result<(), ConvertError> {
        NodeEncoder::encode(self, key, rows.chunks_exact(stride), written, out)
    }

    fn take_any_notes(&mut self) -> Result<Vec<u8>, ConvertError> {
        NodeEncoder::take_notes(self)
    }

    fn any_large_bytes(&self, key: NodeKey, points: u64) -> Option<u64> {
        self.large_bytes(0, key, points)
    }

    fn any_bytes_per_point(&self) -> u64 {
        NodeEncoder::bytes_per_point(self)
    }
}

/// Several formats of one tree.
pub(super) struct Several<'s> {
    sinks: &'s [&'s dyn AnySink],
    /// Bytes of a stored record.
    stride: usize,
}

impl<'s> Several<'s> {
    /// Of records of `stride` bytes.
    pub(super) fn new(sinks: &'s [&'s dyn AnySink], stride: usize) -> Self {
        Self { sinks, stride }
    }

    fn sink(&self, stream: usize) -> Result<&'s dyn AnySink, ConvertError> {
        self.sinks.get(stream).copied().ok_or_else(uneven)
    }
}

impl Sinks for Several<'_> {
    type Encoders<'s>
        = SeveralEncoders<'s>
    where
        Self: 's;

    fn count(&self) -> usize {
        self.sinks.len()
    }

    fn encoders(&self) -> SeveralEncoders<'_> {
        let encoders = self.sinks.iter().map(|sink| sink.any_encoder()).collect();
        SeveralEncoders { encoders, stride: self.stride, rows: Vec::new() }
    }

    fn write(&self, stream: usize, nodes: &[FinishedNode], bytes: &[u8], offset: u64) -> Result<(), ConvertError> {
        self.sink(stream)?.write_any(nodes, bytes, offset)
    }

    fn add_notes(&self, notes: &[Vec<u8>]) -> Result<(), ConvertError> {
        notes.iter().enumerate().try_for_each(|(stream, notes)| self.sink(stream)?.add_any_notes(notes))
    }

    fn kept(&self, stream: usize) -> Option<KeptFile<'_>> {
        self.sinks.get(stream)?.any_kept()
    }

    fn earlier(&self) -> Option<&dyn EarlierTree> {
        None
    }

    fn write_part(&self, stream: usize, node: &FinishedNode, bytes: &[u8], at: u64) -> Result<(), ConvertError> {
        self.sink(stream)?.write_any_part(node, bytes, at)
    }
}

/// One thread's means to encode nodes for several formats.
pub(super) struct SeveralEncoders<'s> {
    encoders: Vec<Box<dyn AnyEncoder + Send + 's>>,
    stride: usize,
    /// The records of a node: they are gathered once for all formats.
    rows: Vec<u8>,
}

impl Encoders for SeveralEncoders<'_> {
    fn count(&self) -> usize {
        self.encoders.len()
    }

    fn encode<'r>(
        &mut self,
        key: NodeKey,
        records: impl ExactSizeIterator<Item = &'r [u8]>,
        streams: &mut [Stream],
    ) -> Result<(), ConvertError> {
        if streams.len() != self.encoders.len() {
            return Err(uneven());
        }
        self.rows.resize(records.len() * self.stride, 0);
        self.rows.chunks_exact_mut(self.stride).zip(records).for_each(|(row, record)| copy_record(record, row));
        self.encoders.iter_mut().zip(streams).try_for_each(|(encoder, Stream { written, bytes, .. })| {
            encoder.encode_rows(key, &self.rows, self.stride, written, bytes)
        })?;
        if self.rows.capacity() > KEPT_BYTES {
            self.rows = Vec::new();
        }
        Ok(())
    }

    fn take_notes(&mut self) -> Result<Vec<Vec<u8>>, ConvertError> {
        self.encoders.iter_mut().map(|encoder| encoder.take_any_notes()).collect()
    }

    fn notice(&mut self, _: &mut [u8], _: &mut [u8]) {}

    fn large_bytes(&self, stream: usize, key: NodeKey, points: u64) -> Option<u64> {
        self.encoders.get(stream)?.any_large_bytes(key, points)
    }

    fn takes_parts(&self) -> bool {
        self.encoders.iter().all(|encoder| encoder.any_large_bytes(NodeKey::ROOT, 1).is_some())
    }

    fn bytes_per_point(&self) -> u64 {
        // of formats whose rows are encoded as they come the bytes are part of the unit
        let each = self.encoders.iter().map(|encoder| encoder.any_bytes_per_point());
        self.stride as u64 + each.sum::<u64>()
    }
}

fn uneven() -> ConvertError {
    ConvertError::Internal("streams and formats of a tree differ in number".into())
}
