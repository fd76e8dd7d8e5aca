//! The scan of a dataset, of whatever format: its nodes (leaves, batches) are decoded one after the other.

use crate::scan::{batch_bytes, batch_points, fitting_batch, point_bytes};
use crate::{Fault, NodePoints, Piece, PointBatch, ReadError, Scan, ScanInfo, Scratch, Sink, Wanted};

use super::described::{Described, advised};
use super::pieces::{Pieces, Place};
use super::placing::place;

/// The nodes of a dataset that have points, in the order in which they are read.
pub(super) trait Nodes: Send + Sync {
    /// What a thread keeps from node to node, beside the points.
    type Scratch: Default + Send + Sync + 'static;

    /// How many there are.
    fn len(&self) -> usize;

    /// How many points a node has, and where they are.
    fn place(&self, node: usize) -> Place;

    /// What a node is called in messages.
    fn name(&self, node: usize) -> String;

    /// Reads the points of a node.
    ///
    /// # Errors
    /// Those of its reader.
    fn read(&self, node: usize, scratch: &mut Self::Scratch, out: &mut NodePoints) -> Result<(), ReadError>;

    /// A piece is decoded: what is only held for its nodes is given back.
    fn close(&self, _: &mut Self::Scratch) {}
}

/// A dataset whose nodes are known.
pub(super) struct NodeScan<N> {
    nodes: N,
    described: Described,
    info: ScanInfo,
    pieces: Pieces,
    /// Points of a full batch.
    batch_points: usize,
}

/// What a thread keeps.
#[derive(Default)]
struct Kept<S> {
    points: NodePoints,
    scratch: S,
}

/// Where batches go.
struct Out<'a, 's> {
    batch: &'a mut PointBatch,
    sink: &'a mut Sink<'s>,
    /// Index of the next point.
    next: u64,
}

impl<N: Nodes> NodeScan<N> {
    pub(super) fn new(nodes: N, described: Described) -> Self {
        let pieces = Pieces::of((0..nodes.len()).map(|node| nodes.place(node)));
        let points = pieces.pieces.last().map_or(0, |last| last.first_point + last.points);
        let info = described.info(points);
        let batch_points = batch_points(point_bytes(&info.attributes, info.lattice.is_some()));
        Self { nodes, described, info, pieces, batch_points }
    }

    /// False: the sink has enough.
    fn node(
        &self,
        node: usize,
        wanted: &Wanted,
        kept: &mut Kept<N::Scratch>,
        out: &mut Out<'_, '_>,
    ) -> Result<bool, ReadError> {
        let Kept { points, scratch } = kept;
        self.nodes.read(node, scratch, points).map_err(advised)?;
        let expected = self.nodes.place(node).points;
        if points.len() as u64 != expected {
            let (name, found) = (self.nodes.name(node), points.len());
            return Err(self.broken(node, format!("{name} has {found} points; its index says {expected}")));
        }
        for start in (0..points.len()).step_by(self.batch_points) {
            let range = start..points.len().min(start + self.batch_points);
            let placed = place(points, range.clone(), self.info.lattice.as_ref(), &mut out.batch.positions);
            if placed.is_none() {
                let what = format!("a point of {} is far outside of the declared bounds", self.nodes.name(node));
                return Err(self.broken(node, what));
            }
            out.batch.clear_changes();
            self.described.columns.fill(points, &range, wanted, out.batch);
            out.batch.first_point = out.next;
            out.next += range.len() as u64;
            if (out.sink)(out.batch).is_break() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn broken(&self, node: usize, what: String) -> ReadError {
        advised(ReadError::broken(&self.info.path, self.nodes.place(node).byte_offset, what))
    }
}

impl<N: Nodes> Scan for NodeScan<N> {
    fn info(&self) -> &ScanInfo {
        &self.info
    }

    fn pieces(&self) -> &[Piece] {
        &self.pieces.pieces
    }

    fn decode_bytes(&self, wanted: &Wanted) -> u64 {
        let most =
            |of: fn(Place) -> u64| (0..self.nodes.len()).map(|node| of(self.nodes.place(node))).max().unwrap_or(0);
        let (points, stored) = (most(|place| place.points), most(|place| place.byte_size));
        let in_batch = points.min(self.batch_points as u64);
        let batch = batch_bytes(&self.info.attributes, self.info.lattice.is_some(), wanted, in_batch);
        let memory = self.described.memory;
        batch + stored.saturating_add(points.saturating_mul(memory.per_point)).saturating_add(memory.decompressor)
    }

    fn decode(
        &self,
        piece: usize,
        wanted: &Wanted,
        scratch: &mut Scratch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        let Some((range, first)) = self.pieces.nodes(piece).zip(self.pieces().get(piece)) else {
            let fault = Fault::NoSuchPiece { piece, pieces: self.pieces().len() };
            return Err(ReadError::unsupported(&self.info.path, fault));
        };
        scratch.next_piece = None;
        let batch = fitting_batch(&mut scratch.batch, &self.info.attributes, self.info.lattice.is_some());
        let mut out = Out { batch, sink, next: first.first_point };
        let kept = scratch.kept.take().and_then(|kept| kept.downcast::<Kept<N::Scratch>>().ok());
        let mut kept = kept.unwrap_or_default();
        let goes_on = |node| self.node(node, wanted, &mut kept, &mut out);
        let result = range.map(goes_on).find(|goes_on| !matches!(goes_on, Ok(true)));
        self.nodes.close(&mut kept.scratch);
        scratch.kept = Some(kept);
        result.map_or(Ok(()), |ended| ended.map(drop))
    }
}
