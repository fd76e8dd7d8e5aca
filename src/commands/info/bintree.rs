//! Describes a mean-split binary tree: its header and leaves.

use std::path::Path;

use pointmill_format::bintree::{Bintree, Header};
use pointmill_format::{Aabb, Attribute};
use serde_json::{Value, json};

use super::description::{Description, attribute_json, corners};
use crate::exit::Failure;
use crate::human::quantities::{bytes, count, number, numbers, plural};
use crate::human::text::{self, Table, attribute_line, or_none};

/// Describes the dataset that `index` (its `index.json`) belongs to.
pub(super) fn describe(index: &Path) -> Result<Description, Failure> {
    let folder = index.parent().unwrap_or(index);
    let tree = Bintree::open(folder)?;
    let facts = Facts::of(&tree);
    let header = tree.header();
    Ok(Description { text: text(folder, header, &facts), json: json(folder, header, &facts), fault: None })
}

/// Figures of the nodes.
struct Facts {
    nodes: usize,
    leaves: u64,
    depth: usize,
    smallest: u64,
    largest: u64,
    bounds: Option<Aabb>,
}

impl Facts {
    fn of(tree: &Bintree) -> Self {
        let nodes = tree.nodes();
        let mut facts = Self { nodes: nodes.len(), leaves: 0, depth: 0, smallest: u64::MAX, largest: 0, bounds: None };
        facts.bounds = nodes.first().map(|root| root.bounds);
        for leaf in tree.leaves() {
            let points = tree.node(leaf).map_or(0, |node| node.count);
            facts.leaves += 1;
            facts.smallest = facts.smallest.min(points);
            facts.largest = facts.largest.max(points);
            facts.depth = facts.depth.max(tree.path(leaf).len());
        }
        facts
    }
}

fn leaf_bytes(header: &Header) -> u64 {
    header.points.saturating_mul(header.record.stride() as u64)
}

fn attributes(header: &Header) -> Vec<Attribute> {
    header.record.columns().map(|column| column.attribute).collect()
}

fn text(folder: &Path, header: &Header, facts: &Facts) -> String {
    let mut t = Table::about(folder);
    t.row(
        "format",
        format!("mean-split binary tree, split by {}, layout {}", header.split.name(), header.layout.name()),
    );
    t.row("name", &header.name);
    t.row("points", count(header.points));
    if let Some(bounds) = &facts.bounds {
        t.row("bounds", text::corners(&bounds.min, &bounds.max));
    }
    t.row("lattice", format!("step {}, offset {}", numbers(&header.lattice.scale), numbers(&header.lattice.offset)));
    t.row("CRS", or_none(&header.projection));
    t.row("nodes", format!("{}, down to depth {}", plural(facts.nodes as u64, "node"), facts.depth));
    if facts.leaves > 0 {
        let (least, most) = (count(facts.smallest), plural(facts.largest, "point"));
        let mean = number((header.points as f64 / facts.leaves as f64).round());
        let allowed = count(header.capacity);
        t.row("leaves", format!("{} of {least} to {most}, {mean} on average, maximum {allowed}", count(facts.leaves)));
    }
    t.row("size", format!("{} in leaves, {} bytes per point", bytes(leaf_bytes(header)), header.record.stride()));
    for (i, attribute) in attributes(header).iter().enumerate() {
        t.row(if i == 0 { "attributes" } else { "" }, attribute_line(attribute, None));
    }
    t.0
}

fn json(folder: &Path, header: &Header, facts: &Facts) -> Value {
    json!({
        "path": folder.to_string_lossy(),
        "kind": "dataset",
        "format": "bintree",
        "name": header.name,
        "points": header.points,
        "bounds": facts.bounds.as_ref().map(corners),
        "capacity": header.capacity,
        "split": header.split.name(),
        "layout": header.layout.name(),
        "nodes": facts.nodes,
        "leaves": facts.leaves,
        "depth": facts.depth,
        "lattice": { "scale": header.lattice.scale, "offset": header.lattice.offset },
        "projection": header.projection,
        "attributes": attributes(header).iter().map(attribute_json).collect::<Vec<_>>(),
        "stride": header.record.stride(),
        "leaf_bytes": leaf_bytes(header),
    })
}
