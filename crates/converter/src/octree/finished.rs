//! Finished nodes of a unit, in the order in which they go to the tree.

use pointmill_format::NodeKey;

use super::list::List;
use super::sink::{FinishedNode, NodeEncoder, points_of};
use crate::cloud::Checksum;
use crate::error::ConvertError;

/// Finished nodes that have no place in the tree yet.
pub(super) enum Piece {
    /// Nodes and their bytes; offsets count from the first of these.
    Nodes(Vec<FinishedNode>, Vec<u8>),
    /// A node that is too large to be encoded in memory.
    Large(NodeKey, List),
}

/// The finished nodes of a unit while they are made.
#[derive(Default)]
pub(super) struct Finished {
    pieces: Vec<Piece>,
    nodes: Vec<FinishedNode>,
    bytes: Vec<u8>,
    /// Of the records that were encoded.
    pub(super) written: Checksum,
}

impl Finished {
    /// `bytes`: a buffer to use again.
    pub(super) fn new(mut bytes: Vec<u8>) -> Self {
        bytes.clear();
        Self { bytes, ..Self::default() }
    }

    /// The buffer of bytes, to make room in it.
    pub(super) fn bytes(&mut self) -> &mut Vec<u8> {
        &mut self.bytes
    }

    /// Encodes a node.
    pub(super) fn encode<'r>(
        &mut self,
        encoder: &mut impl NodeEncoder,
        key: NodeKey,
        records: impl ExactSizeIterator<Item = &'r [u8]>,
    ) -> Result<(), ConvertError> {
        let (points, start) = (points_of(records.len() as u64)?, self.bytes.len());
        encoder.encode(key, records, &mut self.written, &mut self.bytes)?;
        let byte_size = (self.bytes.len() - start) as u64;
        self.nodes.push(FinishedNode { key, points, byte_offset: start as u64, byte_size });
        Ok(())
    }

    /// Adds a node that is encoded once it has its place.
    pub(super) fn add_large(&mut self, key: NodeKey, points: List) {
        self.close();
        self.pieces.push(Piece::Large(key, points));
    }

    fn close(&mut self) {
        if !self.nodes.is_empty() {
            let (nodes, bytes) = (std::mem::take(&mut self.nodes), std::mem::take(&mut self.bytes));
            self.pieces.push(Piece::Nodes(nodes, bytes));
        }
    }

    /// All nodes, in order.
    pub(super) fn into_pieces(mut self) -> Vec<Piece> {
        self.close();
        self.pieces
    }
}
