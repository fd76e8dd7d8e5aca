//! What clients stumble over, and what is said of it.

use pointmill_format::DatasetKind;

use super::content::Content;
use crate::outputs::octrees::system_note;
use crate::sources::{ResolvedCrs, Schema};
use crate::warning::{ViewerNote, Warning};

/// What is known before any point was read.
pub(super) fn foresee(crs: &ResolvedCrs) -> Vec<Warning> {
    let has_text = crs.wkt_text().is_some() || crs.label.is_empty();
    let no_text = (!has_text).then(|| ViewerNote::NoWkt { system: crs.label.clone() });
    system_note(crs).into_iter().chain(no_text).map(warning).collect()
}

/// What is known of the attributes.
pub(super) fn renamed(content: &Content, schema: &Schema) -> Vec<Warning> {
    content.renamed(schema).into_iter().map(ViewerNote::Renamed).map(warning).collect()
}

fn warning(note: ViewerNote) -> Warning {
    Warning::Viewers { format: DatasetKind::Copc, note }
}
