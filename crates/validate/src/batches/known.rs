//! Lattice integers from the sources, for files whose planes do not determine them.
//!
//! Points of one place are interchangeable as far as positions go, so the sources' positions in the order of §3.1 are
//! those of the file point by point. Then q must be their code, and everything is checked as if the planes determined them.

use pointmill_format::{Lattice, ReadError};
use rayon::prelude::*;

use super::batch::Grid;
use super::header::Header;
use crate::against::Against;
use crate::options::ProgressFn;

/// A position and its Morton code.
type Row = (u128, [i64; 3]);

/// Why it was not done.
pub(crate) enum Unknown {
    /// The sources have another number of points than the file.
    Count,
    /// Equal records were dropped, and only whole records show which.
    Duplicates,
    /// Sorting takes more memory than is allowed.
    Memory,
}

impl Unknown {
    /// For reports.
    pub(crate) fn why(&self) -> &'static str {
        match self {
            Self::Count => "which the planes do not determine, and the sources have another number of points",
            Self::Duplicates => "which the planes do not determine, and duplicates were dropped",
            Self::Memory => "which the planes do not determine, and the sources do not fit into memory to be sorted",
        }
    }
}

/// All positions of the sources in Morton order.
///
/// # Errors
/// A source that cannot be decoded to its end.
pub(crate) fn positions(
    header: &Header,
    lattice: &Lattice,
    against: &Against,
    memory_bytes: u64,
    progress: &ProgressFn<'_>,
) -> Result<Result<Vec<[i64; 3]>, Unknown>, ReadError> {
    if against.sums.rules().drop_duplicates {
        return Ok(Err(Unknown::Duplicates));
    }
    if header.points.saturating_mul((size_of::<Row>() + 2 * size_of::<[i64; 3]>()) as u64) > memory_bytes {
        return Ok(Err(Unknown::Memory));
    }
    let Some(positions) = against.positions(header.points, progress)? else { return Ok(Err(Unknown::Count)) };
    let grid = Grid::new(header);
    let code = |x: &[i64; 3]| {
        grid.code([0, 1, 2].map(|a| x[a] as f64 * lattice.scale[a] + lattice.offset[a] - header.origin[a]))
    };
    let mut rows: Vec<Row> = positions.par_iter().map(|x| (code(x), *x)).collect();
    drop(positions);
    rows.par_sort_unstable();
    Ok(Ok(rows.into_iter().map(|(_, x)| x).collect()))
}
