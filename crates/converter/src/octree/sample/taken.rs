//! The points taken from a node so far, found by place.

use super::neighbours::TILE_BITS;
use super::spacing::Spacing;
use super::tile::Tile;
use crate::cloud::TreePoint;
use crate::cloud::morton::interleave;

/// A cell is `2^CELL_BITS` units wide; a tile is two cells wide.
const CELL_BITS: u32 = TILE_BITS - 1;

/// Cells along an axis at most: a bit of a word each.
const MOST_CELLS: usize = 64;

/// Points taken from a node, in Morton order, and a grid of cells over them; all empty between nodes.
pub(super) struct Taken {
    /// Of the spacing, in units; at most 1.
    reach: f64,
    /// A node has `2^grid_bits` cells along each axis.
    grid_bits: u32,
    /// One bit for each cell from which a point was taken, a word for each column of cells: bit z of word
    /// (x + 1, y + 1). The columns around the node stay empty.
    occupied: Vec<u64>,
    /// Range in `points` of each occupied cell, by Morton code of the cell: neighbours in space are near in memory.
    ranges: Vec<Range>,
    points: Vec<TreePoint>,
    /// The bits of a number, two zeros between each.
    spread: Box<[u32; MOST_CELLS]>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Range {
    start: u32,
    end: u32,
}

impl Taken {
    pub(super) fn new(spacing: Spacing) -> Self {
        let grid_bits = spacing.bits() - CELL_BITS;
        Self {
            reach: spacing.in_units(),
            grid_bits,
            occupied: vec![0; ((1 << grid_bits) + 2) * ((1 << grid_bits) + 2)],
            ranges: vec![Range::default(); 1 << (3 * grid_bits)],
            points: Vec::new(),
            spread: Box::new(std::array::from_fn(|i| interleave([0, 0, i as u32]) as u32)),
        }
    }

    /// Forgets all points.
    pub(super) fn clear(&mut self) {
        self.occupied.fill(0);
        self.points.clear();
    }

    /// Makes room for so many points.
    pub(super) fn reserve(&mut self, points: usize) {
        self.points.reserve_exact(points);
    }

    /// Memory of the points, bytes.
    pub(super) fn bytes(&self) -> u64 {
        size_of_val(self.points.as_slice()) as u64
    }

    /// Gives back the memory of the points.
    pub(super) fn release(&mut self) {
        self.points = Vec::new();
    }

    /// The Morton code of the tile of `t` in the node whose lower corner is `corner`.
    #[inline(always)]
    pub(super) fn tile_code(&self, t: TreePoint, corner: TreePoint, tile_shift: u32) -> u32 {
        self.code(std::array::from_fn(|a| (t[a] - corner[a]) >> tile_shift))
    }

    #[inline(always)]
    fn code(&self, cell: [u32; 3]) -> u32 {
        let [x, y, z] = cell.map(|c| self.spread[c as usize % MOST_CELLS]);
        x << 2 | y << 1 | z
    }

    /// Notes which candidates of a tile were taken, cell by cell.
    #[inline(always)]
    pub(super) fn note(&mut self, candidates: &[TreePoint], accepted: &[bool], unit_bits: u32) {
        let cell_shift = unit_bits + CELL_BITS;
        let mut open: Option<([u32; 3], u32)> = None;
        for (t, _) in candidates.iter().zip(accepted).filter(|(_, taken)| **taken) {
            let cell = t.cell(cell_shift);
            match open {
                Some((c, _)) if c == cell => {}
                _ => {
                    self.close_cell(open);
                    open = Some((cell, self.points.len() as u32));
                }
            }
            self.points.push(*t);
        }
        self.close_cell(open);
    }

    #[inline(always)]
    fn close_cell(&mut self, open: Option<([u32; 3], u32)>) {
        let Some((cell, start)) = open else { return };
        let cell = cell.map(|c| c & self.last_cell());
        let code = self.code(cell);
        self.ranges[code as usize] = Range { start, end: self.points.len() as u32 };
        let column = self.column(cell[0] + 1, cell[1] + 1);
        self.occupied[column] |= 1 << cell[2];
    }

    /// Gives `tile` the points that lie closer than the spacing to the tile in which `first` lies.
    #[inline(always)]
    pub(super) fn around(&self, first: TreePoint, unit_bits: u32, tile: &mut Tile) {
        let tile_shift = unit_bits + TILE_BITS;
        let reach = (self.reach * f64::from(1u32 << unit_bits)).ceil() as u32;
        // modulo 2^32: a tile and its surroundings are less than that
        let low = first.cell(tile_shift).map(|c| (c << tile_shift).wrapping_sub(reach));
        let width = (1u32 << tile_shift) + 2 * reach;
        let cell = first.cell(tile_shift).map(|c| c << 1 & self.last_cell());
        let mut cells = self.cells_around(cell);
        while cells != 0 {
            let at = cells.trailing_zeros();
            cells &= cells - 1;
            // an occupied cell lies in the node, so none of these is less than 0
            let [x, y, z] =
                [cell[0] + (at >> 4), cell[1] + (at >> 2 & 3), cell[2] + (at & 3)].map(|c| c.wrapping_sub(1));
            let range = self.ranges[self.code([x, y, z]) as usize];
            let points = &self.points[range.start as usize..range.end as usize];
            tile.reserve_near(points.len());
            for p in points {
                let is_near = (0..3).fold(true, |near, a| near & (p[a].wrapping_sub(low[a]) <= width));
                tile.push_near_if(is_near, *p);
            }
        }
    }

    /// The occupied ones of the cells from the one before a tile to the one behind it, four an axis: bits x, y, z of
    /// two bits each make the number of a bit. `cell`: the first of the tile. The tile's own are not occupied yet.
    #[inline(always)]
    fn cells_around(&self, cell: [u32; 3]) -> u64 {
        // a word is turned so that the cell before the tile comes first; the ends of the node do not touch
        let turn = cell[2].wrapping_sub(1) & 63;
        let mask = if cell[2] == 0 {
            0b1110
        } else if cell[2] as usize + 2 == MOST_CELLS {
            0b0111
        } else {
            0b1111
        };
        let mut cells = 0;
        for x in 0..4 {
            let first = self.column(cell[0] + x, cell[1]);
            let Some(columns) = self.occupied[first..].first_chunk::<4>() else { continue };
            for (y, column) in columns.iter().enumerate() {
                cells |= (column.rotate_right(turn) & mask) << (16 * x + 4 * y as u32);
            }
        }
        cells
    }

    /// Word of `occupied` for a column of cells, counted from the one before the node.
    #[inline(always)]
    fn column(&self, x: u32, y: u32) -> usize {
        x as usize * ((1 << self.grid_bits) + 2) + y as usize
    }

    #[inline(always)]
    fn last_cell(&self) -> u32 {
        (1 << self.grid_bits) - 1
    }
}
