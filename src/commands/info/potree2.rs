//! Describes a Potree 2.0 dataset: its metadata, and its hierarchy per level.

use std::path::Path;

use pointmill_format::ReadError;
use pointmill_format::potree2::{Dataset, Metadata, Node};
use serde_json::{Value, json};

use super::description::{Description, attribute_json, corners};
use crate::exit::Failure;
use crate::human::quantities::{bytes, count, number, numbers, plural};
use crate::human::text::{self, Table, attribute_line, or_none};

/// Describes the dataset that `metadata` (its `metadata.json`) belongs to.
pub(super) fn describe(metadata: &Path) -> Result<Description, Failure> {
    let folder = metadata.parent().unwrap_or(metadata);
    let dataset = Dataset::open(folder)?;
    let metadata = dataset.metadata();
    let levels = levels(&dataset.read_hierarchy()?);
    let size_bytes = size_of_files(folder)?;
    let text = text(folder, metadata, &levels, size_bytes);
    Ok(Description { text, json: json(folder, metadata, &levels, size_bytes), fault: None })
}

/// Nodes and points of each level.
fn levels(nodes: &[Node]) -> Vec<[u64; 2]> {
    let mut levels = Vec::new();
    for node in nodes {
        let level = usize::from(node.key.level);
        levels.resize(levels.len().max(level + 1), [0, 0]);
        levels[level][0] += 1;
        levels[level][1] += u64::from(node.record.points);
    }
    levels
}

fn size_of_files(folder: &Path) -> Result<u64, Failure> {
    let size = |name: &str| {
        let path = folder.join(name);
        path.metadata().map(|m| m.len()).map_err(|e| ReadError::io(&path, "reading its size", e).into())
    };
    ["metadata.json", "hierarchy.bin", "octree.bin"].into_iter().map(size).sum()
}

/// `levels`: nodes and points of each; `size_bytes`: of its three files.
fn text(folder: &Path, metadata: &Metadata, levels: &[[u64; 2]], size_bytes: u64) -> String {
    let mut t = Table::about(folder);
    t.row("format", format!("Potree 2.0, encoding {}", metadata.encoding.name()));
    t.row("name", &metadata.name);
    t.row("points", count(metadata.points));
    let position = metadata.attributes.iter().find(|stats| stats.attribute.name == "position");
    if let Some(position) = position.filter(|stats| stats.min.len() == 3 && stats.max.len() == 3) {
        t.row("bounds", text::corners(&position.min, &position.max));
    }
    t.row("cube", text::corners(&metadata.cube.min, &metadata.cube.max));
    let lattice = &metadata.lattice;
    t.row("lattice", format!("step {}, offset {}", numbers(&lattice.scale), numbers(&lattice.offset)));
    t.row("spacing", format!("{} at the root, halved per level", number(metadata.spacing)));
    t.row("CRS", or_none(&metadata.projection));
    t.row("size", bytes(size_bytes));
    for (level, [nodes, points]) in levels.iter().enumerate() {
        let word = if level == 0 { "levels" } else { "" };
        t.row(word, format!("{level}: {} in {}", plural(*points, "point"), plural(*nodes, "node")));
    }
    for (i, stats) in metadata.attributes.iter().enumerate() {
        let ends = stats.min.iter().zip(&stats.max).map(|(min, max)| [*min, *max]).collect::<Vec<_>>();
        t.row(if i == 0 { "attributes" } else { "" }, attribute_line(&stats.attribute, Some(&ends)));
    }
    t.0
}

fn json(folder: &Path, metadata: &Metadata, levels: &[[u64; 2]], size_bytes: u64) -> Value {
    let attributes = metadata.attributes.iter().map(|stats| {
        let mut object = attribute_json(&stats.attribute);
        object["min"] = json!(stats.min);
        object["max"] = json!(stats.max);
        object
    });
    json!({
        "path": folder.to_string_lossy(),
        "kind": "dataset",
        "format": "Potree 2.0",
        "name": metadata.name,
        "points": metadata.points,
        "nodes": levels.iter().map(|l| l[0]).sum::<u64>(),
        "levels": levels.len(),
        "nodes_per_level": levels.iter().map(|l| l[0]).collect::<Vec<_>>(),
        "points_per_level": levels.iter().map(|l| l[1]).collect::<Vec<_>>(),
        "encoding": metadata.encoding.name(),
        "lattice": { "scale": metadata.lattice.scale, "offset": metadata.lattice.offset },
        "cube": corners(&metadata.cube),
        "spacing": metadata.spacing,
        "projection": metadata.projection,
        "attributes": attributes.collect::<Vec<_>>(),
        "file_bytes": size_bytes,
    })
}
