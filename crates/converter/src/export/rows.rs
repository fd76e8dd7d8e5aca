//! Points on their way from batches to a file: positions as the file has them, attributes as records.

use pointmill_format::scan::las::write::StridedColumn;
use pointmill_format::{AttributeType, Column, Lattice, PointBatch, Positions};

use crate::cloud::{JobBounds, JobColumns, Stats};
use crate::gather::{Moved, Part, Rows, Visit, moves, quantize_axis};
use crate::runtime::TILE_POINTS;
use crate::sources::Schema;

/// What positions become.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Target {
    /// Integers of this lattice, 32 bits each.
    Lattice(Lattice),
    /// World coordinates.
    World,
}

/// Points that are encoded together.
pub(super) struct Block {
    target: Target,
    stride: usize,
    /// Records of the schema; of the position at their start, integers alone are filled.
    rows: Vec<u8>,
    world: [Vec<f64>; 3],
    q: JobColumns,
    change: [Vec<f64>; 3],
}

/// Rows that are taken at a time: their columns stay in the second-level cache.
const SLICE: usize = 8192;

impl Block {
    pub(super) fn new(target: Target, schema: &Schema) -> Self {
        let (q, change) = (JobColumns::default(), Default::default());
        Self { target, stride: schema.stride, rows: Vec::new(), world: Default::default(), q, change }
    }

    /// Points.
    pub(super) fn len(&self) -> usize {
        self.rows.len() / self.stride
    }

    pub(super) fn clear(&mut self) {
        self.rows.clear();
        self.world.iter_mut().for_each(Vec::clear);
    }

    /// The column of an attribute of the schema.
    pub(super) fn column(&self, schema: &Schema, i: usize) -> StridedColumn<'_> {
        let a = &schema.attributes[i];
        StridedColumn::new(&self.rows, schema.offsets[i], self.stride, a.ty, a.elements)
    }

    /// x, y and z of integers.
    pub(super) fn positions(&self) -> [StridedColumn<'_>; 3] {
        [0, 4, 8].map(|at| StridedColumn::new(&self.rows, at, self.stride, AttributeType::Int32, 1))
    }

    /// x, y and z of the world.
    pub(super) fn world(&self) -> [&[f64]; 3] {
        self.world.each_ref().map(Vec::as_slice)
    }

    /// The record of a point.
    pub(super) fn row(&self, i: usize) -> &[u8] {
        &self.rows[i * self.stride..(i + 1) * self.stride]
    }

    /// Adds rows of a batch; false if an integer does not fit, which leaves the block without them.
    pub(super) fn add(
        &mut self,
        visit: &mut Visit<'_>,
        batch: &PointBatch,
        columns: &[&Column],
        rows: &Rows<'_>,
        schema: &Schema,
        stats: &mut Stats,
    ) -> bool {
        let count = rows.len();
        for start in (0..count).step_by(SLICE) {
            let slice = rows.slice(start..(start + SLICE).min(count));
            match self.target {
                Target::Lattice(lattice) => {
                    let bounds = self.quantize(visit, batch, &slice, &lattice, stats);
                    stats.bounds.union(&bounds);
                    let fits = |v: i64| i32::try_from(v).is_ok();
                    if !bounds.min.0.iter().chain(&bounds.max.0).all(|v| fits(*v)) {
                        return false;
                    }
                }
                Target::World => self.add_world(visit, batch, &slice),
            }
            self.add_rows(&slice, &Part::of(columns, &visit.intake.columns, schema));
        }
        true
    }

    /// Records of a slice, zeros in what the source does not have.
    fn add_rows(&mut self, rows: &Rows<'_>, parts: &[Part<'_>]) {
        let (stride, written) = (self.stride, self.rows.len());
        self.rows.resize(written + rows.len() * stride, 0);
        for (i, tile) in self.rows[written..].chunks_mut(TILE_POINTS * stride).enumerate() {
            let (first, count) = (i * TILE_POINTS, tile.len() / stride);
            if matches!(self.target, Target::Lattice(_)) {
                let [x, y, z] = self.q.0.each_ref().map(|axis| &axis[first..first + count]);
                for (i, record) in tile.chunks_exact_mut(stride).enumerate() {
                    for (to, q) in record[..12].as_chunks_mut::<4>().0.iter_mut().zip([x[i], y[i], z[i]]) {
                        *to = (q as i32).to_le_bytes();
                    }
                }
            }
            parts.iter().for_each(|part| part.put(tile, stride, rows.part(first, count)));
        }
    }

    /// Puts positions on the lattice, and measures how far they move.
    fn quantize(
        &mut self,
        visit: &mut Visit<'_>,
        batch: &PointBatch,
        rows: &Rows<'_>,
        lattice: &Lattice,
        stats: &mut Stats,
    ) -> JobBounds {
        let mut bounds = JobBounds::EMPTY;
        let mut moved = [Moved::By(0.0); 3];
        for (a, moved) in moved.iter_mut().enumerate() {
            let (q, change) = (&mut self.q.0[a], &mut self.change[a]);
            q.clear();
            change.clear();
            *moved = quantize_axis(&visit.map, a, &batch.positions, rows, q, change);
            let extent = |(min, max): (i64, i64), v: &i64| (min.min(*v), max.max(*v));
            (bounds.min.0[a], bounds.max.0[a]) = q.iter().fold((i64::MAX, i64::MIN), extent);
        }
        let axes = std::array::from_fn(|a| match moved[a] {
            Moved::By(by) => Ok(by),
            Moved::Each => Err(&self.change[a][..]),
        });
        stats.change.add(self.q.len(), axes);
        stats.moves = stats.moves || moves(&axes, &self.q, &bounds, lattice);
        bounds
    }

    fn add_world(&mut self, visit: &Visit<'_>, batch: &PointBatch, rows: &Rows<'_>) {
        for (a, out) in self.world.iter_mut().enumerate() {
            match &batch.positions {
                Positions::World(p) => out.extend((0..rows.len()).map(|i| p[a][rows.row(i)])),
                Positions::Quantized(p) => {
                    let (scale, offset) = visit.lattice().map_or((1.0, 0.0), |l| (l.scale[a], l.offset[a]));
                    out.extend((0..rows.len()).map(|i| f64::from(p[a][rows.row(i)]) * scale + offset));
                }
            }
        }
    }
}
