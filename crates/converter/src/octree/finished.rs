//! Finished nodes of a unit, in the order in which they go to the tree.

use pointmill_format::NodeKey;

use super::list::List;
use super::sink::{FinishedNode, points_of};
use super::sinks::{Encoders, Stream};
use crate::cloud::Checksum;
use crate::error::ConvertError;
use crate::job::Place;

/// Finished nodes that have no place in the tree yet.
pub(super) enum Piece {
    /// Nodes and their bytes, for each stream.
    Nodes(Vec<Run>),
    /// A node that is too large to be encoded in memory.
    Large(NodeKey, List),
}

/// Nodes that follow one another in a stream; offsets count from the first of the bytes.
pub(super) struct Run {
    pub(super) nodes: Vec<FinishedNode>,
    pub(super) bytes: Vec<u8>,
    /// Where the bytes are if a run before has written them into the output: they are not here then.
    pub(super) in_place: Option<Place>,
}

/// The finished nodes of a unit while they are made.
pub(super) struct Finished {
    pieces: Vec<Piece>,
    streams: Vec<Stream>,
}

impl Finished {
    /// For these streams.
    pub(super) fn new(streams: Vec<Stream>) -> Self {
        Self { pieces: Vec::new(), streams }
    }

    /// Encodes a node.
    pub(super) fn encode<'r>(
        &mut self,
        encoders: &mut impl Encoders,
        key: NodeKey,
        records: impl ExactSizeIterator<Item = &'r [u8]>,
    ) -> Result<(), ConvertError> {
        let points = points_of(records.len() as u64)?;
        for stream in &mut self.streams {
            let byte_offset = stream.bytes.len() as u64;
            stream.nodes.push(FinishedNode { key, points, byte_offset, byte_size: 0 });
        }
        encoders.encode(key, records, &mut self.streams)?;
        for stream in &mut self.streams {
            if let Some(node) = stream.nodes.last_mut() {
                node.byte_size = stream.bytes.len() as u64 - node.byte_offset;
            }
        }
        Ok(())
    }

    /// Adds a node that is encoded once it has its place.
    pub(super) fn add_large(&mut self, key: NodeKey, points: List) {
        self.close();
        self.pieces.push(Piece::Large(key, points));
    }

    fn close(&mut self) {
        if self.streams.iter().all(|stream| stream.nodes.is_empty()) {
            return;
        }
        let run = |stream: &mut Stream| Run {
            nodes: std::mem::take(&mut stream.nodes),
            bytes: std::mem::take(&mut stream.bytes),
            in_place: None,
        };
        self.pieces.push(Piece::Nodes(self.streams.iter_mut().map(run).collect()));
    }

    /// All nodes, in order, and for each stream the sum of the records that were encoded.
    pub(super) fn into_pieces(mut self) -> (Vec<Piece>, Vec<Checksum>) {
        self.close();
        let written = self.streams.iter().map(|stream| stream.written).collect();
        (self.pieces, written)
    }
}
