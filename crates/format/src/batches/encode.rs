//! One batch: from positions to a record, words and errors (`docs/formats/batches.md`, §5).

use std::borrow::Cow;

use super::describe::{ErrorFigures, PlaneErrors};
use super::record::quantize;
use super::{BATCH_POINTS, BatchRecord, Precision, f32_above, f32_below};
use crate::{Deviations, WriteError};

/// A batch as it goes to the file. Reuse one: its vectors keep their memory.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct EncodedBatch {
    /// Box, first point, number of points.
    pub record: BatchRecord,
    /// Bits 29–20 of each point.
    pub hi10: Vec<u32>,
    /// Bits 19–10.
    pub mid10: Vec<u32>,
    /// Bits 9–0.
    pub lo10: Vec<u32>,
    /// How far decoded positions are from the input.
    pub errors: ErrorSums,
}

impl Default for EncodedBatch {
    fn default() -> Self {
        let record = BatchRecord { min: [0.0; 3], first_point: 0, max: [0.0; 3], points: 0 };
        Self { record, hi10: Vec::new(), mid10: Vec::new(), lo10: Vec::new(), errors: ErrorSums::default() }
    }
}

/// Errors of decoded positions, summed up: by plane count (one, two, three), then by axis. World units.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct ErrorSums {
    /// Points that were looked at.
    pub points: u64,
    /// Largest error.
    pub max: [[f64; 3]; 3],
    /// Sum of errors, decoded less meant.
    pub sum: [[f64; 3]; 3],
    /// Sum of squared errors.
    pub squares: [[f64; 3]; 3],
    /// Square of a distance in space that no error of that plane count exceeds: the sum of the squares of the largest
    /// errors on the axes, greatest of the batches.
    pub max_squared_3d: [f64; 3],
}

impl ErrorSums {
    /// Adds another sum. Sums of doubles depend on the order: batches are added in **Morton order**.
    pub fn merge(&mut self, other: &Self) {
        self.points += other.points;
        for plane in 0..3 {
            for axis in 0..3 {
                self.max[plane][axis] = self.max[plane][axis].max(other.max[plane][axis]);
                self.sum[plane][axis] += other.sum[plane][axis];
                self.squares[plane][axis] += other.squares[plane][axis];
            }
            self.max_squared_3d[plane] = self.max_squared_3d[plane].max(other.max_squared_3d[plane]);
        }
    }

    /// Largest and RMS errors of 10, 20 and 30 bits; 0 without points.
    #[must_use]
    pub fn figures(&self) -> PlaneErrors {
        let points = self.points.max(1) as f64;
        let of = |plane: usize| {
            let rms = self.squares[plane].map(|sum| (sum / points).sqrt());
            Some(ErrorFigures { max: self.max[plane], rms })
        };
        PlaneErrors { ten: of(0), twenty: of(1), thirty: of(2) }
    }

    /// The errors of one plane count.
    #[must_use]
    pub fn deviations(&self, precision: Precision) -> Deviations {
        let plane = precision as usize;
        Deviations {
            points: self.points,
            max: self.max[plane],
            sum: self.sum[plane],
            squares: self.squares[plane],
            max_squared_3d: self.max_squared_3d[plane],
        }
    }
}

/// Encodes one batch into `out`.
///
/// `first_point`: the storage index of its slot, 10240 · [`super::swap_slot`]. `positions`: r = p − origin
/// ([`super::Grid::relative`]), one slice an axis, in Morton order, finite and ≥ 0.
///
/// # Errors
/// [`WriteError::Input`] if there are no points, more than 10,240, or not as many on each axis.
pub fn encode_batch(first_point: u32, positions: [&[f64]; 3], out: &mut EncodedBatch) -> Result<(), WriteError> {
    let points = positions[0].len();
    if points == 0 || points > BATCH_POINTS as usize || positions.iter().any(|p| p.len() != points) {
        let found = positions.map(<[f64]>::len);
        return Err(WriteError::input(format!("{found:?} coordinates are no batch; it has 1 to 10240 on each axis")));
    }
    let [x, y, z] = positions.map(range);
    out.record = BatchRecord { min: [x.0, y.0, z.0], first_point, max: [x.1, y.1, z.1], points: points as u32 };
    for plane in [&mut out.hi10, &mut out.mid10, &mut out.lo10] {
        plane.clear();
        plane.resize(points, 0);
    }
    out.errors = ErrorSums { points: points as u64, ..ErrorSums::default() };
    for (axis, coordinates) in positions.into_iter().enumerate() {
        encode_axis(axis, coordinates, out);
    }
    let errors = &mut out.errors;
    errors.max_squared_3d = errors.max.map(|max| max.iter().map(|v| v * v).sum());
    Ok(())
}

/// Least and greatest coordinate, rounded outwards.
fn range(coordinates: &[f64]) -> (f32, f32) {
    let (mut least, mut greatest) = (f64::INFINITY, f64::NEG_INFINITY);
    for r in coordinates {
        least = least.min(*r);
        greatest = greatest.max(*r);
    }
    (f32_below(least), f32_above(greatest))
}

fn encode_axis(axis: usize, coordinates: &[f64], out: &mut EncodedBatch) {
    let (corner, side) = (out.record.corner()[axis], out.record.sides()[axis]);
    let steps = [10, 20, 30].map(|bits| side / f64::from(1u32 << bits));
    let (mut max, mut sum, mut squares) = ([0f64; 3], [0f64; 3], [0f64; 3]);
    let shift = 10 * axis;
    let words = out.hi10.iter_mut().zip(&mut out.mid10).zip(&mut out.lo10);
    for (r, ((hi, mid), lo)) in coordinates.iter().zip(words) {
        let q = quantize(*r, corner, side);
        *hi |= (q >> 20) << shift;
        *mid |= (q >> 10 & 1023) << shift;
        *lo |= (q & 1023) << shift;
        for (plane, top_bits) in [q >> 20, q >> 10, q].into_iter().enumerate() {
            let error = corner + (f64::from(top_bits) + 0.5) * steps[plane] - r;
            max[plane] = max[plane].max(error.abs());
            sum[plane] += error;
            squares[plane] += error * error;
        }
    }
    for plane in 0..3 {
        out.errors.max[plane][axis] = max[plane];
        out.errors.sum[plane][axis] = sum[plane];
        out.errors.squares[plane][axis] = squares[plane];
    }
}

/// Words as they are in the file: without a copy on a little-endian host.
#[must_use]
pub fn le_bytes(words: &[u32]) -> Cow<'_, [u8]> {
    if cfg!(target_endian = "little") {
        Cow::Borrowed(bytemuck::cast_slice(words))
    } else {
        Cow::Owned(words.iter().flat_map(|w| w.to_le_bytes()).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batches::{Precision, quantized};

    #[test]
    fn errors_are_those_of_decoding_and_attain_the_bound() {
        // all borders of 10-bit cells, and both ends
        let line: Vec<f64> = (0..=1024).map(|i| f64::from(i) / 256.0).collect();
        let zeros = vec![0.0; line.len()];
        let third: Vec<f64> = line.iter().map(|v| v / 3.0).collect();
        let mut batch = EncodedBatch::default();
        encode_batch(20_480, [&line, &third, &zeros], &mut batch).unwrap();
        assert_eq!((batch.record.first_point, batch.record.points, batch.record.max[0]), (20_480, 1025, 4.0));
        let figures = batch.errors.figures();
        for precision in Precision::ALL {
            let figures = figures.get(precision).unwrap();
            assert_eq!(figures.max[0], 4.0 / f64::from(2u32 << precision.bits()), "attained");
            assert_eq!(figures.max[2], 0.0, "no extent, no error");
            let decoder = batch.record.decoder(precision);
            let deviations = batch.errors.deviations(precision);
            let (mut largest, mut sum) = ([0f64; 3], 0.0);
            for (i, r) in line.iter().enumerate() {
                let q = quantized([batch.hi10[i], batch.mid10[i], batch.lo10[i]]);
                let p = decoder.position(q);
                let error = [(p[0] - r).abs(), (p[1] - third[i]).abs(), p[2].abs()];
                largest = std::array::from_fn(|a| largest[a].max(error[a]));
                sum += p[1] - third[i];
                assert!(error.iter().map(|e| e * e).sum::<f64>() <= deviations.max_squared_3d);
            }
            assert_eq!((largest, sum), (figures.max, deviations.sum[1]));
            assert_eq!((deviations.max, deviations.points), (figures.max, 1025));
        }
    }

    #[test]
    fn what_is_no_batch_is_refused() {
        let mut out = EncodedBatch::default();
        let many = vec![0.0; 10_241];
        for positions in [[&[][..]; 3], [&many[..]; 3], [&many[..2], &many[..2], &many[..1]]] {
            assert!(matches!(encode_batch(0, positions, &mut out), Err(WriteError::Input(_))));
        }
        assert!(encode_batch(0, [&many[..10_240]; 3], &mut out).is_ok());
    }
}
