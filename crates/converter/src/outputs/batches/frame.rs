//! From stored records to the grid of the batches, and the size of the grid's cells.

use pointmill_format::batches::{Grid, morton32};
use pointmill_format::{Aabb, DatasetKind, Lattice, WriteError};

use super::density::fitting_cell;
use crate::cloud::morton::interleave;
use crate::cloud::{Cloud, JobBounds, JobPoint, StoredOrigin, StoredPoint};
use crate::error::{ConvertError, Unsupported};
use crate::plan::{PlanError, PlanFault, Setting};

/// Levels of buckets: what is called a start is a Morton code of that many bits per axis.
pub(super) const BUCKET_LEVELS: u32 = 21;

/// How stored integers become positions, cells and Morton codes. Every step is monotonous on each axis, so boxes of
/// points become boxes of codes.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    pub(super) grid: Grid,
    /// World box of all points.
    pub(super) tight: Aabb,
    /// The source lattice: world = X · scale + offset.
    pub(super) lattice: Lattice,
    /// From stored coordinates to X.
    origin: StoredOrigin,
    /// 1 / cell, if that is exact: products are then the same as quotients, and faster.
    reciprocal: Option<f64>,
    /// Morton steps in a cell.
    morton_scale: f64,
    /// Steps of the bucket codes in a cell.
    bucket_scale: f64,
}

impl Frame {
    pub(super) fn new(cloud: &Cloud<'_>, lod_cell: Option<f64>) -> Result<Self, ConvertError> {
        let bounds = &cloud.stats.bounds;
        let lattice = cloud.lattice.lattice;
        let tight = Aabb { min: lattice.world(bounds.min.0), max: lattice.world(bounds.max.0) };
        let cell = lod_cell.unwrap_or_else(|| fitting_cell(cloud, &tight));
        let grid = Grid::new(&tight, cell).map_err(refused)?;
        Ok(Self::of_grid(grid, tight, lattice, cloud.frame.origin))
    }

    pub(super) fn of_grid(grid: Grid, tight: Aabb, lattice: Lattice, origin: StoredOrigin) -> Self {
        let power = |bits: u32| 2f64.powi(bits as i32 - grid.exponent as i32);
        let is_power_of_two = grid.cell.to_bits() << 12 == 0 && grid.cell.is_normal() && grid.cell.recip().is_normal();
        Self {
            grid,
            tight,
            lattice,
            origin,
            reciprocal: is_power_of_two.then(|| grid.cell.recip()),
            morton_scale: power(grid.morton_bits),
            bucket_scale: power(BUCKET_LEVELS),
        }
    }

    /// r of a stored position: relative to the origin, world units.
    #[inline]
    pub(super) fn relative(&self, stored: StoredPoint) -> [f64; 3] {
        self.relative_of(self.origin.job(stored))
    }

    #[inline]
    fn relative_of(&self, quantized: JobPoint) -> [f64; 3] {
        let Self { grid, lattice, .. } = self;
        std::array::from_fn(|a| (quantized[a] as f64 * lattice.scale[a] + lattice.offset[a]) - grid.origin[a])
    }

    /// u of a relative position: in cells.
    #[inline]
    pub(super) fn cells(&self, relative: f64) -> f64 {
        match self.reciprocal {
            Some(reciprocal) => relative * reciprocal,
            None => relative / self.grid.cell,
        }
    }

    /// Morton coordinates of a stored position.
    #[inline]
    pub(super) fn morton(&self, stored: StoredPoint) -> [u32; 3] {
        self.relative(stored).map(|r| (self.cells(r) * self.morton_scale) as u32)
    }

    /// The code of Morton coordinates, 63 or 96 bits.
    #[inline]
    pub(super) fn code(&self, morton: [u32; 3]) -> u128 {
        if self.is_wide() { morton32(morton) } else { u128::from(code_of(morton)) }
    }

    /// The code of a stored position, if codes have 63 bits.
    #[inline]
    pub(super) fn narrow_code(&self, stored: StoredPoint) -> u64 {
        code_of(self.morton(stored))
    }

    /// True if codes have more than 63 bits.
    pub(super) fn is_wide(&self) -> bool {
        self.grid.morton_bits > BUCKET_LEVELS
    }

    /// The code at which the bucket that begins at `start` begins.
    pub(super) fn first_code(&self, start: u64) -> u128 {
        u128::from(start) << (3 * (self.grid.morton_bits - BUCKET_LEVELS))
    }

    /// Coordinates of the finest bucket that holds a stored position.
    #[inline]
    pub(super) fn bucket(&self, stored: StoredPoint) -> [u32; 3] {
        self.relative(stored).map(|r| (self.cells(r) * self.bucket_scale) as u32)
    }

    /// The finest buckets in which points inside a box of the lattice can lie, first and last on each axis.
    pub(super) fn buckets_of(&self, bounds: &JobBounds) -> [[u32; 3]; 2] {
        [bounds.min, bounds.max].map(|q| self.relative_of(q).map(|r| (self.cells(r) * self.bucket_scale) as u32))
    }

    /// Low bits of a Morton coordinate that a step of the lattice cannot change alone.
    pub(super) fn idle_bits(&self) -> u32 {
        let finest = self.lattice.scale.into_iter().fold(f64::INFINITY, f64::min);
        let step = finest / self.grid.cell * self.morton_scale;
        if step >= 2.0 { (step.log2() as u32).min(self.grid.morton_bits - 1) } else { 0 }
    }
}

/// The code of coordinates of 21 bits: here x has the lowest bit of each triple, in octrees the highest.
#[inline]
pub(super) fn code_of([x, y, z]: [u32; 3]) -> u64 {
    interleave([z, y, x])
}

/// A cloud or request that the format cannot hold.
pub(super) fn refused(error: WriteError) -> ConvertError {
    match error {
        WriteError::Cell(_) | WriteError::CellTooSmall { .. } => {
            PlanError::new(Setting::LodCell, PlanFault::Cell(error.to_string())).into()
        }
        WriteError::TooManyPoints(_) | WriteError::Extent(..) | WriteError::Input(_) => {
            Unsupported::Format { kind: DatasetKind::Batches, what: error.to_string() }.into()
        }
        other => ConvertError::Internal(format!("batches: {other}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(cell: f64, scale: f64, extent: i64) -> Frame {
        let lattice = Lattice { scale: [scale; 3], offset: [500_000.0, -4e6, 0.25] };
        let tight = Aabb { min: lattice.world([-extent; 3]), max: lattice.world([extent; 3]) };
        Frame::of_grid(Grid::new(&tight, cell).unwrap(), tight, lattice, StoredOrigin(JobPoint([0; 3])))
    }

    #[test]
    fn codes_are_those_of_the_format_whatever_the_cell() {
        for (cell, scale) in [(1.0, 0.01), (0.3, 0.01), (0.25, 0.001), (1e-4, 0.01), (4096.0, 0.01)] {
            let f = frame(cell, scale, 1_000_000);
            for q in [[0; 3], [1, 2, 3], [-1_000_000; 3], [1_000_000; 3], [-5, 999_999, 77]] {
                let u = f.grid.cells(f.grid.relative(f.lattice.world(q)));
                let stored = StoredPoint(q.map(|v| v as i32));
                assert_eq!(f.code(f.morton(stored)), f.grid.morton_code(u), "{cell}");
                let shift = f.grid.morton_bits - BUCKET_LEVELS;
                assert_eq!(f.bucket(stored), f.morton(stored).map(|m| m >> shift));
                assert!(f.first_code(code_of(f.bucket(stored))) <= f.code(f.morton(stored)));
            }
        }
    }

    #[test]
    fn idle_bits_are_below_the_step() {
        let f = frame(1.0, 0.01, 100_000);
        let bits = f.idle_bits();
        assert!(bits > 0 && 2f64.powi(bits as i32) <= 0.01 * f.morton_scale);
        assert_eq!(frame(1024.0, 1e-6, 1_000).idle_bits(), 0);
    }
}
