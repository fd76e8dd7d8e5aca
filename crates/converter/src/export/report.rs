//! The account of an export.

use std::path::PathBuf;

use serde::Serialize;

use super::encoder::Place;
use super::pass::Counted;
use crate::cloud::Stats;
use crate::error::ConvertError;
use crate::report::{ChangedValues, MissingValues};
use crate::sources::Schema;
use crate::warning::Warning;

/// The account of an export: every point by cause, what became of attributes and positions.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ExportReport {
    /// The file.
    pub output: PathBuf,
    /// For people: "LAS 1.4, point format 7".
    pub format: String,
    /// Bytes of the file.
    pub bytes: u64,
    /// Scans and datasets that were read.
    pub inputs: u64,
    /// Every point by cause.
    pub points: ExportedPoints,
    /// Steps of the lattice of integer positions; `None`: world coordinates.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<[f64; 3]>,
    /// The place of step 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub offset: Option<[f64; 3]>,
    /// How far positions are from those of the sources.
    pub positions: PositionChange,
    /// What became of each attribute.
    pub attributes: Vec<ExportedAttribute>,
    /// The coordinate reference system, for people.
    pub crs: String,
    /// What the user should know.
    pub warnings: Vec<Warning>,
    /// Wall seconds.
    pub seconds: f64,
    /// Highest resident set of the process, bytes, where the system tells it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub memory_bytes: Option<u64>,
}

/// Every point by cause: what was read is written, or counted under a cause.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "camelCase")]
#[non_exhaustive]
#[allow(missing_docs)] // the names say it
pub struct ExportedPoints {
    pub read: u64,
    pub written: u64,
    pub outside_bounds: u64,
    pub other_class: u64,
    pub thinned: u64,
    pub invalid: u64,
    pub at_origin: u64,
    /// Points of pieces that cannot be decoded, which are not among those read.
    pub unreadable: u64,
}

/// How far positions in the file are from those of the sources; world units.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct PositionChange {
    /// Largest by axis, without its sign.
    pub max: [f64; 3],
    /// Largest distance in space.
    pub max_3d: f64,
    /// Root of the mean square of the distance in space.
    pub rms_3d: f64,
    /// More than the rounding of doubles.
    pub moved: bool,
}

/// What became of an attribute.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ExportedAttribute {
    /// Its name.
    pub name: String,
    /// Type of an element, as Potree 2.0 calls it.
    #[serde(rename = "type")]
    pub ty: String,
    /// Elements per point.
    pub elements: usize,
    /// Where it is in the file.
    pub place: Vec<String>,
    /// Values that could not stay as they were.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub changed: Option<ChangedValues>,
    /// Points whose sources do not have it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub missing: Option<MissingValues>,
}

/// Every point by cause.
///
/// # Errors
/// The causes do not sum up.
pub(super) fn points(stats: &Stats, written: u64) -> Result<ExportedPoints, ConvertError> {
    let read = stats.sources.iter().map(|source| source.read).sum();
    let Stats { outside_bounds, other_class, thinned, invalid, origin_skipped: at_origin, unreadable, .. } = *stats;
    let sum = written + outside_bounds + other_class + thinned + invalid + at_origin;
    if sum != read || written != stats.points {
        let what = format!("{read} points were read, {written} written, and the causes of the others do not sum up");
        return Err(ConvertError::Internal(what));
    }
    Ok(ExportedPoints { read, written, outside_bounds, other_class, thinned, invalid, at_origin, unreadable })
}

/// How far positions moved.
pub(super) fn positions(stats: &Stats) -> PositionChange {
    let points = stats.points.max(1) as f64;
    let rms_3d = (stats.change.sum_of_squares.iter().sum::<f64>() / points).sqrt();
    PositionChange { max: stats.change.max, max_3d: stats.change.max_squared_3d.sqrt(), rms_3d, moved: stats.moves }
}

/// What became of each attribute. `has`: whether a source, by its index, has an attribute.
pub(super) fn attributes(
    schema: &Schema,
    places: &[Place],
    counted: &Counted,
    has: impl Fn(usize, usize) -> bool,
) -> Vec<ExportedAttribute> {
    let of = |(i, a): (usize, &pointmill_format::Attribute)| {
        let mut changes = counted.changes[i];
        counted.stats.sources.iter().filter_map(|s| s.changes.get(i)).for_each(|c| changes.merge(c));
        let lacking: Vec<_> =
            counted.stats.sources.iter().enumerate().filter(|(s, stats)| stats.kept > 0 && !has(*s, i)).collect();
        let points = lacking.iter().map(|(_, stats)| stats.kept).sum::<u64>() + changes.missing;
        let missing = MissingValues { points, files: lacking.len() as u64, value: 0 };
        ExportedAttribute {
            name: a.name.clone(),
            ty: a.ty.to_string(),
            elements: a.elements,
            place: places.iter().filter(|p| p.attribute == i).map(|p| p.place.clone()).collect(),
            changed: (changes.values() > 0).then(|| changes.into()),
            missing: (points > 0).then_some(missing),
        }
    };
    schema.attributes.iter().enumerate().map(of).collect()
}
