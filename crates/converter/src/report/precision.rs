//! What became of a requested precision (`docs/accuracy.md`, §10).

use std::fmt;

use pointmill_format::{DatasetKind, Lattice};
use serde::{Serialize, Serializer};

use super::accuracy::{Accuracy, PositionErrors};
use crate::cloud::{Change, Cloud, Cube, JobBounds};
use crate::error::{ConvertError, Unsupported};

/// Operations of doubles between the coordinate of a scan and the one that is decoded, and between both and their
/// difference: each rounds by half of ε at most, relative to the largest number that takes part.
const ROUNDINGS: f64 = 16.0;

/// A requested precision, and what it did to a dataset. Lengths are in world units of the dataset.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PrecisionReport {
    /// Largest error that is allowed, by axis.
    pub allowed: [f64; 3],
    /// Largest error that a reader's positions have against those of the scans, by axis.
    pub max: [f64; 3],
    /// Root of the mean square of it, by axis, or a bound ([`Accuracy::total`]).
    pub rms: [f64; 3],
    /// Bits that a coordinate has less than on the lattice that keeps everything, by axis: log2 of how many times the
    /// step is coarser.
    pub bits_dropped: [f64; 3],
    /// What that saves.
    pub saved: SavedBytes,
}

/// What dropping the lowest bits of positions saves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SavedBytes {
    /// No byte: the precision needs all bits that the coordinates have.
    NothingDropped,
    /// No byte: a position takes the same whatever the step.
    FixedRecords,
    /// No byte: all planes are needed, or their number was requested.
    NoPlane,
    /// Planes that are not written, bytes before any compression.
    Planes {
        /// How many.
        planes: u32,
        /// Their bytes.
        bytes: u64,
    },
    /// The compression stores fewer bits; how many bytes that is only another run would tell.
    Compressed,
}

impl SavedBytes {
    /// Bytes that are known to be saved; `None`: they are not counted.
    pub const fn bytes(self) -> Option<u64> {
        match self {
            Self::NothingDropped | Self::FixedRecords | Self::NoPlane => Some(0),
            Self::Planes { bytes, .. } => Some(bytes),
            Self::Compressed => None,
        }
    }
}

impl fmt::Display for SavedBytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NothingDropped => f.write_str("no byte: the step of the scans is not finer than the precision"),
            Self::FixedRecords => f.write_str("no byte: a position takes as many bytes whatever the step"),
            Self::NoPlane => f.write_str("no plane of positions"),
            Self::Planes { planes: 1, .. } => f.write_str("one plane of positions"),
            Self::Planes { planes, .. } => write!(f, "{planes} planes of positions"),
            Self::Compressed => f.write_str("bits that the compression no longer stores; their bytes are not counted"),
        }
    }
}

impl Serialize for SavedBytes {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        use serde::ser::SerializeStruct as _;
        let mut object = serializer.serialize_struct("SavedBytes", 2)?;
        object.serialize_field("bytes", &self.bytes())?;
        object.serialize_field("what", &self.to_string())?;
        object.end()
    }
}

/// What became of the precision that was requested, if one was.
///
/// # Errors
/// A position that is less exact.
pub(crate) fn precision(
    cloud: &Cloud<'_>,
    kind: DatasetKind,
    accuracy: &Accuracy,
    saved: SavedBytes,
) -> Result<Option<PrecisionReport>, ConvertError> {
    let Some(tolerance) = &cloud.sources.tolerance else { return Ok(None) };
    let (allowed, total) = (tolerance.total, accuracy.total);
    if let Some(axis) = first_above(&total, allowed, rounding(cloud)) {
        let (error, allowed) = (total.max[axis], allowed[axis]);
        return Err(Unsupported::Imprecise { kind, axis, error, allowed }.into());
    }
    let bits_dropped = cloud.lattice.reason.axes.map(|axis| axis.enough.unwrap_or(1.0).log2());
    let is_same = bits_dropped == [0.0; 3] && saved == SavedBytes::Compressed;
    let saved = if is_same { SavedBytes::NothingDropped } else { saved };
    Ok(Some(PrecisionReport { allowed, max: total.max, rms: total.rms, bits_dropped, saved }))
}

/// Refuses a cloud whose lattice alone is coarser than the requested precision, before anything is built of it.
///
/// # Errors
/// The extent of the cloud needs a coarser step, on the axis that is named.
pub(crate) fn check_lattice(cloud: &Cloud<'_>) -> Result<(), ConvertError> {
    let Some(tolerance) = &cloud.sources.tolerance else { return Ok(()) };
    let Change { max, .. } = cloud.stats.change;
    let errors = PositionErrors::bound(max);
    let Some(axis) = first_above(&errors, tolerance.total, rounding(cloud)) else { return Ok(()) };
    let (step, allowed) = (cloud.lattice.lattice.scale[axis], tolerance.total[axis]);
    Err(Unsupported::CoarseLattice { axis, step, error: max[axis], allowed }.into())
}

/// An axis with errors above what is allowed, by more than rounding.
fn first_above(errors: &PositionErrors, allowed: [f64; 3], rounding: [f64; 3]) -> Option<usize> {
    (0..3).find(|a| errors.max[*a] > allowed[*a] + rounding[*a])
}

/// By axis, how far apart doubles may be that stand for one coordinate of the cloud.
fn rounding(cloud: &Cloud<'_>) -> [f64; 3] {
    let offsets: Vec<[f64; 3]> = cloud.sources.all.iter().filter_map(|s| s.stored.lattice.map(|l| l.offset)).collect();
    rounding_of(&cloud.stats.bounds, &cloud.lattice.lattice, &offsets, &cloud.frame.cube)
}

/// The same, from the largest number that a coordinate is computed with. `offsets`: those of the sources.
fn rounding_of(bounds: &JobBounds, lattice: &Lattice, offsets: &[[f64; 3]], cube: &Cube) -> [f64; 3] {
    // octrees count from the corner of their cube, which may be far from the points where their steps are few
    let corner = cube.offset(lattice);
    std::array::from_fn(|a| {
        let world = |q: i64| (q as f64 * lattice.scale[a]).abs() + lattice.offset[a].abs();
        let ends = [world(bounds.min[a]), world(bounds.max[a]), corner[a].abs() + cube.side];
        let largest = offsets.iter().map(|offset| offset[a].abs()).chain(ends).fold(0.0, f64::max);
        ROUNDINGS * f64::EPSILON / 2.0 * largest
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_at_the_bound_holds_and_one_above_does_not() {
        let errors = PositionErrors::bound([0.001, 0.0, 0.002]);
        assert_eq!(first_above(&errors, [0.001, 0.0, 0.002], [0.0; 3]), None);
        assert_eq!(first_above(&errors, [0.001, 0.0, 0.001_999], [1e-9; 3]), Some(2));
        assert_eq!(first_above(&errors, [0.001 - 1e-12, 0.0, 1.0], [1e-11; 3]), None);
    }

    #[test]
    fn only_what_is_known_is_called_saved() {
        let all = [
            SavedBytes::FixedRecords,
            SavedBytes::NoPlane,
            SavedBytes::Planes { planes: 2, bytes: 80 },
            SavedBytes::Compressed,
        ];
        assert_eq!(all.map(SavedBytes::bytes), [Some(0), Some(0), Some(80), None]);
        let json = serde_json::to_value(SavedBytes::Compressed).unwrap();
        assert!(json["bytes"].is_null() && json["what"].as_str().unwrap().contains("not counted"));
    }

    #[test]
    fn doubles_are_rounded_by_the_largest_number_that_a_coordinate_is_computed_with() {
        // x: 0 to 5 by way of 100; y: the offset of a source; z: the cube, whose side is 129 steps
        let lattice = Lattice { scale: [0.5; 3], offset: [100.0, 0.0, 0.0] };
        let bounds = JobBounds::new([-200, 0, 0], [-190, 0, 0]);
        let cube = Cube::around(&bounds, &lattice).unwrap();
        let corner = cube.offset(&lattice)[2];
        assert!(cube.side == 64.5 && corner < -1.0, "{cube:?}");
        let unit = ROUNDINGS * 2f64.powi(-53);
        let found = rounding_of(&bounds, &lattice, &[[7.0, 512.0, 1.0], [7.0, -1024.0, 1.0]], &cube);
        assert_eq!(found, [200.0 * unit, 1024.0 * unit, (64.5 - corner) * unit]);
        let other_end = JobBounds::new([-190, 0, 0], [200, 0, 0]);
        assert_eq!(rounding_of(&other_end, &lattice, &[], &cube)[0], 200.0 * unit);
    }
}
