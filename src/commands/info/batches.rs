//! Describes a file of quantised batches: its header and description.

use std::path::Path;

use pointmill_format::Attribute;
use pointmill_format::batches::{BatchRecord, Batches};
use serde_json::{Value, json};

use super::description::{Description, attribute_json, corners};
use crate::exit::Failure;
use crate::human::quantities::{bytes, count, number, numbers, plural};
use crate::human::text::{self, Table, attribute_line, or_none};

/// Describes the file `points.qbatch`; its name does not matter.
pub(super) fn describe(file: &Path) -> Result<Description, Failure> {
    let batches = Batches::map(file)?;
    let size = file.metadata().map_err(|e| Failure::io(file, "reading its size", &e))?.len();
    Ok(Description { text: text(file, &batches, size), json: json(file, &batches, size), fault: None })
}

/// Longest side of the largest box, world units.
fn largest_box(records: &[BatchRecord]) -> f64 {
    let side = |r: &BatchRecord| (0..3).map(|a| f64::from(r.max[a]) - f64::from(r.min[a])).fold(0.0, f64::max);
    records.iter().map(side).fold(0.0, f64::max)
}

fn attributes<B: AsRef<[u8]>>(batches: &Batches<B>) -> Vec<Attribute> {
    batches.attributes().cloned().collect()
}

fn text<B: AsRef<[u8]>>(file: &Path, batches: &Batches<B>, size: u64) -> String {
    let (header, description) = (batches.header(), batches.description());
    let mut t = Table::about(file);
    let sections = if batches.is_compressed() { ", sections compressed" } else { "" };
    t.row("format", format!("quantised batches, {} bits per coordinate{sections}", header.precision().bits()));
    t.row("name", &description.name);
    t.row("points", format!("{} in {}", count(header.points), text::batches(u64::from(header.batches))));
    if header.points > 0 {
        t.row("bounds", text::corners(&header.tight.min, &header.tight.max));
        t.row("largest box", number(largest_box(batches.records())));
    }
    let cell = header.grid.cell;
    t.row("levels", format!("cells of {}, {} and {}", number(cell), number(cell / 2.0), number(cell / 4.0)));
    let lattice = &description.lattice;
    t.row("lattice", format!("step {}, offset {}", numbers(&lattice.scale), numbers(&lattice.offset)));
    for (bits, figures) in errors(batches) {
        let (max, rms) = (numbers(&figures.max), numbers(&figures.rms));
        t.row(&format!("error, {bits} bits"), format!("at most {max}, root mean square {rms}"));
    }
    t.row("CRS", or_none(&description.projection));
    t.row("colour", description.colour.name());
    t.row("originals", plural(batches.originals().len() as u64, "colour"));
    t.row("size", bytes(size));
    for (i, attribute) in attributes(batches).iter().enumerate() {
        t.row(if i == 0 { "attributes" } else { "" }, attribute_line(attribute, None));
    }
    t.0
}

fn errors<B: AsRef<[u8]>>(batches: &Batches<B>) -> Vec<(u32, pointmill_format::batches::ErrorFigures)> {
    let e = &batches.description().errors;
    [(10, e.ten), (20, e.twenty), (30, e.thirty)].into_iter().filter_map(|(bits, f)| Some((bits, f?))).collect()
}

fn json<B: AsRef<[u8]>>(file: &Path, batches: &Batches<B>, size: u64) -> Value {
    let (header, description) = (batches.header(), batches.description());
    json!({
        "path": file.to_string_lossy(),
        "kind": "dataset",
        "format": "batches",
        "name": description.name,
        "points": header.points,
        "batches": header.batches,
        "bits": header.precision().bits(),
        "compressed": batches.is_compressed(),
        "bounds": (header.points > 0).then(|| corners(&header.tight)),
        "largest_box": largest_box(batches.records()),
        "origin": header.grid.origin,
        "cell": header.grid.cell,
        "lattice": { "scale": description.lattice.scale, "offset": description.lattice.offset },
        "errors": description.errors,
        "projection": description.projection,
        "colour": description.colour,
        "originals": batches.originals().len(),
        "attributes": attributes(batches).iter().map(attribute_json).collect::<Vec<_>>(),
        "file_bytes": size,
    })
}
