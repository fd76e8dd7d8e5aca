//! What clients stumble over, and what is said of it.

use pointmill_format::{Attribute, DatasetKind};
use serde_json::{Map, Value};

use super::names::Names;
use super::settings::{DarkColours, Encoding, Potree2Settings};
use super::watch::Seen;
use crate::outputs::octrees::system_note;
use crate::sources::{ResolvedCrs, Schema};
use crate::warning::{ViewerNote, Warning};

/// What is known before any point was read.
pub(super) fn foresee(settings: &Potree2Settings, schema: &Schema, kept: &[usize], crs: &ResolvedCrs) -> Vec<Warning> {
    let mut notes: Vec<ViewerNote> =
        Names::of(&attributes(schema, kept)).renamed.into_iter().map(ViewerNote::Renamed).collect();
    notes.extend(system_note(crs));
    if matches!(settings.encoding, Encoding::Brotli { .. }) {
        notes.push(ViewerNote::Brotli);
    }
    notes.into_iter().map(|note| Warning::Viewers { format: DatasetKind::Potree2, note }).collect()
}

/// Points of a hundred that are too few to be seen.
const TOO_FEW: f64 = 0.01;

/// What was seen of the points.
pub(super) fn seen(settings: &Potree2Settings, seen: &Seen, of: u64) -> Vec<Warning> {
    let mut notes = Vec::new();
    if seen.many_returns > 0 {
        notes.push(ViewerNote::ManyReturns { points: seen.many_returns, of });
    }
    let share = 100.0 * seen.dark_points as f64 / of.max(1) as f64;
    if settings.dark_colours == DarkColours::Keep && share >= TOO_FEW {
        notes.push(ViewerNote::DarkColours { points: seen.dark_points, of });
    }
    notes.into_iter().map(|note| Warning::Viewers { format: DatasetKind::Potree2, note }).collect()
}

/// The same for the report.
pub(super) fn details(seen: &Seen) -> Map<String, Value> {
    let counts = [("points_with_dark_channels", seen.dark_points), ("points_above_seven_returns", seen.many_returns)];
    counts.into_iter().filter(|(_, n)| *n > 0).map(|(name, n)| (name.to_owned(), n.into())).collect()
}

/// The attributes that are kept.
pub(super) fn attributes<'a>(schema: &'a Schema, kept: &[usize]) -> Vec<&'a Attribute> {
    kept.iter().map(|&i| &schema.attributes[i]).collect()
}
