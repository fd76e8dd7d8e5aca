//! Reads `metadata.json`: strict on what the bytes of the other files depend on, patient with the rest.

use std::path::Path;

use serde_json::Value;

use crate::json::{Fault, Fields, broken, syntax_error, unsupported};
use crate::{Aabb, Attribute, AttributeType, Lattice, ReadError};

use super::{AttributeStats, Encoding, Metadata};

/// More elements per point than any attribute has; keeps a bad count from requesting memory.
const MAX_ELEMENTS: u64 = 256;

impl Metadata {
    /// Parses `metadata.json`; `path` is for messages.
    ///
    /// # Errors
    /// What is missing, of the wrong type or out of range, and where; [`crate::ErrorKind::Unsupported`] for a version,
    /// an encoding or an attribute type that is not of Potree 2.0.
    pub fn from_json(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self, ReadError> {
        parse(bytes, path.as_ref())
    }
}

fn parse(bytes: &[u8], path: &Path) -> Result<Metadata, ReadError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let value = serde_json::from_slice(bytes).map_err(|e| syntax_error(bytes, path, &e))?;
    from_value(value).map_err(|fault| fault.of(path))
}

fn from_value(value: Value) -> Result<Metadata, Fault> {
    let Value::Object(mut map) = value else { return broken("is not a JSON object") };
    let mut top = Fields { map: &mut map, place: "" };
    match top.text("version")?.as_str() {
        "" | "2.0" => {}
        other => return unsupported(format!("version \"{other}\"; 2.0 is the one that is read")),
    }
    let (mut hierarchy, mut bounds) = (top.object("hierarchy")?, top.object("boundingBox")?);
    let mut hierarchy = Fields { map: &mut hierarchy, place: "hierarchy." };
    let mut bounds = Fields { map: &mut bounds, place: "boundingBox." };
    let metadata = Metadata {
        name: top.text("name")?,
        description: top.text("description")?,
        points: top.integer("points")?,
        projection: top.text("projection")?,
        first_chunk_size: hierarchy.integer("firstChunkSize")?,
        step_size: hierarchy.small("stepSize")?,
        depth: hierarchy.small("depth")?,
        lattice: Lattice { scale: top.vector("scale")?, offset: top.vector("offset")? },
        spacing: top.number("spacing")?,
        cube: Aabb { min: bounds.vector("min")?, max: bounds.vector("max")? },
        encoding: encoding(&top.text("encoding")?)?,
        attributes: attributes(top.take("attributes"))?,
        extra: map,
    };
    check(&metadata)?;
    Ok(metadata)
}

fn check(m: &Metadata) -> Result<(), Fault> {
    if !m.lattice.is_valid() {
        return broken(format!("scale {:?} has to be greater than 0", m.lattice.scale));
    }
    if m.spacing <= 0.0 {
        return broken(format!("spacing {} has to be greater than 0", m.spacing));
    }
    if m.cube.is_empty() {
        return broken(format!("boundingBox has its min {:?} above its max {:?}", m.cube.min, m.cube.max));
    }
    let Some(position) = m.position_index() else { return broken("there is no attribute named position") };
    let is = |a: &Attribute, ty| a.ty == ty && a.elements == 3;
    if !is(&m.attributes[position].attribute, AttributeType::Int32) {
        return broken("the attribute position is not int32 x 3");
    }
    if m.encoding == Encoding::Brotli
        && let Some(rgb) = m.rgb_index()
        && !is(&m.attributes[rgb].attribute, AttributeType::UInt16)
    {
        return broken("the attribute rgb is not uint16 x 3, which the encoding BROTLI requires");
    }
    Ok(())
}

fn encoding(word: &str) -> Result<Encoding, Fault> {
    match word {
        "BROTLI" => Ok(Encoding::Brotli),
        // UNCOMPRESSED: PotreeConverter copies the word from its command line.
        "DEFAULT" | "UNCOMPRESSED" | "" => Ok(Encoding::Default),
        other => unsupported(format!("encoding \"{other}\"; DEFAULT and BROTLI are read")),
    }
}

fn attributes(value: Option<Value>) -> Result<Vec<AttributeStats>, Fault> {
    let Some(Value::Array(list)) = value else { return broken("attributes is missing or not an array") };
    let mut attributes: Vec<AttributeStats> = Vec::new();
    let mut names = std::collections::HashSet::new();
    for (index, value) in list.into_iter().enumerate() {
        let stats = attribute(value, index)?;
        if !names.insert(stats.attribute.name.clone()) {
            return broken(format!("two attributes are named \"{}\"", stats.attribute.name));
        }
        attributes.push(stats);
    }
    Ok(attributes)
}

fn attribute(value: Value, index: usize) -> Result<AttributeStats, Fault> {
    let place = format!("attributes[{index}].");
    let Value::Object(mut map) = value else { return broken(format!("attributes[{index}] is not an object")) };
    let mut fields = Fields { map: &mut map, place: &place };
    let name = fields.text("name")?;
    if name.is_empty() {
        return broken(format!("{place}name is missing"));
    }
    let word = fields.text("type")?;
    let Some(ty) = AttributeType::from_potree_name(&word) else {
        return unsupported(format!("attribute \"{name}\" has the type \"{word}\""));
    };
    let elements = fields.integer("numElements")?;
    if !(1..=MAX_ELEMENTS).contains(&elements) {
        return broken(format!("attribute \"{name}\" has numElements {elements}"));
    }
    let mut attribute = Attribute::new(name, ty, elements as usize);
    for (key, expected) in [("elementSize", ty.size()), ("size", attribute.size())] {
        let found = fields.integer(key)?;
        if found != expected as u64 {
            let name = &attribute.name;
            return broken(format!(
                "attribute \"{name}\" is {word} x {elements}, so its {key} is {expected}, not {found}"
            ));
        }
    }
    attribute.description = fields.text("description")?;
    let mut per_element = |key| match fields.numbers(key)? {
        Some(n) if n.len() != elements as usize => {
            broken(format!("{place}{key} has {} numbers, not {elements}", n.len()))
        }
        other => Ok(other),
    };
    if let Some(scale) = per_element("scale")? {
        attribute.scale = scale;
    }
    if let Some(offset) = per_element("offset")? {
        attribute.offset = offset;
    }
    let (min, max) = (per_element("min")?.unwrap_or_default(), per_element("max")?.unwrap_or_default());
    let histogram = histogram(fields.take("histogram"), &place)?;
    Ok(AttributeStats { attribute, min, max, histogram })
}

fn histogram(value: Option<Value>, place: &str) -> Result<Option<Vec<u64>>, Fault> {
    let Some(value) = value else { return Ok(None) };
    let counts: Option<Vec<u64>> = value.as_array().and_then(|bins| bins.iter().map(Value::as_u64).collect());
    match counts {
        Some(counts) if counts.len() == 256 => Ok(Some(counts)),
        _ => broken(format!("{place}histogram is not an array of 256 counts")),
    }
}
