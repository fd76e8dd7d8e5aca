//! What the lattice of the run takes away of positions: points that it alone makes equal are no duplicates.

use pointmill_format::{Lattice, PointBatch, Positions};

use super::axis::{AxisMap, SourceMap};
use crate::cloud::JobColumns;

/// This part of a step (the finer of the source's and the run's) is rounding.
const SAME_PLACE: f64 = 1e-6;

/// Odd, with well-spread bits.
const FACTOR: u64 = 0x9e37_79b9_7f4a_7c15;

/// A mark for each point in `q`: two points of any sources that have one position on the lattice of the run, `job`, have the same
/// mark only if the sources have them at the same place (or, once in 2^64, by chance). It is 0 for points of the
/// lattice. `row` gives the row of the batch that a point comes from.
pub(super) fn marks(
    map: &SourceMap,
    own: Option<&Lattice>,
    job: &Lattice,
    batch: &PointBatch,
    q: &JobColumns,
    row: impl Fn(usize) -> usize,
    out: &mut Vec<u64>,
) {
    out.clear();
    out.resize(q.len(), 0);
    for (a, axis) in map.axes.iter().enumerate() {
        if matches!(axis, AxisMap::Exact { .. }) {
            continue;
        }
        let (scale, offset) = own.map_or((1.0, 0.0), |lattice| (lattice.scale[a], lattice.offset[a]));
        let (job_scale, job_offset) = (job.scale[a], job.offset[a]);
        let step = if own.is_some() { scale.min(job_scale) } else { 0.0 };
        for (i, (mark, q)) in out.iter_mut().zip(&q.0[a]).enumerate() {
            let world = match &batch.positions {
                Positions::Quantized(p) => f64::from(p[a][row(i)]) * scale + offset,
                Positions::World(p) => p[a][row(i)],
            };
            let slack = (4.0 * f64::EPSILON * (world.abs() + job_offset.abs())).max(SAME_PLACE * step);
            if (*q as f64 * job_scale + job_offset - world).abs() > slack {
                // adding 0 makes −0 the 0 that it means
                *mark = mix(*mark, a as u64, (world + 0.0).to_bits());
            }
        }
    }
}

#[inline]
fn mix(mark: u64, axis: u64, bits: u64) -> u64 {
    let product = u128::from(mark.wrapping_add(axis + 1) ^ bits.rotate_left(21 * axis as u32)) * u128::from(FACTOR);
    (product as u64) ^ (product >> 64) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marks_of(positions: Positions, own: Option<Lattice>, job: Lattice) -> (Vec<[i64; 3]>, Vec<u64>) {
        let map = SourceMap::new(own.as_ref(), &job);
        let mut q = JobColumns::default();
        for a in 0..3 {
            let world: Vec<f64> = match (&positions, &own) {
                (Positions::Quantized(p), Some(l)) => {
                    p[a].iter().map(|v| f64::from(*v) * l.scale[a] + l.offset[a]).collect()
                }
                (Positions::Quantized(_), None) => panic!("integers of no lattice"),
                (Positions::World(p), _) => p[a].clone(),
            };
            q.0[a] = world.iter().map(|w| job.quantize(a, *w)).collect();
        }
        let batch = PointBatch::new(0, positions, []);
        let mut out = Vec::new();
        marks(&map, own.as_ref(), &job, &batch, &q, |i| i, &mut out);
        ((0..q.len()).map(|i| q.point(i).0).collect(), out)
    }

    #[test]
    fn equal_positions_have_equal_marks_and_others_of_one_step_have_not() {
        let coarse = Lattice { scale: [1.0; 3], offset: [0.0; 3] };
        let x = vec![0.25, 0.25, 0.26, 0.0, -0.0, 1e-300, 1.25];
        let n = x.len();
        let (q, marks) = marks_of(Positions::World([x, vec![7.0; n], vec![0.5; n]]), None, coarse);
        assert_eq!((q[0], q[2]), (q[1], q[3]));
        assert_eq!((marks[0], marks[3]), (marks[1], marks[4]));
        assert!(marks[0] != marks[2] && marks[2] != marks[3] && marks[0] != marks[3]);
        assert_ne!(marks[3], marks[5], "two doubles, however near");
        let swapped = Positions::World([vec![0.25, 0.125], vec![0.125, 0.25], vec![0.0; 2]]);
        let (_, marks) = marks_of(swapped, None, coarse);
        assert_ne!(marks[0], marks[1]);
    }

    #[test]
    fn points_of_the_lattice_are_unmarked_in_sources_of_every_kind() {
        let job = Lattice { scale: [0.01; 3], offset: [500_000.0, 0.0, 0.0] };
        let world = Positions::World([vec![500_000.03, 500_000.035], vec![0.07; 2], vec![-0.29; 2]]);
        let marks = marks_of(world, None, job).1;
        assert_eq!((marks[0], marks[1] != 0), (0, true));
        let own = Lattice { scale: [0.003; 3], offset: [0.0; 3] };
        let marks = marks_of(Positions::Quantized([vec![10, 11], vec![0; 2], vec![0; 2]]), Some(own), job).1;
        assert_eq!((marks[0], marks[1] != 0), (0, true), "0.03 is a point of both");
        // finer than a millionth of the step, and still two places
        let fine = Lattice { scale: [1e-9; 3], offset: [500_000.0, 0.0, 0.0] };
        let (q, marks) = marks_of(Positions::Quantized([vec![0; 2], vec![1, 2], vec![0; 2]]), Some(fine), job);
        assert_eq!(q[0], q[1]);
        assert!(marks[0] != marks[1] && marks[0] != 0);
    }
}
