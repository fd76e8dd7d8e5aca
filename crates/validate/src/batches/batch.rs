//! One batch: its bytes, and the points decoded from them. Batches are handled in parallel.

use pointmill_format::ReadError;

use super::batch_records::Box32;
use super::blocks::{Cache, Column};
use super::bytes::u32_at;
use super::formulas::{BATCH, decode, distance_squared, morton, power};
use super::header::Header;
use super::originals::Entry;
use super::positions::{Axis, Recovered};
use super::task::Task;

/// The bytes of one batch.
#[derive(Debug)]
pub(crate) struct Raw {
    /// Number in Morton order.
    pub(crate) number: u64,
    pub(crate) slot: u64,
    pub(crate) bounds: Box32,
    /// For each plane, one word per point.
    pub(crate) planes: Vec<Vec<u32>>,
    pub(crate) colours: Vec<u32>,
    /// For each extra attribute, its bytes.
    pub(crate) extras: Vec<Vec<u8>>,
    /// If there are usable originals.
    pub(crate) originals: Option<Vec<Entry>>,
}

impl Raw {
    /// Reads the batch at `slot`; `None` if its box or one of its blocks is broken.
    ///
    /// # Errors
    /// The operating system cannot read the file.
    pub(crate) fn read(task: &Task<'_>, cache: &Cache, number: u64, slot: u64) -> Result<Option<Self>, ReadError> {
        let Some(bounds) = task.boxes[slot as usize] else { return Ok(None) };
        let mut columns = Vec::new();
        for column in task.columns.iter().enumerate() {
            let mut bytes = Vec::new();
            if !cache.slot(task.bytes, task.header, (column.0, column.1), slot, &mut bytes)? {
                return Ok(None);
            }
            columns.push(bytes);
        }
        let extras = columns.split_off(task.header.planes() + 1);
        let words = |bytes: &Vec<u8>| bytes.chunks_exact(4).map(|w| u32_at(w, 0)).collect::<Vec<u32>>();
        let colours = columns.pop().map_or_else(Vec::new, |c| words(&c));
        let planes = columns.iter().map(words).collect();
        let originals = match task.originals {
            Some(originals) => Some(originals.of_slot(task.bytes, slot, &mut Vec::new())?),
            None => None,
        };
        Ok(Some(Self { number, slot, bounds, planes, colours, extras, originals }))
    }

    /// Points.
    pub(crate) fn len(&self) -> usize {
        self.colours.len()
    }

    /// Storage index of point `i` of the batch.
    pub(crate) fn index(&self, i: usize) -> u64 {
        BATCH * self.slot + i as u64
    }

    /// The level of point `i`.
    pub(crate) fn level(&self, i: usize) -> u32 {
        self.colours[i] >> 24
    }

    /// q of an axis, absent bits 0.
    pub(crate) fn q(&self, i: usize, axis: u32) -> u32 {
        self.planes.iter().zip([20, 10, 0]).fold(0, |q, (plane, shift)| q | (plane[i] >> (10 * axis) & 1023) << shift)
    }
}

/// Columns in the order that [`Raw::read`] expects: planes, colour, extras.
pub(crate) fn columns(sections: &super::sections::Sections) -> Vec<&Column> {
    sections.planes.iter().chain([&sections.colour]).chain(&sections.extras).collect()
}

/// Where the points are.
#[derive(Debug, Default)]
pub(crate) struct Points {
    /// Lattice integers, x, y, z.
    pub(crate) x: [Vec<i64>; 3],
    /// Relative to the origin, of the lattice integers.
    pub(crate) r: [Vec<f64>; 3],
    /// The planes leave a choice of lattice points on some axis.
    pub(crate) ambiguous: Vec<bool>,
    /// Axes on which some point is ambiguous.
    pub(crate) ambiguous_axis: [bool; 3],
    /// No lattice point has this q: how many points, and the first one's index in the batch.
    pub(crate) foreign: Option<(u64, usize)>,
}

impl Points {
    /// Recovers the lattice integers of a batch.
    pub(crate) fn new(raw: &Raw, axes: &[Axis; 3], bits: u32) -> Self {
        let n = raw.len();
        let mut points = Self { ambiguous: vec![false; n], ..Self::default() };
        let mut foreign = vec![false; n];
        for (a, axis) in axes.iter().enumerate() {
            points.x[a].reserve_exact(n);
            points.r[a].reserve_exact(n);
            for (i, foreign) in foreign.iter_mut().enumerate() {
                let x = match axis.recover(raw.q(i, a as u32) >> (30 - bits)) {
                    Recovered::Exact(x) => x,
                    Recovered::Ambiguous(x) => {
                        points.ambiguous[i] = true;
                        points.ambiguous_axis[a] = true;
                        x
                    }
                    Recovered::Foreign(x) => {
                        *foreign = true;
                        x
                    }
                };
                points.x[a].push(x);
                points.r[a].push(axis.relative(x));
            }
        }
        let count = foreign.iter().filter(|f| **f).count() as u64;
        points.foreign = foreign.iter().position(|f| *f).map(|first| (count, first));
        points
    }

    /// The points of a batch whose lattice integers are known, in storage order, from the sources.
    pub(crate) fn known(raw: &Raw, axes: &[Axis; 3], bits: u32, known: &[[i64; 3]]) -> Self {
        let fits = |i: usize, a: usize| axes[a].top(known[i][a]) == raw.q(i, a as u32) >> (30 - bits);
        let foreign = |i: &usize| (0..3).any(|a| !fits(*i, a));
        let count = (0..known.len()).filter(foreign).count() as u64;
        Self {
            x: [0, 1, 2].map(|a| known.iter().map(|x| x[a]).collect()),
            r: [0, 1, 2].map(|a| known.iter().map(|x| axes[a].relative(x[a])).collect()),
            ambiguous: vec![false; known.len()],
            ambiguous_axis: [false; 3],
            foreign: (0..known.len()).find(foreign).map(|first| (count, first)),
        }
    }

    /// Lattice integers of point `i`.
    pub(crate) fn lattice(&self, i: usize) -> [i64; 3] {
        [self.x[0][i], self.x[1][i], self.x[2][i]]
    }
}

/// The grid of §2.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Grid {
    pub(crate) cell: f64,
    /// e.
    pub(crate) exponent: i32,
    /// n.
    pub(crate) bits: i32,
}

impl Grid {
    /// The grid of a file.
    pub(crate) fn new(header: &Header) -> Self {
        Self { cell: header.cell, exponent: header.exponent(), bits: header.morton_bits() }
    }

    /// The Morton code of a position relative to the origin.
    #[inline]
    pub(crate) fn code(&self, r: [f64; 3]) -> u128 {
        let factor = power(self.bits - self.exponent);
        morton(r.map(|r| (r / self.cell * factor).floor() as u32)) // saturates where the header's box is wrong
    }

    /// Squared distances from the centres of the cells of level 0, 1, 2.
    #[inline]
    pub(crate) fn distances(&self, r: [f64; 3]) -> [f64; 3] {
        let u = r.map(|r| r / self.cell);
        [0, 1, 2].map(|level| distance_squared(u, level))
    }

    /// The cell of a level that a Morton code lies in: a number that is the same for all codes of the cell.
    #[inline]
    pub(crate) fn cell_of(&self, code: u128, level: i32) -> u128 {
        code >> (3 * (self.bits - self.exponent - level))
    }
}

/// The corners of the cell that point `i` is known to be in, widened by what rounding may hide.
pub(crate) fn corners(raw: &Raw, i: usize, bits: u32) -> [[f64; 3]; 2] {
    let cells = [0, 1, 2].map(|axis| {
        let (m, s) = (raw.bounds.min(axis), raw.bounds.side(axis));
        let t = raw.q(i, axis as u32) >> (30 - bits);
        let middle = decode(t, m, s, bits);
        let half = s / power(bits as i32 + 1) + 2.0 * raw.bounds.rounding(axis);
        [(middle - half).max(m), (middle + half).min(f64::from(raw.bounds.max[axis]))]
    });
    [0, 1].map(|side| cells.map(|cell| cell[side]))
}
