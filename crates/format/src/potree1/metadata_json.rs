//! Writes `cloud.js`: the reference's keys in the reference's order.

use crate::Aabb;
use crate::json::{number, string, write_field};

use super::{Metadata, NodeFiles, PointAttribute};

impl Metadata {
    /// The text of `cloud.js`, with all keys that PotreeConverter 1.7 writes and then [`Self::extra`]. Attributes are words up to
    /// version 1.7, objects from 1.8 on. [`Self::nodes`] are written up to version 1.5.
    ///
    /// Doubles come back bit for bit. JSON has neither NaN nor infinities: they become 0 and ±[`f64::MAX`].
    #[must_use]
    pub fn to_json(&self) -> String {
        to_json(self)
    }
}

fn to_json(m: &Metadata) -> String {
    let mut json = format!("{{\n\t\"version\": \"1.{}\"", m.minor);
    let mut field = |name: &str, value: &dyn std::fmt::Display| write_field(&mut json, "\t", name, value);
    field("octreeDir", &string(&m.octree_dir));
    field("projection", &string(&m.projection));
    if let Some(points) = m.points {
        field("points", &points);
    }
    field("boundingBox", &bounds(&m.cube));
    if let Some(tight) = &m.tight_box {
        field("tightBoundingBox", &bounds(tight));
    }
    field("pointAttributes", &attributes(m));
    field("spacing", &number(m.spacing));
    field("scale", &number(m.scale));
    field("hierarchyStepSize", &m.step);
    if let Some(nodes) = m.nodes.as_ref().filter(|_| m.minor <= 5) {
        let nodes: Vec<String> = nodes.iter().map(|(key, points)| format!("[\"{key}\", {points}]")).collect();
        field("hierarchy", &list(&nodes));
    }
    for (name, value) in &m.extra {
        field(name, value);
    }
    json.push_str("\n}\n");
    json
}

fn bounds(bounds: &Aabb) -> String {
    let ends = [("l", bounds.min), ("u", bounds.max)];
    let axis = |end, axis, value| format!("\n\t\t\"{end}{axis}\": {}", number(value));
    let lines = ends.map(|(end, [x, y, z])| [axis(end, 'x', x), axis(end, 'y', y), axis(end, 'z', z)].join(","));
    format!("{{{}\n\t}}", lines.join(","))
}

fn attributes(m: &Metadata) -> String {
    match m.files {
        NodeFiles::Las => string("LAS"),
        NodeFiles::Laz => string("LAZ"),
        NodeFiles::Bin if m.minor < 8 => list(&m.attributes.iter().map(|a| string(&a.name)).collect::<Vec<_>>()),
        NodeFiles::Bin => list(&m.attributes.iter().map(object).collect::<Vec<_>>()),
    }
}

fn object(a: &PointAttribute) -> String {
    let mut json = format!("{{\n\t\t\t\"name\": {}", string(&a.name));
    let mut field = |name: &str, value: &dyn std::fmt::Display| write_field(&mut json, "\t\t\t", name, value);
    field("size", &a.size());
    field("elements", &a.elements);
    field("elementSize", &a.ty.size());
    field("type", &string(a.ty.potree_name()));
    field("description", &string(&a.description));
    json.push_str("\n\t\t}");
    json
}

fn list(values: &[String]) -> String {
    if values.is_empty() { "[]".to_owned() } else { format!("[\n\t\t{}\n\t]", values.join(",\n\t\t")) }
}
