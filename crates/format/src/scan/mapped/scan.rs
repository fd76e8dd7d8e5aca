//! A scan that is decoded by another one and moved.

use std::ops::ControlFlow;

use super::directions::Directions;
use super::info;
use super::map::{ScanMap, ScanMaps};
use super::positions::PositionMap;
use crate::scan::decode::{batch_bytes, batch_points, point_bytes};
use crate::{Piece, PointBatch, ReadError, Scan, ScanInfo, Scratch, Sink, Wanted};

/// The scan with its points where `maps` takes them.
pub(crate) fn mapped(inner: Box<dyn Scan>, maps: &dyn ScanMaps) -> Result<Box<dyn Scan>, ReadError> {
    let map = maps.of(&*inner)?;
    Ok(Box::new(MappedScan::new(inner, &map)))
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
    fn new(inner: Box<dyn Scan>, map: &ScanMap) -> Self {
        let directions = Directions::new(inner.info(), map);
        let positions = PositionMap::new(inner.info(), map);
        let info = info::mapped(&*inner, map, &positions);
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

    fn decode_bytes(&self, wanted: &Wanted) -> u64 {
        let needed = self.directions.needed_for(wanted);
        let points = self.inner.pieces().iter().map(|piece| piece.points).max().unwrap_or(0);
        let points = points.min(batch_points(point_bytes(&self.info.attributes, true)) as u64);
        // a copy of the batch with world coordinates, its integers before, and directions while they turn
        let copy = batch_bytes(&self.info.attributes, false, &needed, points);
        let before = (point_bytes(&[], true) + point_bytes(&[], false)) as u64;
        self.inner.decode_bytes(&needed) + copy + points * before
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
        let what =
            format!("point {point} has the coordinate {} on the file's lattice, which cannot be negated", i32::MIN);
        ReadError::unsupported(&self.info.path, what)
            .advise("leave the point out, or export the scan with another offset")
    }
}
