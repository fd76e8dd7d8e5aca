//! What clients stumble over, and what is said of it.

use pointmill_format::Attribute;

use super::names::Names;
use super::settings::{Encoding, Potree2Settings};
use crate::sources::{ResolvedCrs, Schema};
use crate::warning::{ViewerNote, Warning};

/// What is known before any point was read.
pub(super) fn foresee(settings: &Potree2Settings, schema: &Schema, kept: &[usize], crs: &ResolvedCrs) -> Vec<Warning> {
    let mut notes: Vec<ViewerNote> =
        Names::of(&attributes(schema, kept)).renamed.into_iter().map(ViewerNote::Renamed).collect();
    let system = || crs.label.clone();
    if crs.is_geocentric {
        notes.push(ViewerNote::Geocentric { system: system() });
    } else if crs.is_geographic() {
        notes.push(ViewerNote::Degrees { system: system() });
    }
    if matches!(settings.encoding, Encoding::Brotli { .. }) {
        notes.push(ViewerNote::Brotli);
    }
    notes.into_iter().map(Warning::Viewers).collect()
}

/// The attributes that are kept.
pub(super) fn attributes<'a>(schema: &'a Schema, kept: &[usize]) -> Vec<&'a Attribute> {
    kept.iter().map(|&i| &schema.attributes[i]).collect()
}
