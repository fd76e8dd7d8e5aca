//! Describes a Potree 1.x dataset: its metadata, and its nodes per level.

use std::path::Path;

use pointmill_format::octree::{Octree, OctreeInfo};
use pointmill_format::potree1::{Dataset, METADATA_FILE, Metadata, NodeFiles};
use serde_json::{Value, json};

use super::description::{Description, attribute_json, corners};
use crate::exit::Failure;
use crate::human::quantities::{bytes, count, number, plural};
use crate::human::text::{self, Table, attribute_line, or_none};

/// What the index and the files of the nodes say.
#[derive(Default)]
struct Nodes {
    /// Nodes and points of each level, by the sizes of files.
    levels: Vec<[u64; 2]>,
    /// Points by the index.
    declared: u64,
    /// Nodes of which the index says another number.
    wrong: u64,
    /// Bytes of the files of all nodes.
    size: u64,
}

/// Describes the dataset that `metadata` (its `cloud.js`) belongs to.
pub(super) fn describe(metadata: &Path) -> Result<Description, Failure> {
    let folder = metadata.parent().unwrap_or(metadata);
    let dataset = Dataset::open(folder)?;
    let nodes = nodes(&dataset)?;
    let (text, json) = (text(folder, &dataset, &nodes), json(folder, &dataset, &nodes));
    Ok(Description { text, json, fault: None })
}

fn nodes(dataset: &Dataset) -> Result<Nodes, Failure> {
    let mut all = Nodes::default();
    for node in dataset.read_hierarchy()? {
        let (level, points) = (usize::from(node.key.level), dataset.count(node.key)?);
        all.levels.resize(all.levels.len().max(level + 1), [0, 0]);
        all.levels[level][0] += 1;
        all.levels[level][1] += points;
        all.declared += node.declared;
        all.wrong += u64::from(node.declared != points);
        all.size += match dataset.metadata().files {
            NodeFiles::Bin => points * dataset.metadata().record_len() as u64,
            _ => dataset.locate(&dataset.metadata().node_file(node.key)).metadata().map_or(0, |m| m.len()),
        };
    }
    Ok(all)
}

impl Nodes {
    fn count(&self) -> u64 {
        self.levels.iter().map(|l| l[0]).sum()
    }

    fn points(&self) -> u64 {
        self.levels.iter().map(|l| l[1]).sum()
    }
}

/// "Potree 1.7, 16 bytes a point", "Potree 1.6, nodes as LAZ".
fn format(info: &OctreeInfo, metadata: &Metadata) -> String {
    match metadata.files {
        NodeFiles::Bin => format!("{}, {} bytes a point", info.format, metadata.record_len()),
        files => format!("{}, nodes as {}", info.format, files.extension()[1..].to_uppercase()),
    }
}

fn text(folder: &Path, dataset: &Dataset, nodes: &Nodes) -> String {
    let (info, metadata) = (dataset.info(), dataset.metadata());
    let mut t = Table::about(folder);
    t.row("format", format(info, metadata));
    let stated = metadata.points.filter(|points| *points != nodes.points());
    let stated = stated.map_or_else(String::new, |points| format!(" ({METADATA_FILE} says {})", count(points)));
    t.row("points", count(nodes.points()) + &stated);
    if let Some(tight) = &metadata.tight_box {
        t.row("bounds", text::corners(&tight.min, &tight.max));
    }
    t.row("cube", text::corners(&metadata.cube.min, &metadata.cube.max));
    t.row("scale", format!("{}, from the corner of each node", number(metadata.scale)));
    t.row("spacing", format!("{} at the root, halved per level", number(metadata.spacing)));
    t.row("CRS", or_none(&metadata.projection));
    t.row("size", bytes(nodes.size));
    if nodes.wrong > 0 {
        let (wrong, all) = (plural(nodes.wrong, "node"), count(nodes.count()));
        t.row("index", format!("wrong about {wrong} of {all}: it counts {}", plural(nodes.declared, "point")));
    }
    for (level, [count, points]) in nodes.levels.iter().enumerate() {
        let word = if level == 0 { "levels" } else { "" };
        t.row(word, format!("{level}: {} in {}", plural(*points, "point"), plural(*count, "node")));
    }
    for (i, attribute) in info.attributes.iter().enumerate() {
        t.row(if i == 0 { "attributes" } else { "" }, attribute_line(attribute, None));
    }
    t.0
}

fn json(folder: &Path, dataset: &Dataset, nodes: &Nodes) -> Value {
    let (info, metadata) = (dataset.info(), dataset.metadata());
    let stored = |a: &pointmill_format::potree1::PointAttribute| a.name.clone();
    json!({
        "path": folder.to_string_lossy(),
        "kind": "dataset",
        "format": info.format,
        "points": nodes.points(),
        "points_stated": metadata.points,
        "points_in_index": nodes.declared,
        "nodes": nodes.count(),
        "nodes_counted_wrong": nodes.wrong,
        "levels": nodes.levels.len(),
        "nodes_per_level": nodes.levels.iter().map(|l| l[0]).collect::<Vec<_>>(),
        "points_per_level": nodes.levels.iter().map(|l| l[1]).collect::<Vec<_>>(),
        "cube": corners(&metadata.cube),
        "bounds": metadata.tight_box.as_ref().map(corners),
        "scale": metadata.scale,
        "spacing": metadata.spacing,
        "step": metadata.step,
        "projection": metadata.projection,
        "stored_attributes": metadata.attributes.iter().map(stored).collect::<Vec<_>>(),
        "attributes": info.attributes.iter().map(attribute_json).collect::<Vec<_>>(),
        "file_bytes": nodes.size,
    })
}
