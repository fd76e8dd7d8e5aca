//! Points that other nodes of the same level have taken just over the border of a node: they keep their distance too.

use super::spacing::Spacing;
use crate::cloud::morton::interleave;
use crate::cloud::{TREE_BITS, TreePoint};

/// A tile is `2^TILE_BITS` units wide.
pub(super) const TILE_BITS: u32 = 2;

/// Those points, for each tile of the node that they may concern.
#[derive(Debug, Default)]
pub(super) struct OverBorder {
    /// By Morton code of the tile in the node.
    points: Vec<(u32, TreePoint)>,
    at: usize,
}

impl OverBorder {
    /// Takes the points around a node whose lower corner is `corner`.
    pub(super) fn begin(&mut self, level: u8, corner: TreePoint, spacing: Spacing, points: &[TreePoint]) {
        self.points.clear();
        self.at = 0;
        let (Some(unit_bits), Some(reach)) = (spacing.unit_bits(level), spacing.reach(level)) else { return };
        let tile_bits = unit_bits + TILE_BITS;
        let last = (1 << (TREE_BITS - u32::from(level) - tile_bits)) - 1;
        for point in points {
            let tiles: [(i64, i64); 3] = std::array::from_fn(|a| {
                let (v, reach) = (i64::from(point[a]) - i64::from(corner[a]), i64::from(reach));
                (((v - reach) >> tile_bits).max(0), ((v + reach) >> tile_bits).min(last))
            });
            for x in tiles[0].0..=tiles[0].1 {
                for y in tiles[1].0..=tiles[1].1 {
                    for z in tiles[2].0..=tiles[2].1 {
                        self.points.push((interleave([x as u32, y as u32, z as u32]) as u32, *point));
                    }
                }
            }
        }
        self.points.sort_unstable_by_key(|(tile, point)| (*tile, point.0));
    }

    /// Memory that they take, bytes.
    pub(super) fn bytes(&self) -> u64 {
        size_of_val(self.points.as_slice()) as u64
    }

    /// True if no tile that is asked for from now on has any.
    #[inline(always)]
    pub(super) fn is_done(&self) -> bool {
        self.at == self.points.len()
    }

    /// Those that concern a tile; tiles are asked for in ascending order.
    #[inline]
    pub(super) fn of_tile(&mut self, tile: u32) -> &[(u32, TreePoint)] {
        if self.at == self.points.len() {
            return &[];
        }
        let rest = &self.points[self.at..];
        let start = self.at + rest.iter().take_while(|(t, _)| *t < tile).count();
        let count = self.points[start..].iter().take_while(|(t, _)| *t == tile).count();
        self.at = start + count;
        &self.points[start..self.at]
    }
}

/// The Morton code of a tile in its node.
#[inline]
pub(super) fn tile_code(t: TreePoint, corner: TreePoint, tile_shift: u32) -> u32 {
    interleave(std::array::from_fn(|a| (t[a] - corner[a]) >> tile_shift)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_tile_gets_the_points_that_are_near_it() {
        // Nodes of level 10 are 2^21 wide, units 2^14, tiles 2^16.
        let corner = TreePoint([1 << 21, 1 << 21, 0]);
        let mut over = OverBorder::default();
        let below = TreePoint([(1 << 21) - 5, (1 << 21) + 100, 20_000]);
        let edge = TreePoint([(1 << 22) + 3, (1 << 21) + (1 << 16) + 9, 1 << 20]);
        let far = TreePoint([(1 << 21) - (1 << 15), 1 << 21, 0]);
        over.begin(10, corner, Spacing::default(), &[far, edge, below]);
        assert_eq!(over.of_tile(0), [(0, below)]);
        let tile = |x, y, z| interleave([x, y, z]) as u32;
        let mut found: Vec<u32> =
            [(31, 0, 15), (31, 1, 15), (31, 0, 16), (31, 1, 16)].map(|(x, y, z)| tile(x, y, z)).to_vec();
        found.sort_unstable();
        assert!(over.of_tile(1).is_empty());
        for tile in found {
            assert_eq!(over.of_tile(tile), [(tile, edge)]);
        }
        assert!(over.of_tile(u32::MAX).is_empty());
    }
}
