//! `metadata.json`: every key there, of the right type, in range, and in agreement with the others.

use std::collections::HashSet;

use pointmill_format::AttributeType;
use serde_json::{Value, json};

use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Sides of the cube, and spacing against side, agree within this, relative.
const RELATIVE: f64 = 1e-9;

/// Stored coordinates are 32-bit and some clients read them as unsigned, others as signed.
const MAX_STORED: f64 = 2_147_483_648.0;

/// Checks the JSON value itself, not what a reader made of it: readers forgive.
pub(crate) fn check(root: &Value, findings: &Findings) {
    let judge = Judge(findings);
    judge.that(root["version"] == "2.0", "version", "\"2.0\"", &root["version"]);
    for key in ["name", "description", "projection"] {
        judge.that(root[key].is_string(), key, "a string", &root[key]);
    }
    let projection = root["projection"].as_str().unwrap_or_default();
    if !(projection.is_empty() || projection.starts_with("+proj") || projection == "EPSG:4326") {
        let expected = "empty, a proj4 string or EPSG:4326: with anything else the Potree viewer draws nothing";
        findings.push(Finding::new(Check::Metadata, "projection", expected, projection).warning());
    }
    judge.that(root["points"].is_u64(), "points", "a whole number", &root["points"]);
    let hierarchy = &root["hierarchy"];
    let first = hierarchy["firstChunkSize"].as_u64().is_some_and(|n| n >= 22 && n % 22 == 0);
    judge.that(first, "hierarchy.firstChunkSize", "a multiple of 22, at least 22", &hierarchy["firstChunkSize"]);
    let step = hierarchy["stepSize"].as_u64().is_some_and(|n| n >= 1);
    judge.that(step, "hierarchy.stepSize", "at least 1", &hierarchy["stepSize"]);
    let depth = hierarchy["depth"].as_u64().is_some_and(|n| n <= 64);
    judge.that(depth, "hierarchy.depth", "0 to 64", &hierarchy["depth"]);
    let encoding = matches!(root["encoding"].as_str(), Some("DEFAULT" | "BROTLI"));
    judge.that(encoding, "encoding", "\"DEFAULT\" or \"BROTLI\"", &root["encoding"]);
    geometry(root, &judge);
    attributes(root, &judge);
}

fn geometry(root: &Value, judge: &Judge) {
    let vector = |value: &Value| -> Option<[f64; 3]> { numbers(value)?.try_into().ok() };
    let scale = vector(&root["scale"]).filter(|s| s.iter().all(|s| *s > 0.0));
    judge.that(scale.is_some(), "scale", "three numbers above 0", &root["scale"]);
    let offset = vector(&root["offset"]);
    judge.that(offset.is_some(), "offset", "three numbers", &root["offset"]);
    let corners = vector(&root["boundingBox"]["min"]).zip(vector(&root["boundingBox"]["max"]));
    let sides = corners.map(|(min, max)| [0, 1, 2].map(|a| max[a] - min[a]));
    let side = sides.map_or(f64::NAN, |s| s[0]);
    // Far from 0 the corners themselves are rounded: by half an ulp each.
    let farthest = corners.map_or(0.0, |(min, max)| min.iter().chain(&max).fold(0.0f64, |far, v| far.max(v.abs())));
    let tolerance = RELATIVE * side + 2.0 * f64::EPSILON * farthest;
    let cubic = sides.is_some_and(|s| side > 0.0 && s.iter().all(|v| (v - side).abs() <= tolerance));
    judge.that(cubic, "boundingBox", "a cube with sides above 0", &root["boundingBox"]);
    if let (Some((min, max)), Some(offset), Some(scale)) = (corners, offset, scale) {
        judge.that(offset == min, "offset", &format!("boundingBox.min {min:?}"), &root["offset"]);
        // Where steps differ between the axes the cube may well reach further than the points on the axis of fine steps.
        let last = tight_max(root).map_or(max, |tight| [0, 1, 2].map(|a| tight[a].min(max[a])));
        let reach = (0..3).map(|a| (last[a] - offset[a]) / scale[a]).fold(0.0, f64::max);
        judge.that(reach <= MAX_STORED, "points in lattice steps", "at most 2^31", &json!(reach));
    }
    let spacing = root["spacing"].as_f64().filter(|s| *s > 0.0);
    judge.that(spacing.is_some(), "spacing", "a number above 0", &root["spacing"]);
    if let Some(spacing) = spacing.filter(|_| cubic) {
        let (least, most) = (side / 1024.0, side / 16.0);
        if !(least..=most).contains(&spacing) {
            let usual = format!("side / 1024 to side / 16, which are {least} to {most}");
            judge.0.push(Finding::new(Check::Metadata, "spacing", usual, spacing).warning());
        }
    }
}

/// The upper corner of the box around the points.
fn tight_max(root: &Value) -> Option<[f64; 3]> {
    let position = root["attributes"].as_array()?.iter().find(|a| a["name"] == "position")?;
    numbers(&position["max"])?.try_into().ok()
}

fn attributes(root: &Value, judge: &Judge) {
    let Some(list) = root["attributes"].as_array() else {
        judge.that(false, "attributes", "an array", &root["attributes"]);
        return;
    };
    let mut names = HashSet::new();
    for value in list {
        let name = value["name"].as_str().unwrap_or_default();
        judge.that(!name.is_empty(), "name of an attribute", "a string that is not empty", &value["name"]);
        judge.that(names.insert(name), "name of an attribute", "one that no other attribute has", &value["name"]);
        attribute(name, value, judge);
    }
    judge.that(names.contains("position"), "attributes", "one named position", &json!(list.len()));
}

fn attribute(name: &str, value: &Value, judge: &Judge) {
    let subject = |key: &str| format!("{key} of {name}");
    let ty = value["type"].as_str().and_then(AttributeType::from_potree_name);
    judge.that(ty.is_some(), &subject("type"), "a type of Potree 2.0", &value["type"]);
    let elements = value["numElements"].as_u64().filter(|n| (1..=16).contains(n));
    judge.that(elements.is_some(), &subject("numElements"), "1 to 16", &value["numElements"]);
    let (Some(ty), Some(elements)) = (ty, elements) else { return };
    let element_size = ty.size() as u64;
    for (key, expected) in [("elementSize", element_size), ("size", elements * element_size)] {
        judge.that(value[key] == expected, &subject(key), &expected.to_string(), &value[key]);
    }
    let special = match name {
        "position" => Some((AttributeType::Int32, "int32 × 3")),
        "rgb" => Some((AttributeType::UInt16, "uint16 × 3")),
        _ => None,
    };
    if let Some((expected, words)) = special {
        judge.that(ty == expected && elements == 3, &subject("type"), words, &value["type"]);
    }
    if matches!(ty, AttributeType::Int64 | AttributeType::UInt64) {
        let expected = "at most 32-bit integers: the Potree viewers cannot decode nodes with 64-bit ones";
        judge.0.push(Finding::new(Check::Metadata, subject("type"), expected, ty.potree_name()).warning());
    }
    let bounds = [numbers(&value["min"]), numbers(&value["max"])];
    for (key, bound) in ["min", "max"].into_iter().zip(&bounds) {
        let right = bound.as_ref().is_some_and(|b| b.len() as u64 == elements);
        judge.that(right, &subject(key), &format!("{elements} numbers"), &value[key]);
    }
    if let [Some(min), Some(max)] = &bounds {
        let ordered = min.iter().zip(max).all(|(a, b)| a <= b);
        judge.that(ordered, &subject("min"), &format!("at most max {max:?}"), &value["min"]);
    }
}

/// The numbers of an array; JSON itself has neither NaN nor infinities.
fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

struct Judge<'a>(&'a Findings);

impl Judge<'_> {
    /// One requirement of the metadata: met, or a finding.
    fn that(&self, kept: bool, subject: &str, expected: &str, found: &Value) {
        self.0.checked(Check::Metadata, 1);
        if !kept {
            self.0.push(Finding::new(Check::Metadata, subject.to_owned(), expected, found.clone()));
        }
    }
}
