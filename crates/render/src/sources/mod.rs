//! Where points come from: units that are read one by one, on any thread.

mod batches;
mod bintree;
mod octree;
mod scans;

use std::ops::ControlFlow;

use pointmill_format::batches::BatchScratch;
use pointmill_format::{Aabb, Attribute, Column, Lattice, NodePoints, PointBatch, Positions, ReadError, Scratch};

pub(crate) use batches::BatchesSource;
pub(crate) use bintree::BintreeSource;
pub(crate) use octree::OctreeSource;
pub(crate) use scans::{ScanFile, ScansSource};

/// A run of points as it was decoded.
#[derive(Clone, Copy)]
pub(crate) struct Points<'a> {
    pub(crate) positions: &'a Positions,
    /// Of integer positions.
    pub(crate) lattice: Lattice,
    pub(crate) columns: &'a [Column],
}

impl<'a> Points<'a> {
    pub(crate) fn of_node(points: &'a NodePoints) -> Self {
        Self { positions: points.positions(), lattice: *points.lattice(), columns: points.columns() }
    }

    pub(crate) fn of_batch(batch: &'a PointBatch, lattice: Option<Lattice>) -> Self {
        let lattice = lattice.unwrap_or(Lattice { scale: [1.0; 3], offset: [0.0; 3] });
        Self { positions: &batch.positions, lattice, columns: &batch.columns }
    }

    pub(crate) fn len(&self) -> usize {
        self.positions.len()
    }

    /// World coordinates.
    pub(crate) fn world(&self, index: usize) -> Option<[f64; 3]> {
        match self.positions {
            Positions::Quantized([x, y, z]) => {
                let stored = [*x.get(index)?, *y.get(index)?, *z.get(index)?];
                Some(self.lattice.world(stored.map(i64::from)))
            }
            Positions::World([x, y, z]) => Some([*x.get(index)?, *y.get(index)?, *z.get(index)?]),
        }
    }
}

/// Memory that a thread reuses from unit to unit.
#[derive(Default)]
pub(crate) struct Buffers {
    pub(crate) node: NodePoints,
    pub(crate) batch: BatchScratch,
    pub(crate) scan: Scratch,
}

/// What is known of a unit before it is read.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Unit {
    /// Points that it draws, or what a header says of that.
    pub(crate) points: u64,
    /// Level of detail of all of its points.
    pub(crate) level: u8,
    /// Bits that are decoded of its positions, where there is a choice.
    pub(crate) bits: Option<u32>,
    /// Box, world units, where it is known.
    pub(crate) bounds: Option<Aabb>,
    /// Of each of its points.
    pub(crate) size: UnitSize,
}

/// How large the points of a unit are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum UnitSize {
    /// One pixel.
    One,
    /// Pixels.
    Pixels(f32),
    /// World units.
    World(f32),
    /// [`Source::size_at`] knows.
    Each,
}

impl Unit {
    /// Points without anything known of them.
    pub(crate) const fn new(points: u64) -> Self {
        Self { points, level: 0, bits: None, bounds: None, size: UnitSize::One }
    }
}

/// Distance between points that cover a box as a surface does: the root of its largest face over their number, world units.
pub(crate) fn surface_spacing(extent: [f64; 3], points: u64) -> f32 {
    let mut sides = extent;
    sides.sort_unstable_by(f64::total_cmp);
    (sides[1].max(sides[2] * 1e-3) * sides[2] / points.max(1) as f64).sqrt() as f32
}

/// Takes the points of a unit, run by run.
pub(crate) type Take<'a> = dyn FnMut(Points<'_>) -> ControlFlow<()> + 'a;

/// Points in units, for the renderer.
pub(crate) trait Source: Sync {
    /// The file or dataset, for messages.
    fn name(&self) -> String;

    /// How many units there are to draw.
    fn len(&self) -> usize;

    /// What is known of one.
    fn unit(&self, index: usize) -> Unit;

    /// The columns of the points of a unit.
    fn attributes(&self, unit: usize) -> Vec<Attribute>;

    /// Reads a unit, with the attributes that `wanted` has where that is a choice. Gives the bytes that were read, as stored.
    ///
    /// # Errors
    /// Those of its format.
    fn read(&self, unit: usize, wanted: &[&str], buffers: &mut Buffers, take: &mut Take<'_>) -> Result<u64, ReadError>;

    /// False for points that this picture does not want. `view`: right, up and depth from the eye, world units.
    fn keeps(&self, _unit: usize, _points: &Points<'_>, _index: usize, _view: [f64; 3]) -> bool {
        true
    }

    /// Size of a point where [`UnitSize::Each`] says so, world units; 0 for one pixel. `view` as for [`Self::keeps`].
    fn size_at(&self, _unit: usize, _points: &Points<'_>, _index: usize, _view: [f64; 3]) -> f32 {
        0.0
    }
}
