//! Describes a scan: its header and, if its points are decoded, their count, bounds and ranges.

use std::path::Path;

use pointmill_format::{AxisGrid, OpenOptions, Resolution, Scan, ScanInfo, Unit};
use serde_json::{Map, Value, json};

use super::copc::{self, Octree};
use super::description::{Description, attribute_json, corners};
use super::measure::{Measured, measure};
use super::parts;
use crate::exit::Failure;
use crate::human::quantities::{bytes, count, number, numbers, plural};
use crate::human::text::{self, Table, attribute_line};

/// Maximum scans, and images, of a file that are listed as text; JSON lists all.
const MAX_PARTS: usize = 30;

/// Describes a scan, with `deep` also its points.
pub(super) fn describe(file: &Path, options: &OpenOptions, deep: bool) -> Result<Description, Failure> {
    let scan = pointmill_format::open_scan(file, options)?;
    let (measured, fault) = match deep.then(|| measure(&*scan)) {
        Some((measured, fault)) => (Some(measured), fault.map(Failure::from)),
        None => (None, None),
    };
    let (octree, broken) = copc::octree(file);
    let (measured, octree) = (measured.as_ref(), octree.as_ref());
    let (text, json) = (text(&*scan, measured, octree), json(&*scan, measured, octree));
    Ok(Description { text, json, fault: fault.or(broken) })
}

fn text(scan: &dyn Scan, measured: Option<&Measured>, octree: Option<&Octree>) -> String {
    let info = scan.info();
    let mut t = Table::about(&info.path);
    t.row("format", &info.format);
    t.row("points", count(info.points_declared));
    let declared = info.bounds_declared.map_or_else(|| "not declared".to_owned(), |b| text::corners(&b.min, &b.max));
    t.row("bounds", declared);
    if let Some(measured) = measured {
        let invalid = match measured.invalid {
            0 => String::new(),
            n => format!(", {} of them without a valid position", count(n)),
        };
        t.row("decoded", plural(measured.points, "point") + &invalid);
        let bounds = &measured.bounds;
        t.row("measured", if bounds.is_empty() { "nothing".into() } else { text::corners(&bounds.min, &bounds.max) });
    }
    match info.lattice {
        Some(l) => t.row("lattice", format!("step {}, offset {}", numbers(&l.scale), numbers(&l.offset))),
        None => t.row("resolution", resolution(info, measured)),
    }
    let crs = pointmill_converter::resolve_crs(&info.crs);
    t.row("CRS", text::or_none(&crs.label));
    if crs.unit.is_some() || crs.vertical_unit.is_some() {
        t.row("units", text::units(&crs));
    }
    let pieces = plural(scan.pieces().len() as u64, "piece");
    t.row("size", format!("{}, {pieces} to decode in parallel", bytes(info.file_bytes)));
    octree.into_iter().for_each(|octree| octree.rows(&mut t));
    list(&mut t, "scan", info.parts.iter().map(parts::part_line), info.parts.len());
    list(&mut t, "image", info.images.iter().map(parts::image_line), info.images.len());
    for (i, attribute) in info.attributes.iter().enumerate() {
        let ranges = measured.map(|m| m.ranges[i].as_slice());
        t.row(if i == 0 { "attributes" } else { "" }, attribute_line(attribute, ranges));
    }
    info.warnings.iter().for_each(|w| t.row("warning", w.to_string()));
    crs.notes.iter().for_each(|note| t.row("warning", note.to_string()));
    t.0
}

/// Lines of a list of scans or images.
fn list(t: &mut Table, noun: &str, lines: impl Iterator<Item = String>, count: usize) {
    for (i, line) in lines.take(MAX_PARTS).enumerate() {
        t.row(&if i == 0 { format!("{noun}s") } else { String::new() }, line);
    }
    if let Some(more @ 1..) = count.checked_sub(MAX_PARTS) {
        t.row("", format!("and {}; --json lists all", plural(more as u64, &format!("more {noun}"))));
    }
}

/// The precision of stored coordinates: one text where all axes agree, else one per axis.
fn resolution(info: &ScanInfo, measured: Option<&Measured>) -> String {
    let bounds = measured.map(|m| m.bounds).filter(|b| !b.is_empty()).or(info.bounds_declared);
    let [x, y, z] = std::array::from_fn(|a| {
        let far = bounds.map(|b| b.min[a].abs().max(b.max[a].abs()));
        axis_resolution(info.resolution[a], far)
    });
    if x == y && y == z { format!("stored {x}") } else { format!("stored x {x}, y {y}, z {z}") }
}

/// The precision of an axis; `far`: its largest coordinate.
fn axis_resolution(resolution: Resolution, far: Option<f64>) -> String {
    match (resolution, far) {
        (Resolution::Grid(AxisGrid { step, offset }), _) if offset % step == 0.0 => {
            format!("in steps of {}", number(step))
        }
        (Resolution::Grid(AxisGrid { step, offset }), _) => {
            format!("in steps of {} from {}", number(step), number(offset))
        }
        (Resolution::Step(step), _) => format!("in steps of {}", number(step)),
        (Resolution::Double, _) => "in double precision, or as decimal text".to_owned(),
        (Resolution::Single, None) => "in single precision; --deep reports the step at the far ends".to_owned(),
        (Resolution::Single, Some(far)) => {
            format!("in single precision, steps of {} at the far ends", number(single_step(far)))
        }
    }
}

/// The step of single precision at `v` ≥ 0.
fn single_step(v: f64) -> f64 {
    let v = v as f32;
    f64::from(v.next_up()) - f64::from(v)
}

fn json(scan: &dyn Scan, measured: Option<&Measured>, octree: Option<&Octree>) -> Value {
    let info = scan.info();
    let of_axis = |resolution: Resolution| match resolution {
        Resolution::Grid(grid) => json!({ "stored": "steps", "step": grid.step, "offset": grid.offset }),
        Resolution::Step(step) => json!({ "stored": "steps", "step": step }),
        Resolution::Single => json!({ "stored": "single" }),
        Resolution::Double => json!({ "stored": "double or text" }),
    };
    let resolution = info.lattice.is_none().then(|| info.resolution.map(of_axis));
    let mut object = json!({
        "path": info.path.to_string_lossy(),
        "kind": "scan",
        "format": info.format,
        "points_declared": info.points_declared,
        "bounds_declared": info.bounds_declared.map(|b| corners(&b)),
        "lattice": info.lattice.map(|l| json!({ "scale": l.scale, "offset": l.offset })),
        "resolution": resolution,
        "crs": crs_json(info),
        "scans": info.parts.iter().map(parts::part_json).collect::<Vec<_>>(),
        "images": info.images.iter().map(parts::image_json).collect::<Vec<_>>(),
        "attributes": info.attributes.iter().map(attribute_json).collect::<Vec<_>>(),
        "pieces": scan.pieces().len(),
        "file_bytes": info.file_bytes,
        "warnings": info.warnings.iter().map(ToString::to_string).collect::<Vec<_>>(),
    });
    if let Some(measured) = measured {
        let names = info.attributes.iter().map(|a| a.name.clone());
        let ranges = measured.ranges.iter().map(|elements| {
            let ends = |end: usize| elements.iter().map(|e| e[end]).collect::<Vec<_>>();
            json!({ "min": ends(0), "max": ends(1) })
        });
        object["measured"] = json!({
            "points": measured.points,
            "invalid": measured.invalid,
            "bounds": (!measured.bounds.is_empty()).then(|| corners(&measured.bounds)),
            "ranges": names.zip(ranges).collect::<Map<_, _>>(),
        });
    }
    if let Some(octree) = octree {
        object["octree"] = octree.json();
    }
    object
}

/// What the file declares, and what it comes to: name, definition for viewers, units.
fn crs_json(info: &ScanInfo) -> Value {
    let crs = pointmill_converter::resolve_crs(&info.crs);
    let unit = |unit: Option<Unit>| unit.map(|unit| json!({ "name": unit.to_string(), "metres": unit.metres() }));
    json!({
        "wkt": info.crs.wkt,
        "epsg": info.crs.epsg,
        "vertical_epsg": info.crs.vertical_epsg,
        "name": crs.label,
        "projection": crs.projection,
        "is_geographic": crs.is_geographic(),
        "unit": unit(crs.unit),
        "vertical_unit": unit(crs.vertical_unit),
        "warnings": crs.notes.iter().map(ToString::to_string).collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_precision_is_described_as_steps() {
        assert_eq!(
            [single_step(0.6), single_step(500_000.0), single_step(5_400_000.0)],
            [2f64.powi(-24), 0.03125, 0.5]
        );
    }
}
