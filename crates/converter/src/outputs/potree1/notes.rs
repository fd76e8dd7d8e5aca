//! What clients stumble over, and what is said of it.

use pointmill_format::DatasetKind;
use pointmill_format::potree1::{Field, PointAttribute};

use super::settings::Potree1Version;
use crate::octree::FinishedNode;
use crate::outputs::octrees::system_note;
use crate::sources::ResolvedCrs;
use crate::warning::{RenamedAttribute, ViewerNote, Warning};

/// Points that BA_PointCloud draws of a node.
const MESH_POINTS: u32 = 65_000;

/// What is known before any point was read.
pub(super) fn foresee(version: Potree1Version, crs: &ResolvedCrs) -> Vec<Warning> {
    let objects = (version == Potree1Version::V1_8).then_some(ViewerNote::Objects);
    system_note(crs).into_iter().chain(objects).map(warning).collect()
}

/// What is known of the fields of a record.
pub(super) fn fields(fields: &[PointAttribute], renamed: &[RenamedAttribute], version: Potree1Version) -> Vec<Warning> {
    let is_known = |field| matches!(field, Field::Position | Field::Rgba | Field::Intensity);
    let words: Vec<String> = fields.iter().filter(|f| !is_known(f.field)).map(|f| f.name.clone()).collect();
    let behind = (version == Potree1Version::V1_7 && !words.is_empty()).then_some(ViewerNote::BehindColour { words });
    renamed.iter().cloned().map(ViewerNote::Renamed).chain(behind).map(warning).collect()
}

/// What is known of the nodes; `most`: points that were allowed.
pub(super) fn crowded(nodes: &[FinishedNode], most: Option<u32>) -> Option<Warning> {
    let most = most.unwrap_or(MESH_POINTS);
    let crowded = nodes.iter().filter(|node| node.points > most);
    let points = crowded.clone().map(|node| node.points).max()?;
    Some(warning(ViewerNote::CrowdedNodes { nodes: crowded.count() as u64, points, most }))
}

fn warning(note: ViewerNote) -> Warning {
    Warning::Viewers { format: DatasetKind::Potree1, note }
}
