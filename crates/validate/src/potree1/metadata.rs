//! `cloud.js`: every key there, of the right type, in range, and in agreement with the others.

use std::collections::HashSet;

use pointmill_format::AttributeType;
use serde_json::{Value, json};

use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Sides of the cube agree within this, relative.
const RELATIVE: f64 = 1e-9;

/// Some clients read stored coordinates as signed.
const MAX_STORED: f64 = 2_147_483_648.0;

/// Words of version 1.7 and older.
const WORDS: [&str; 15] = [
    "POSITION_CARTESIAN",
    "COLOR_PACKED",
    "RGBA_PACKED",
    "RGB_PACKED",
    "INTENSITY",
    "CLASSIFICATION",
    "RETURN_NUMBER",
    "NUMBER_OF_RETURNS",
    "SOURCE_ID",
    "GPS_TIME",
    "NORMAL_SPHEREMAPPED",
    "NORMAL_OCT16",
    "NORMAL",
    "NORMAL_FLOATS",
    "FILLER_1B",
];

/// Checks the JSON value itself, not what a reader made of it: readers forgive. `None`: it is not JSON.
pub(crate) fn check(root: Option<&Value>, findings: &Findings) {
    let judge = Judge(findings);
    let Some(root) = root else {
        judge.that(false, "cloud.js", "JSON", &json!("JavaScript: comments, an assignment or idle commas"));
        return;
    };
    let minor = root["version"].as_str().and_then(|v| v.strip_prefix("1.")?.parse().ok());
    let minor: Option<u32> = minor.filter(|minor| (4..=8).contains(minor));
    judge.that(minor.is_some(), "version", "\"1.4\" to \"1.8\"", &root["version"]);
    let dir = root["octreeDir"].as_str().unwrap_or_default();
    let inside = !dir.is_empty() && !dir.starts_with('/') && !dir.contains([':', '\\']);
    judge.that(inside && dir.split('/').all(|part| part != ".."), "octreeDir", "a folder below", &root["octreeDir"]);
    let projection = &root["projection"];
    judge.that(projection.is_string() || projection.is_null(), "projection", "a string", projection);
    let text = projection.as_str().unwrap_or_default();
    if !(text.is_empty() || text.starts_with("+proj") || text == "EPSG:4326") {
        let expected = "empty, a proj4 string or EPSG:4326: with anything else the Potree viewer draws nothing";
        findings.push(Finding::new(Check::Cloud, "projection", expected, text).warning());
    }
    let points = &root["points"];
    judge.that(points.is_u64() || points.is_null(), "points", "a whole number", points);
    let step = root["hierarchyStepSize"].as_u64().is_some_and(|n| n >= 1);
    judge.that(step || minor == Some(4), "hierarchyStepSize", "at least 1", &root["hierarchyStepSize"]);
    geometry(root, &judge);
    attributes(root, minor, &judge);
}

fn geometry(root: &Value, judge: &Judge<'_>) {
    let scale = root["scale"].as_f64().filter(|scale| *scale > 0.0);
    judge.that(scale.is_some(), "scale", "one number above 0", &root["scale"]);
    let spacing = root["spacing"].as_f64().filter(|spacing| *spacing > 0.0);
    judge.that(spacing.is_some(), "spacing", "a number above 0", &root["spacing"]);
    let cube = corners(&root["boundingBox"]);
    let sides = cube.map(|(min, max)| [0, 1, 2].map(|a| max[a] - min[a]));
    let side = sides.map_or(f64::NAN, |s| s[0]);
    // Far from 0 the corners themselves are rounded: by half an ulp each.
    let farthest = cube.map_or(0.0, |(min, max)| min.iter().chain(&max).fold(0.0f64, |far, v| far.max(v.abs())));
    let tolerance = RELATIVE * side + 2.0 * f64::EPSILON * farthest;
    let cubic = sides.is_some_and(|s| side > 0.0 && s.iter().all(|v| (v - side).abs() <= tolerance));
    judge.that(cubic, "boundingBox", "a cube with sides above 0", &root["boundingBox"]);
    if let Some(scale) = scale.filter(|_| cubic) {
        let least = side - 2.0 * f64::EPSILON * farthest;
        judge.that(least / scale < MAX_STORED, "side of the cube in steps", "below 2^31", &json!(side / scale));
    }
    let tight = corners(&root["tightBoundingBox"]);
    judge.that(tight.is_some(), "tightBoundingBox", "six numbers", &root["tightBoundingBox"]);
    if let (Some((min, max)), Some((low, high))) = (cube, tight) {
        let inside = (0..3).all(|a| min[a] - tolerance <= low[a] && low[a] <= high[a] && high[a] <= max[a] + tolerance);
        judge.that(inside, "tightBoundingBox", "a box within boundingBox", &root["tightBoundingBox"]);
    }
}

/// Lower and upper corner of a box.
fn corners(value: &Value) -> Option<([f64; 3], [f64; 3])> {
    let corner = |keys: [&str; 3]| {
        let [x, y, z] = keys.map(|key| value[key].as_f64());
        Some([x?, y?, z?])
    };
    Some((corner(["lx", "ly", "lz"])?, corner(["ux", "uy", "uz"])?))
}

fn attributes(root: &Value, minor: Option<u32>, judge: &Judge<'_>) {
    let value = &root["pointAttributes"];
    if matches!(value.as_str(), Some("LAS" | "LAZ")) {
        return;
    }
    let Some(list) = value.as_array() else {
        judge.that(false, "pointAttributes", "an array, \"LAS\" or \"LAZ\"", value);
        return;
    };
    let mut names = HashSet::new();
    for attribute in list {
        let name = attribute.as_str().or_else(|| attribute["name"].as_str()).unwrap_or_default();
        let is_own = !name.is_empty() && (names.insert(name) || name == "FILLER_1B");
        judge.that(is_own, "name of an attribute", "one of its own", attribute);
        match minor {
            Some(8) => object(name, attribute, judge),
            _ => judge.that(WORDS.contains(&name) && attribute.is_string(), "attribute", "a word of 1.7", attribute),
        }
    }
    let first = list.first().is_some_and(|a| a == "POSITION_CARTESIAN" || a["name"] == "POSITION_CARTESIAN");
    judge.that(first, "first attribute", "POSITION_CARTESIAN", list.first().unwrap_or(&Value::Null));
}

fn object(name: &str, value: &Value, judge: &Judge<'_>) {
    let subject = |key: &str| format!("{key} of {name}");
    let ty = value["type"].as_str().and_then(AttributeType::from_potree_name);
    judge.that(ty.is_some(), &subject("type"), "a type of §2.2", &value["type"]);
    let elements = value["elements"].as_u64().filter(|n| (1..=16).contains(n));
    judge.that(elements.is_some(), &subject("elements"), "1 to 16", &value["elements"]);
    let (Some(ty), Some(elements)) = (ty, elements) else { return };
    let element_size = ty.size() as u64;
    for (key, expected) in [("elementSize", element_size), ("size", elements * element_size)] {
        judge.that(value[key] == expected, &subject(key), &expected.to_string(), &value[key]);
    }
    if matches!(ty, AttributeType::Int64 | AttributeType::UInt64) {
        let expected = "at most 32-bit integers: the Potree viewer cannot decode nodes with 64-bit ones";
        judge.0.push(Finding::new(Check::Cloud, subject("type"), expected, ty.potree_name()).warning());
    }
}

struct Judge<'a>(&'a Findings);

impl Judge<'_> {
    /// One requirement of the metadata: met, or a finding.
    fn that(&self, kept: bool, subject: &str, expected: &str, found: &Value) {
        self.0.checked(Check::Cloud, 1);
        if !kept {
            self.0.push(Finding::new(Check::Cloud, subject.to_owned(), expected, found.clone()));
        }
    }
}
