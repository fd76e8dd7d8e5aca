//! The scan of an octree, of whatever format: nodes are decoded one after the other.

use crate::octree::{Octree, OctreeNode};
use crate::scan::{batch_bytes, batch_points, fitting_batch, point_bytes};
use crate::{Fault, NodePoints, Piece, PointBatch, ReadError, Scan, ScanInfo, Scratch, Sink, Wanted};

use super::described::{Described, advised};
use super::pieces::Pieces;
use super::placing::place;

/// An octree whose nodes are known.
pub(super) struct OctreeScan {
    octree: Box<dyn Octree>,
    described: Described,
    info: ScanInfo,
    /// Those with points, in the order in which they are read; each says how many points it has.
    nodes: Vec<OctreeNode>,
    pieces: Pieces,
    /// Points of a full batch.
    batch_points: usize,
}

impl OctreeScan {
    /// `nodes`: with their true counts, each with its place among the bytes of all.
    pub(super) fn new(octree: Box<dyn Octree>, described: Described, mut nodes: Vec<OctreeNode>) -> Self {
        nodes.retain(|node| node.points > 0);
        let points = nodes.iter().map(|node| node.points).sum();
        let info = described.info(points);
        let pieces = Pieces::of(&nodes);
        let batch_points = batch_points(point_bytes(&info.attributes, info.lattice.is_some()));
        Self { octree, described, info, nodes, pieces, batch_points }
    }

    fn node(
        &self,
        node: &OctreeNode,
        wanted: &Wanted,
        points: &mut NodePoints,
        out: &mut Out<'_, '_>,
    ) -> Result<bool, ReadError> {
        self.octree.points(node, points).map_err(advised)?;
        if points.len() as u64 != node.points {
            let what = format!("node {} has {} points; its index says {}", node.key, points.len(), node.points);
            return Err(self.broken(node, what));
        }
        for start in (0..points.len()).step_by(self.batch_points) {
            let range = start..points.len().min(start + self.batch_points);
            let placed = place(points, range.clone(), self.info.lattice.as_ref(), &mut out.batch.positions);
            if placed.is_none() {
                return Err(
                    self.broken(node, format!("a point of node {} is far outside of the declared bounds", node.key))
                );
            }
            self.described.columns.fill(points, &range, wanted, out.batch);
            out.batch.first_point = out.next;
            out.next += range.len() as u64;
            if (out.sink)(out.batch).is_break() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    fn broken(&self, node: &OctreeNode, what: String) -> ReadError {
        advised(ReadError::broken(&self.info.path, node.byte_offset, what))
    }
}

/// Where batches go.
struct Out<'a, 's> {
    batch: &'a mut PointBatch,
    sink: &'a mut Sink<'s>,
    /// Index of the next point.
    next: u64,
}

impl Scan for OctreeScan {
    fn info(&self) -> &ScanInfo {
        &self.info
    }

    fn pieces(&self) -> &[Piece] {
        &self.pieces.pieces
    }

    fn decode_bytes(&self, wanted: &Wanted) -> u64 {
        let most = |of: fn(&OctreeNode) -> u64| self.nodes.iter().map(of).max().unwrap_or(0);
        let (points, stored) = (most(|node| node.points), most(|node| node.byte_size));
        let batch = batch_bytes(&self.info.attributes, self.info.lattice.is_some(), wanted, self.batch_points as u64);
        let memory = self.described.memory;
        batch + stored + points.saturating_mul(memory.per_point) + memory.decompressor
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
        let kept = scratch.kept.take().and_then(|kept| kept.downcast::<NodePoints>().ok());
        let mut points = kept.unwrap_or_default();
        // false: the sink has enough
        let goes_on = |node| self.node(node, wanted, &mut points, &mut out);
        let result = self.nodes[range].iter().map(goes_on).find(|goes_on| !matches!(goes_on, Ok(true)));
        scratch.kept = Some(points);
        result.map_or(Ok(()), |ended| ended.map(drop))
    }
}
