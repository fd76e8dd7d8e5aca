//! Nodes put together to pieces that are worth a thread's while.

use std::ops::Range;

use crate::Piece;

/// Points that a piece has at most, unless a single node has more.
pub(super) const PIECE_POINTS: u64 = 131_072;

/// How many points a node has, and where they are among the bytes of the dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) points: u64,
    pub(super) byte_offset: u64,
    pub(super) byte_size: u64,
}

/// Pieces, and for each the number of nodes up to its end.
#[derive(Debug, Default)]
pub(super) struct Pieces {
    pub(super) pieces: Vec<Piece>,
    ends: Vec<usize>,
}

impl Pieces {
    /// Puts nodes together that have points and follow one another in their file.
    pub(super) fn of(nodes: impl Iterator<Item = Place>) -> Self {
        let mut all = Self::default();
        let (mut points, mut bytes, mut count) = (0..0, 0..0, 0);
        for node in nodes {
            if points.is_empty() || points.end - points.start + node.points > PIECE_POINTS {
                all.push(count, &points, &bytes);
                (points, bytes) = (points.end..points.end, node.byte_offset..node.byte_offset);
            }
            count += 1;
            points.end += node.points;
            bytes.end = bytes.end.max(node.byte_offset.saturating_add(node.byte_size));
        }
        all.push(count, &points, &bytes);
        all
    }

    fn push(&mut self, end: usize, points: &Range<u64>, bytes: &Range<u64>) {
        if points.is_empty() {
            return;
        }
        self.pieces.push(Piece::new(points.clone(), bytes.clone()));
        self.ends.push(end);
    }

    /// The nodes of a piece.
    pub(super) fn nodes(&self, piece: usize) -> Option<Range<usize>> {
        let end = *self.ends.get(piece)?;
        Some(piece.checked_sub(1).map_or(0, |before| self.ends[before])..end)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn node(points: u64, byte_offset: u64, byte_size: u64) -> Place {
        Place { points, byte_offset, byte_size }
    }

    #[test]
    fn small_nodes_share_a_piece_and_a_large_one_has_its_own() {
        let nodes = [node(100_000, 7, 10), node(31_072, 17, 3), node(1, 30, 1), node(500_000, 31, 50), node(2, 90, 4)];
        let pieces = Pieces::of(nodes.into_iter());
        let expected =
            [(0..131_072, 7..20), (131_072..131_073, 30..31), (131_073..631_073, 31..81), (631_073..631_075, 90..94)];
        assert_eq!(pieces.pieces, expected.map(|(points, bytes)| Piece::new(points, bytes)));
        assert_eq!([0, 1, 2, 3, 4].map(|i| pieces.nodes(i)), [Some(0..2), Some(2..3), Some(3..4), Some(4..5), None]);
        assert!(Pieces::of(std::iter::empty()).pieces.is_empty());
    }
}
