//! Batch records, and positions inside their boxes (`docs/formats/batches.md`, §5 and §6.1).

use bytemuck::{Pod, Zeroable};

use super::Precision;

/// A batch: 32 bytes, as they are in the file and in a shader's structured buffer.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct BatchRecord {
    /// Lower corner of the box, relative to the grid's origin, rounded down to float32.
    pub min: [f32; 3],
    /// Storage index of the first point.
    pub first_point: u32,
    /// Upper corner, rounded up.
    pub max: [f32; 3],
    /// Number of points.
    pub points: u32,
}

impl Precision {
    /// The least precision whose cells are smaller than `step` (world units, per axis) in every batch, so that
    /// rounding to the lattice gives every integer back.
    pub fn for_steps<'a>(records: impl IntoIterator<Item = &'a BatchRecord>, step: [f64; 3]) -> Self {
        let enough = |record: &BatchRecord, precision: Self| {
            let cells = f64::from(1u32 << precision.bits());
            record.sides().iter().zip(&step).all(|(s, step)| *s < cells * step)
        };
        records.into_iter().fold(Self::Ten, |least, record| {
            let needed = Self::ALL.into_iter().find(|p| enough(record, *p)).unwrap_or(Self::Thirty);
            least.max(needed)
        })
    }
}

impl BatchRecord {
    /// m: the lower corner in double precision.
    pub fn corner(&self) -> [f64; 3] {
        self.min.map(f64::from)
    }

    /// s: the sides of the box in double precision.
    pub fn sides(&self) -> [f64; 3] {
        std::array::from_fn(|a| f64::from(self.max[a]) - f64::from(self.min[a]))
    }

    /// q: 30-bit integers of a position relative to the origin that lies in the box.
    #[must_use]
    pub fn quantize(&self, relative: [f64; 3]) -> [u32; 3] {
        let (corner, sides) = (self.corner(), self.sides());
        std::array::from_fn(|a| quantize(relative[a], corner[a], sides[a]))
    }

    /// What turns the words of this batch into positions relative to the origin.
    #[must_use]
    pub fn decoder(&self, precision: Precision) -> Decoder {
        let cells = f64::from(1u32 << precision.bits());
        // a division by a power of two is exact: whether it comes before or after the product with t + 0.5 is all one
        Decoder { corner: self.corner(), step: self.sides().map(|s| s / cells), precision }
    }

    /// The position of 30-bit integers, relative to the origin: the middle of the cell that the top bits name.
    #[must_use]
    pub fn decode(&self, quantized: [u32; 3], precision: Precision) -> [f64; 3] {
        self.decoder(precision).position(quantized)
    }
}

/// One axis of [`BatchRecord::quantize`].
#[inline]
pub(crate) fn quantize(relative: f64, corner: f64, side: f64) -> u32 {
    const CELLS: f64 = (1u32 << 30) as f64;
    if side == 0.0 {
        return 0;
    }
    // `as` cuts towards 0, which is floor: r ≥ m
    (((relative - corner) / side * CELLS) as u32).min((1 << 30) - 1)
}

/// Decodes the positions of one batch with one number of bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decoder {
    corner: [f64; 3],
    /// Side of a cell.
    step: [f64; 3],
    precision: Precision,
}

impl Decoder {
    /// The position of 30-bit integers, relative to the origin.
    #[inline]
    #[must_use]
    pub fn position(&self, quantized: [u32; 3]) -> [f64; 3] {
        let shift = 30 - self.precision.bits();
        std::array::from_fn(|a| self.axis(a, quantized[a] >> shift))
    }

    /// The position of a point's words, relative to the origin; words of planes beyond the precision are not looked at.
    #[inline]
    pub fn position_of_words(&self, hi10: u32, mid10: u32, lo10: u32) -> [f64; 3] {
        std::array::from_fn(|a| {
            let bits = |word: u32| word >> (10 * a) & 1023;
            let top = match self.precision {
                Precision::Ten => bits(hi10),
                Precision::Twenty => bits(hi10) << 10 | bits(mid10),
                Precision::Thirty => bits(hi10) << 20 | bits(mid10) << 10 | bits(lo10),
            };
            self.axis(a, top)
        })
    }

    #[inline]
    fn axis(&self, axis: usize, top_bits: u32) -> f64 {
        self.corner[axis] + (f64::from(top_bits) + 0.5) * self.step[axis]
    }
}

/// The words [hi10, mid10, lo10] of 30-bit integers.
#[inline]
pub const fn planes(quantized: [u32; 3]) -> [u32; 3] {
    let [x, y, z] = quantized;
    [word(x >> 20, y >> 20, z >> 20), word(x >> 10, y >> 10, z >> 10), word(x, y, z)]
}

/// The 30-bit integers of words [hi10, mid10, lo10]; 0 for a plane that is absent. Bits 30 and 31 are ignored.
#[inline]
pub const fn quantized(planes: [u32; 3]) -> [u32; 3] {
    let [hi, mid, lo] = planes;
    [
        (hi & 1023) << 20 | (mid & 1023) << 10 | (lo & 1023),
        (hi >> 10 & 1023) << 20 | (mid >> 10 & 1023) << 10 | (lo >> 10 & 1023),
        (hi >> 20 & 1023) << 20 | (mid >> 20 & 1023) << 10 | (lo >> 20 & 1023),
    ]
}

#[inline]
const fn word(x: u32, y: u32, z: u32) -> u32 {
    (x & 1023) | (y & 1023) << 10 | (z & 1023) << 20
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOX: BatchRecord = BatchRecord { min: [10.0, 20.0, 5.0], first_point: 0, max: [18.0, 24.0, 6.0], points: 1 };

    #[test]
    fn the_example_of_the_format_page_holds() {
        let q = BOX.quantize([12.5, 23.0, 5.3]);
        assert_eq!(q, [0x1400_0000, 0x3000_0000, 0x1333_3333]);
        let [hi, mid, lo] = planes(q);
        assert_eq!([hi, mid, lo], [0x133c_0140, 0x0cc0_0000, 0x3330_0000]);
        assert_eq!(quantized([hi, mid, lo]), q);
        let decoder = BOX.decoder(Precision::Ten);
        assert_eq!(
            decoder.position_of_words(hi, u32::MAX, u32::MAX),
            [12.503_906_25, 23.001_953_125, 5.300_292_968_75]
        );
        let thirty = [12.500_000_003_725_29, 23.000_000_001_862_645, 5.300_000_000_279_397];
        assert_eq!(BOX.decode(q, Precision::Thirty), thirty);
        assert_eq!(BOX.decoder(Precision::Thirty).position_of_words(hi, mid, lo), thirty);
    }

    #[test]
    fn each_precision_takes_its_words_and_each_axis_its_bits() {
        let bits = [0x2aaa_5533, 0x1555_2acc, 0x0f0f_0f0f];
        let [hi, mid, lo] = planes(bits);
        // ten bits an axis, x lowest
        assert_eq!([hi, mid, lo].map(|word| word & 1023), [20, 10, 0].map(|shift| bits[0] >> shift & 1023));
        assert_eq!([hi, mid, lo].map(|word| word >> 10 & 1023), [20, 10, 0].map(|shift| bits[1] >> shift & 1023));
        assert_eq!([hi, mid, lo].map(|word| word >> 20), [20, 10, 0].map(|shift| bits[2] >> shift & 1023));
        assert_eq!(quantized([hi, mid, lo]), bits);
        for precision in Precision::ALL {
            let decoder = BOX.decoder(precision);
            assert_eq!(decoder.position_of_words(hi, mid, lo), decoder.position(bits), "{precision:?}");
        }
    }

    #[test]
    fn corners_of_the_box_err_by_half_a_cell_and_an_axis_without_extent_not_at_all() {
        assert_eq!(BOX.quantize([18.0, 24.0, 6.0]), [(1 << 30) - 1; 3], "the last cell is closed");
        for precision in Precision::ALL {
            let half = BOX.sides().map(|s| s / f64::from(2u32 << precision.bits()));
            for corner in [BOX.min, BOX.max].map(|c| c.map(f64::from)) {
                let decoded = BOX.decode(BOX.quantize(corner), precision);
                assert_eq!(std::array::from_fn(|a| (decoded[a] - corner[a]).abs()), half);
            }
        }
        let flat = BatchRecord { max: BOX.min, ..BOX };
        assert_eq!(flat.quantize(flat.corner()), [0; 3]);
        assert_eq!(flat.decode([0; 3], Precision::Ten), flat.corner());
    }

    #[test]
    fn a_point_is_in_the_cell_below_it_not_in_the_nearest() {
        // sides are powers of two, so cells are exact: 5 and 3/4 of a cell, just below and at a border
        let cells = |n: f64| std::array::from_fn(|a| BOX.corner()[a] + n * BOX.sides()[a] / f64::from(1u32 << 30));
        for (at, cell) in [(5.75, 5), (5.5, 5), (6.0, 6), (0.0, 0), (0.75, 0)] {
            assert_eq!(BOX.quantize(cells(at)), [cell; 3], "{at}");
        }
    }
}
