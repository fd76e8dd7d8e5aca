//! Records by cell of a coarse Morton grid, as they come.

use std::error::Error;

use pointmill_bench::process::prefer_large_pages;
use pointmill_format::{PointBatch, Positions, ScanInfo, with_column};

/// What can go wrong is told and ends the program.
pub(crate) type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;

/// Records that are kept behind one another.
pub(crate) const BLOCK: usize = 64;

/// Points of a cell that are aimed at, where the cloud is a surface.
const CELL_POINTS: u64 = 32 << 10;

/// Points whose records are made together, so that they stay in the first-level cache.
const RUN: usize = 256;

/// The cube around all points, and the cells in it.
pub(crate) struct Grid {
    min: [i64; 3],
    /// Lattice steps of the cube along an axis, as a power of two, at most 21.
    bits: u32,
    /// Cells along an axis, as a power of two.
    level: u32,
    pub(crate) record_len: usize,
    points: usize,
}

impl Grid {
    /// From what the header says.
    pub(crate) fn new(info: &ScanInfo) -> Result<Self> {
        let (lattice, bounds) = info.lattice.zip(info.bounds_declared).ok_or("no lattice or no bounds")?;
        let min: [i64; 3] = std::array::from_fn(|a| lattice.quantize(a, bounds.min[a]));
        let extent = (0..3).map(|a| lattice.quantize(a, bounds.max[a]) - min[a]).max().unwrap_or(0);
        let bits = i64::BITS - extent.leading_zeros();
        if bits > 21 {
            return Err("the bounds span more than 2^21 steps along an axis".into());
        }
        let columns = info.points_declared.div_ceil(CELL_POINTS).next_power_of_two();
        let level = columns.ilog2().div_ceil(2).min(6).min(bits);
        let record_len = 12 + info.attributes.iter().map(|a| a.size()).sum::<usize>();
        Ok(Self { min, bits, level, record_len, points: usize::try_from(info.points_declared)? })
    }

    pub(crate) fn cells(&self) -> usize {
        1 << (3 * self.level)
    }

    /// Bits of a code that tell points of a cell apart.
    pub(crate) fn code_bits(&self) -> u32 {
        3 * (self.bits - self.level)
    }

    /// Those bits of the code of a record.
    pub(crate) fn code(&self, record: &[u8]) -> u64 {
        let [x, y, z] = [0, 4, 8].map(|at| [record[at], record[at + 1], record[at + 2], record[at + 3]]);
        morton([x, y, z].map(u32::from_le_bytes)) & ((1 << self.code_bits()) - 1)
    }

    /// The cell of a position, counted from `min`.
    fn cell(&self, position: [u32; 3]) -> usize {
        morton(position.map(|v| v >> (self.bits - self.level))) as usize
    }
}

/// The records that one thread read.
pub(crate) struct Store {
    record_len: usize,
    /// Blocks of [`BLOCK`] records; what is not used yet is not touched.
    memory: Vec<u8>,
    used: usize,
    /// Of each cell: where its next record goes, and where the block for it ends; both 0 before the first.
    cursors: Vec<(usize, usize)>,
    /// Of each cell: where its blocks start.
    blocks: Vec<Vec<usize>>,
    pub(crate) points: u64,
}

impl Store {
    pub(crate) fn new(grid: &Grid) -> Self {
        let records = grid.points + grid.cells().min(grid.points) * BLOCK;
        let mut memory = vec![0; records * grid.record_len];
        prefer_large_pages(&mut memory);
        let (cursors, blocks) = (vec![(0, 0); grid.cells()], vec![Vec::new(); grid.cells()]);
        Self { record_len: grid.record_len, memory, used: 0, cursors, blocks, points: 0 }
    }

    /// The records of a cell, in blocks, of which the last may be shorter.
    pub(crate) fn blocks(&self, cell: usize) -> impl Iterator<Item = &[u8]> {
        let (next, end) = self.cursors[cell];
        let len = BLOCK * self.record_len;
        let block = move |start: &usize| &self.memory[*start..if start + len == end { next } else { start + len }];
        self.blocks[cell].iter().map(block)
    }

    /// Puts the points of a batch into their cells.
    pub(crate) fn add(&mut self, grid: &Grid, batch: &PointBatch) -> Result<()> {
        let Positions::Quantized(axes) = &batch.positions else { return Err("no lattice".into()) };
        let mut places = [0; RUN];
        for first in (0..batch.len()).step_by(RUN) {
            let places = &mut places[..RUN.min(batch.len() - first)];
            for (i, place) in places.iter_mut().enumerate() {
                let position: [i64; 3] = std::array::from_fn(|a| i64::from(axes[a][first + i]) - grid.min[a]);
                if position.iter().any(|v| v >> grid.bits != 0) {
                    return Err("a point lies outside of the bounds that the header declares".into());
                }
                let position = position.map(|v| v as u32);
                *place = self.place(grid.cell(position));
                self.memory[*place..][..12].copy_from_slice(position.map(u32::to_le_bytes).as_flattened());
            }
            let mut at = 12;
            for (column, attribute) in batch.columns.iter().zip(batch.attributes()) {
                let (elements, memory) = (attribute.elements, &mut self.memory[..]);
                with_column!(column, values => {
                    scatter(memory, places, at, &values[first * elements..], elements, |v| v.to_le_bytes());
                });
                at += attribute.size();
            }
            self.points += places.len() as u64;
        }
        Ok(())
    }

    /// Where the next record of a cell goes.
    fn place(&mut self, cell: usize) -> usize {
        let (next, end) = &mut self.cursors[cell];
        if next == end {
            (*next, *end) = (self.used, self.used + BLOCK * self.record_len);
            self.blocks[cell].push(self.used);
            self.used = *end;
        }
        *next += self.record_len;
        *next - self.record_len
    }
}

/// Writes the values of an attribute to byte `at` of the records at `places`.
fn scatter<T: Copy, const N: usize>(
    memory: &mut [u8],
    places: &[usize],
    at: usize,
    values: &[T],
    elements: usize,
    bytes: impl Fn(T) -> [u8; N],
) {
    for element in 0..elements {
        for (place, values) in places.iter().zip(values.chunks_exact(elements)) {
            memory[place + at + element * N..][..N].copy_from_slice(&bytes(values[element]));
        }
    }
}

/// Bit k of x, y and z goes to bits 3k, 3k + 1 and 3k + 2; coordinates below 2^21.
fn morton(coordinates: [u32; 3]) -> u64 {
    let [x, y, z] = coordinates.map(|v| {
        let v = u64::from(v);
        let v = (v | v << 32) & 0x001f_0000_0000_ffff;
        let v = (v | v << 16) & 0x001f_0000_ff00_00ff;
        let v = (v | v << 8) & 0x100f_00f0_0f00_f00f;
        let v = (v | v << 4) & 0x10c3_0c30_c30c_30c3;
        (v | v << 2) & 0x1249_2492_4924_9249
    });
    x | y << 1 | z << 2
}
