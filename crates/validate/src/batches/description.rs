//! The description (§6.5): a JSON object, complete, and in agreement with the header.

use std::collections::HashSet;

use pointmill_format::{Attribute, AttributeType, Lattice, ReadError, json_fault};
use serde_json::{Map, Value, json};

use super::bytes::Bytes;
use super::header::{HEADER_BYTES, Header};
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// More JSON than this is no description.
pub(crate) const MAX_BYTES: u64 = 16 << 20;

/// Of the page.
const MAX_ATTRIBUTES: usize = 256;

/// What is needed of the description.
#[derive(Debug, Clone)]
pub(crate) struct Description {
    pub(crate) lattice: Lattice,
    pub(crate) attributes: Vec<Extra>,
    pub(crate) colour: Colour,
    /// lo, hi of §6.2.
    pub(crate) intensity_range: Option<[u64; 2]>,
    /// For 10, 20, 30 bits: max and rms; for the planes that are stated.
    pub(crate) errors: [Option<Figures>; 3],
    /// All of it.
    pub(crate) json: Value,
}

/// Largest error and root of the mean square for each axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Figures {
    pub(crate) max: [f64; 3],
    pub(crate) rms: [f64; 3],
}

/// Where colours come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Colour {
    Rgb,
    Intensity,
    None,
}

/// An extra attribute and its section.
#[derive(Debug, Clone)]
pub(crate) struct Extra {
    pub(crate) attribute: Attribute,
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
    /// Least and greatest raw value of each element, where they are stated.
    pub(crate) min: Option<Vec<f64>>,
    pub(crate) max: Option<Vec<f64>>,
}

/// Reads and checks the description; `None` if positions or sections cannot be made sense of without it.
///
/// # Errors
/// The operating system cannot read the file.
pub(crate) fn read(bytes: &Bytes, header: &Header, findings: &Findings) -> Result<Option<Description>, ReadError> {
    findings.checked(Check::Description, 1);
    let (at, len) = (header.description_at, header.description_bytes);
    let end = at.checked_add(len).filter(|end| at >= HEADER_BYTES && *end <= bytes.len);
    if end.is_none() {
        let found = format!("bytes {at} to {}", at.saturating_add(len));
        fault(findings, "place", format!("inside the {} bytes of the file", bytes.len), found);
        return Ok(None);
    }
    if len > MAX_BYTES {
        fault(findings, "length", format!("at most {MAX_BYTES} bytes"), len);
        return Ok(None);
    }
    let mut raw = Vec::new();
    bytes.read(at, len, &mut raw)?;
    let json: Map<String, Value> = match serde_json::from_slice(&raw) {
        Ok(json) => json,
        Err(error) => {
            fault(findings, "text", "a JSON object in UTF-8", json_fault(&error));
            return Ok(None);
        }
    };
    for key in ["version", "name", "projection"] {
        if !json.get(key).is_some_and(Value::is_string) {
            fault(findings, key, "a string", json.get(key).cloned().unwrap_or_default());
        }
    }
    if vector(json.get("sourceStep")).is_none_or(|v| v.iter().any(|s| *s < 0.0)) {
        fault(findings, "sourceStep", "three numbers, 0 or more", json.get("sourceStep").cloned().unwrap_or_default());
    }
    let lattice = lattice(json.get("lattice"), findings);
    let attributes = attributes(json.get("attributes"), header, findings);
    let colour = match json.get("colour").and_then(Value::as_str) {
        Some("rgb") => Colour::Rgb,
        Some("intensity") => Colour::Intensity,
        Some("none") => Colour::None,
        _ => {
            let found = json.get("colour").cloned().unwrap_or_default();
            fault(findings, "colour", r#""rgb", "intensity" or "none""#, found);
            Colour::Rgb // of which nothing else is known
        }
    };
    let errors = errors(json.get("errors"), header, findings);
    let intensity_range = json.get("intensityRange").and_then(|value| {
        let range = numbers(Some(value)).and_then(|v| <[f64; 2]>::try_from(v).ok());
        let whole = |v: &f64| v.fract() == 0.0 && (0.0..=65_535.0).contains(v);
        let range = range.filter(|range| range.iter().all(whole) && range[0] <= range[1]);
        if range.is_none() {
            fault(findings, "intensityRange", "[least, greatest], whole numbers of 16 bits", value.clone());
        }
        range.map(|range| range.map(|v| v as u64))
    });
    let (Some(lattice), Some(attributes)) = (lattice, attributes) else { return Ok(None) };
    Ok(Some(Description { lattice, attributes, colour, intensity_range, errors, json: json.into() }))
}

fn fault(
    findings: &Findings,
    subject: impl Into<std::borrow::Cow<'static, str>>,
    expected: impl Into<Value>,
    found: impl Into<Value>,
) {
    findings.push(Finding::new(Check::Description, subject, expected, found));
}

/// Finite numbers.
fn numbers(value: Option<&Value>) -> Option<Vec<f64>> {
    value?.as_array()?.iter().map(|v| v.as_f64().filter(|v| v.is_finite())).collect()
}

fn vector(value: Option<&Value>) -> Option<[f64; 3]> {
    numbers(value)?.try_into().ok()
}

fn lattice(value: Option<&Value>, findings: &Findings) -> Option<Lattice> {
    let part = |key| vector(value.and_then(|v| v.get(key)));
    let lattice = part("scale").zip(part("offset")).map(|(scale, offset)| Lattice { scale, offset });
    let lattice = lattice.filter(Lattice::is_valid);
    if lattice.is_none() {
        fault(findings, "lattice", "scale, above 0, and offset", value.cloned().unwrap_or_default());
    }
    lattice
}

fn attributes(value: Option<&Value>, header: &Header, findings: &Findings) -> Option<Vec<Extra>> {
    let Some(list) = value.and_then(Value::as_array) else {
        fault(findings, "attributes", "an array", value.cloned().unwrap_or_default());
        return None;
    };
    if list.len() > MAX_ATTRIBUTES {
        fault(findings, "attributes", format!("at most {MAX_ATTRIBUTES}"), list.len());
        return None;
    }
    let mut names = HashSet::new();
    let mut out = Vec::new();
    for (i, value) in list.iter().enumerate() {
        let Some(extra) = extra(value) else {
            let expected = "name, known type, elements 1 to 256, offset, bytes";
            fault(findings, format!("attribute {i}"), expected, value.clone());
            return None;
        };
        let name = extra.attribute.name.clone();
        let raw = header.points.saturating_mul(extra.attribute.size() as u64);
        if !header.compressed() && extra.bytes != raw {
            fault(findings, format!("bytes of {name}"), raw, extra.bytes);
            return None;
        }
        for key in ["valueScale", "valueOffset", "min", "max"] {
            if let Some(given) = value.get(key)
                && numbers(Some(given)).is_none_or(|v| v.len() != extra.attribute.elements)
            {
                fault(findings, format!("{key} of {name}"), "a number for each element", given.clone());
            }
        }
        if !names.insert(name.clone()) {
            fault(findings, "attributes", "unique names", name);
        }
        out.push(extra);
    }
    Some(out)
}

fn extra(value: &Value) -> Option<Extra> {
    let elements = value["elements"].as_u64().filter(|e| (1..=256).contains(e))? as usize;
    let ty = AttributeType::from_potree_name(value["type"].as_str()?)?;
    let mut attribute = Attribute::new(value["name"].as_str()?, ty, elements);
    let each = |key: &str| numbers(value.get(key)).filter(|v| v.len() == elements);
    if let Some(scale) = each("valueScale") {
        attribute.scale = scale;
    }
    if let Some(offset) = each("valueOffset") {
        attribute.offset = offset;
    }
    let (offset, bytes) = (value["offset"].as_u64()?, value["bytes"].as_u64()?);
    Some(Extra { attribute, offset, bytes, min: each("min"), max: each("max") })
}

/// Figures for exactly the planes that are there.
fn errors(value: Option<&Value>, header: &Header, findings: &Findings) -> [Option<Figures>; 3] {
    let mut out = [None; 3];
    for (plane, bits) in ["10", "20", "30"].into_iter().enumerate() {
        let given = value.and_then(|v| v.get(bits));
        let part = |key| vector(given.and_then(|v| v.get(key))).filter(|v| v.iter().all(|x| *x >= 0.0));
        out[plane] = part("max").zip(part("rms")).map(|(max, rms)| Figures { max, rms });
        let there = plane < header.planes();
        if there && out[plane].is_none() {
            let expected = "max and rms, three numbers each, 0 or more";
            fault(findings, format!("errors of {bits} bits"), expected, given.cloned().unwrap_or_default());
        } else if !there && given.is_some() {
            fault(findings, format!("errors of {bits} bits"), Value::Null, json!("figures of a plane that is absent"));
        }
    }
    out
}

impl Description {
    /// The extra attribute that greys come from, if it is there as integers of 8 or 16 bits.
    pub(crate) fn intensity_column(&self) -> Option<usize> {
        let is = |extra: &Extra| {
            extra.attribute.name == "intensity"
                && matches!(extra.attribute.ty, AttributeType::UInt8 | AttributeType::UInt16)
                && extra.attribute.elements == 1
        };
        (self.colour == Colour::Intensity).then(|| self.attributes.iter().position(is)).flatten()
    }

    /// The extra attribute that greys come from, if it is there as numbers of another type.
    pub(crate) fn wide_intensity_column(&self) -> Option<usize> {
        let is = |extra: &Extra| extra.attribute.name == "intensity" && extra.attribute.elements == 1;
        let is_wide = self.colour == Colour::Intensity && self.intensity_range.is_none();
        is_wide.then(|| self.attributes.iter().position(is)).flatten()
    }
}
