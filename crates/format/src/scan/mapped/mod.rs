//! Scans whose points are moved as they are read: turned, scaled, reprojected.
//!
//! The readers know nothing of it: [`MappedScan`] decodes with one of them and changes its batches. Where the map takes
//! each axis to one axis, integers stay the integers of the file and the lattice changes instead, so nothing is
//! rounded; any other map makes world coordinates in double precision.

mod directions;
mod info;
mod positions;

use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;

use super::{Piece, Scan, ScanInfo, ScanWarning, Scratch, Sink, Wanted};
use crate::{Affine, PointBatch, ReadError};

use directions::Directions;
use positions::PositionMap;

/// A map of points that is not affine: a change of projection.
pub trait PointMap: fmt::Debug + Send + Sync {
    /// Maps points in place; x, y and z are equally long. A point that has no image becomes NaN.
    fn map(&self, points: [&mut [f64]; 3]);
}

/// What becomes of the points of a scan.
#[derive(Debug, Clone)]
pub struct ScanMap {
    /// First of all.
    pub affine: Affine,
    /// Then this, if there is one.
    pub projection: Option<Arc<dyn PointMap>>,
    /// What the user should know of it; joins the warnings of the scan.
    pub warnings: Vec<ScanWarning>,
}

impl ScanMap {
    /// An affine map.
    #[must_use]
    pub fn new(affine: Affine) -> Self {
        Self { affine, projection: None, warnings: Vec::new() }
    }
}

/// Says for each scan what becomes of its points ([`crate::OpenOptions::maps`]).
pub trait ScanMaps: fmt::Debug + Send + Sync {
    /// The map of the scan that is described; its warnings are those of the map alone.
    ///
    /// # Errors
    /// A scan that cannot be mapped as requested.
    fn of(&self, info: &ScanInfo) -> Result<ScanMap, ReadError>;
}

/// The same map for every scan.
impl ScanMaps for ScanMap {
    fn of(&self, _: &ScanInfo) -> Result<ScanMap, ReadError> {
        Ok(self.clone())
    }
}

/// The scan with its points where `maps` takes them.
pub(super) fn mapped(inner: Box<dyn Scan>, maps: &dyn ScanMaps) -> Result<Box<dyn Scan>, ReadError> {
    let map = maps.of(inner.info())?;
    Ok(Box::new(MappedScan::new(inner, map)))
}

/// A scan that is decoded by another one and moved.
struct MappedScan {
    inner: Box<dyn Scan>,
    info: ScanInfo,
    positions: PositionMap,
    /// Columns that turn with the points.
    directions: Directions,
}

impl MappedScan {
    fn new(inner: Box<dyn Scan>, map: ScanMap) -> Self {
        let directions = Directions::new(inner.info(), &map);
        let positions = PositionMap::new(inner.info(), &map);
        let info = info::mapped(inner.info(), &map, &positions);
        Self { inner, info, positions, directions }
    }
}

impl Scan for MappedScan {
    fn info(&self) -> &ScanInfo {
        &self.info
    }

    fn pieces(&self) -> &[Piece] {
        self.inner.pieces()
    }

    fn decode(
        &self,
        piece: usize,
        wanted: &Wanted,
        scratch: &mut Scratch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        let needed = self.directions.needed_for(wanted);
        let mut refused = None;
        let result = self.inner.decode(piece, &needed, scratch, &mut |batch| {
            let mut moved: PointBatch = batch.clone();
            if let Err(point) = self.positions.apply(&mut moved.positions) {
                refused = Some(batch.first_point + point as u64);
                return ControlFlow::Break(());
            }
            self.directions.apply(&mut moved, wanted);
            sink(&moved)
        });
        match refused {
            Some(point) => Err(self.no_negative(point)),
            None => result,
        }
    }
}

impl MappedScan {
    /// The least integer has no negative one on the same lattice.
    fn no_negative(&self, point: u64) -> ReadError {
        let what = format!("point {point} has the coordinate {} on the file's lattice, which cannot be negated", i32::MIN);
        ReadError::unsupported(&self.info.path, what).advise("leave the point out, or export the scan with another offset")
    }
}

#[cfg(all(test, feature = "las", feature = "ply"))]
mod tests;
