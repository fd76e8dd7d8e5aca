//! `pointmill info`: what scans and datasets are.

use std::path::{Path, PathBuf};

use pointmill_format::potree2::{Dataset, Metadata, Node};
use pointmill_format::{Aabb, Attribute, ReadError, Scan};
use serde_json::{Value, json};

use crate::args::InfoArgs;
use crate::exit::{Failure, emit, tell};
use crate::inputs;
use crate::measure::{Measured, measure};
use crate::text;

/// Every path is told of; the exit code is that of the first that could not be.
pub(crate) fn run(args: &InfoArgs) -> Result<(), Failure> {
    let mut objects = Vec::new();
    let mut first_failure = None;
    for path in &args.paths {
        let mut show = |object: Result<Told, Failure>| -> Result<(), Failure> {
            match object {
                Ok(told) if args.json => objects.push(told.json),
                Ok(told) => emit(&told.text)?,
                Err(failure) => fail(&mut first_failure, failure),
            }
            Ok(())
        };
        match dataset_folder(path) {
            Some(folder) => show(dataset(&folder))?,
            None => match inputs::expand(std::slice::from_ref(path)) {
                Err(failure) => show(Err(failure))?,
                Ok(found) => {
                    found.notes.iter().for_each(|note| tell(note));
                    for file in &found.files {
                        let (told, fault) = match scan(file, args) {
                            Ok((told, fault)) => (Ok(told), fault),
                            Err(failure) => (Err(failure), None),
                        };
                        show(told)?;
                        if let Some(fault) = fault {
                            show(Err(fault))?;
                        }
                    }
                }
            },
        }
    }
    if args.json {
        emit(&format!("{:#}\n", Value::Array(objects)))?;
    }
    first_failure.map_or(Ok(()), Err)
}

/// Failures are told in the order they are met, save one that is left to `main`, which gives the exit code.
fn fail(first: &mut Option<Failure>, failure: Failure) {
    match first {
        None => *first = Some(failure),
        Some(_) => failure.tell(),
    }
}

struct Told {
    text: String,
    json: Value,
}

/// The folder of a dataset, if `path` is one or its `metadata.json`.
fn dataset_folder(path: &Path) -> Option<PathBuf> {
    if path.join("metadata.json").is_file() {
        return Some(path.to_path_buf());
    }
    let is_metadata = path.is_file() && path.file_name().is_some_and(|name| name == "metadata.json");
    is_metadata.then(|| path.parent().map(Path::to_path_buf)).flatten()
}

fn scan(file: &Path, args: &InfoArgs) -> Result<(Told, Option<Failure>), Failure> {
    let scan = pointmill_format::open_scan(file, &args.reading.options())?;
    let (measured, fault) = match args.deep.then(|| measure(&*scan)) {
        Some((measured, fault)) => (Some(measured), fault.map(Failure::from)),
        None => (None, None),
    };
    let text = text::scan(scan.info(), scan.pieces().len(), measured.as_ref());
    Ok((Told { text, json: scan_json(&*scan, measured.as_ref()) }, fault))
}

fn scan_json(scan: &dyn Scan, measured: Option<&Measured>) -> Value {
    let info = scan.info();
    let mut object = json!({
        "path": info.path.to_string_lossy(),
        "kind": "scan",
        "format": info.format,
        "points_declared": info.points_declared,
        "bounds_declared": info.bounds_declared.map(|b| corners(&b)),
        "lattice": info.lattice.map(|l| json!({ "scale": l.scale, "offset": l.offset })),
        "crs": { "wkt": info.crs.wkt, "epsg": info.crs.epsg, "vertical_epsg": info.crs.vertical_epsg },
        "attributes": info.attributes.iter().map(attribute_json).collect::<Vec<_>>(),
        "pieces": scan.pieces().len(),
        "file_bytes": info.file_bytes,
        "warnings": info.warnings,
    });
    if let Some(measured) = measured {
        let names = info.attributes.iter().map(|a| a.name.clone());
        let ranges = measured.ranges.iter().map(|elements| {
            let ends = |end: usize| elements.iter().map(|e| e[end]).collect::<Vec<_>>();
            json!({ "min": ends(0), "max": ends(1) })
        });
        object["measured"] = json!({
            "points": measured.points,
            "bounds": (!measured.bounds.is_empty()).then(|| corners(&measured.bounds)),
            "ranges": names.zip(ranges).collect::<serde_json::Map<_, _>>(),
        });
    }
    object
}

fn dataset(folder: &Path) -> Result<Told, Failure> {
    let dataset = Dataset::open(folder)?;
    let metadata = dataset.metadata();
    let nodes = dataset.read_hierarchy()?;
    let levels = levels(&nodes);
    let bytes = size_of_files(folder)?;
    let text = text::dataset(folder, metadata, &levels, bytes);
    Ok(Told { text, json: dataset_json(folder, metadata, &levels, bytes) })
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
        path.metadata().map(|m| m.len()).map_err(|e| ReadError::io(&path, "looking at its size", e).into())
    };
    ["metadata.json", "hierarchy.bin", "octree.bin"].into_iter().map(size).sum()
}

fn dataset_json(folder: &Path, metadata: &Metadata, levels: &[[u64; 2]], bytes: u64) -> Value {
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
        "file_bytes": bytes,
    })
}

fn attribute_json(attribute: &Attribute) -> Value {
    json!({
        "name": attribute.name,
        "type": attribute.ty.potree_name(),
        "elements": attribute.elements,
        "scale": attribute.scale,
        "offset": attribute.offset,
        "no_data": attribute.no_data,
    })
}

fn corners(bounds: &Aabb) -> Value {
    json!({ "min": bounds.min, "max": bounds.max })
}
