//! Nodes put together to pieces that are worth a thread's while.

use crate::Piece;
use crate::octree::OctreeNode;

/// Points that a piece has at most, unless a single node has more.
const PIECE_POINTS: u64 = 131_072;

/// Pieces, and for each the number of nodes up to its end.
#[derive(Debug, Default)]
pub(super) struct Pieces {
    pub(super) pieces: Vec<Piece>,
    ends: Vec<usize>,
}

impl Pieces {
    /// Puts nodes together that have points and follow one another in their file.
    pub(super) fn of(nodes: &[OctreeNode]) -> Self {
        let mut all = Self::default();
        let (mut first, mut points, mut bytes) = (0, 0..0, 0..0);
        for (index, node) in nodes.iter().enumerate() {
            if index > first && points.end - points.start + node.points > PIECE_POINTS {
                all.push(index, &points, &bytes);
                (first, points, bytes) = (index, points.end..points.end, node.byte_offset..node.byte_offset);
            }
            if index == 0 {
                bytes = node.byte_offset..node.byte_offset;
            }
            points.end += node.points;
            bytes.end = bytes.end.max(node.byte_offset.saturating_add(node.byte_size));
        }
        if !nodes.is_empty() {
            all.push(nodes.len(), &points, &bytes);
        }
        all
    }

    fn push(&mut self, end: usize, points: &std::ops::Range<u64>, bytes: &std::ops::Range<u64>) {
        self.pieces.push(Piece::new(points.clone(), bytes.clone()));
        self.ends.push(end);
    }

    /// The nodes of a piece.
    pub(super) fn nodes(&self, piece: usize) -> Option<std::ops::Range<usize>> {
        let end = *self.ends.get(piece)?;
        Some(piece.checked_sub(1).map_or(0, |before| self.ends[before])..end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::NodeKey;

    fn node(points: u64, byte_offset: u64, byte_size: u64) -> OctreeNode {
        OctreeNode { points, byte_offset, byte_size, ..OctreeNode::new(NodeKey::ROOT) }
    }

    #[test]
    fn small_nodes_share_a_piece_and_a_large_one_has_its_own() {
        let nodes = [node(100_000, 7, 10), node(31_072, 17, 3), node(1, 30, 1), node(500_000, 31, 50), node(2, 90, 4)];
        let pieces = Pieces::of(&nodes);
        let expected =
            [(0..131_072, 7..20), (131_072..131_073, 30..31), (131_073..631_073, 31..81), (631_073..631_075, 90..94)];
        assert_eq!(pieces.pieces, expected.map(|(points, bytes)| Piece::new(points, bytes)));
        assert_eq!([0, 1, 2, 3, 4].map(|i| pieces.nodes(i)), [Some(0..2), Some(2..3), Some(3..4), Some(4..5), None]);
        assert!(Pieces::of(&[]).pieces.is_empty());
    }
}
