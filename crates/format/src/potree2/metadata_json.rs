//! Writes `metadata.json`: the reference's keys in the reference's order, arrays on one line.

use serde_json::Value;

use crate::json::{number, numbers, string, write_field};

use super::{AttributeStats, Metadata};

impl Metadata {
    /// The text of `metadata.json`, with all keys that PotreeConverter 2.1 writes and then [`Self::extra`].
    ///
    /// Doubles come back bit for bit. JSON has neither NaN nor infinities: they become 0 and ±[`f64::MAX`].
    #[must_use]
    pub fn to_json(&self) -> String {
        to_json(self)
    }
}

fn to_json(metadata: &Metadata) -> String {
    let m = metadata;
    let mut json = String::from("{\n\t\"version\": \"2.0\"");
    let mut field = |name: &str, value: &dyn std::fmt::Display| write_field(&mut json, "\t", name, value);
    field("name", &string(&m.name));
    field("description", &string(&m.description));
    field("points", &m.points);
    field("projection", &string(&m.projection));
    field(
        "hierarchy",
        &format_args!(
            "{{\n\t\t\"firstChunkSize\": {},\n\t\t\"stepSize\": {},\n\t\t\"depth\": {}\n\t}}",
            m.first_chunk_size, m.step_size, m.depth
        ),
    );
    field("offset", &numbers(&m.lattice.offset));
    field("scale", &numbers(&m.lattice.scale));
    field("spacing", &number(m.spacing));
    let (min, max) = (numbers(&m.cube.min), numbers(&m.cube.max));
    field("boundingBox", &format_args!("{{\n\t\t\"min\": {min},\n\t\t\"max\": {max}\n\t}}"));
    field("encoding", &string(m.encoding.name()));
    let attributes: Vec<String> = m.attributes.iter().map(attribute).collect();
    field("attributes", &format_args!("[\n\t\t{}\n\t]", attributes.join(",\n\t\t")));
    for (name, value) in &m.extra {
        field(name, value);
    }
    json.push_str("\n}\n");
    json
}

fn attribute(stats: &AttributeStats) -> String {
    let a = &stats.attribute;
    let mut json = format!("{{\n\t\t\t\"name\": {}", string(&a.name));
    let mut field = |name: &str, value: &dyn std::fmt::Display| write_field(&mut json, "\t\t\t", name, value);
    field("description", &string(&a.description));
    field("size", &a.size());
    field("numElements", &a.elements);
    field("elementSize", &a.ty.size());
    field("type", &string(a.ty.potree_name()));
    if let Some(histogram) = &stats.histogram {
        field("histogram", &Value::from(histogram.as_slice()));
    }
    for (name, ends) in [("min", &stats.min), ("max", &stats.max)] {
        // a reader that finds a range expects a number for each element
        if !ends.is_empty() {
            field(name, &numbers(ends));
        }
    }
    field("scale", &numbers(&a.scale));
    field("offset", &numbers(&a.offset));
    json.push_str("\n\t\t}");
    json
}
