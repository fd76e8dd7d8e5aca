//! Reads `cloud.js`: strict on what the bytes of the other files depend on, patient with the rest.

use std::collections::HashSet;
use std::path::Path;

use serde_json::Value;

use crate::json::{Fault, Fields, broken, syntax_error, unsupported, without_javascript};
use crate::{Aabb, Attribute, AttributeType, Lattice, NodeKey, ReadError};

use super::names::{Field, PointAttribute};
use super::{Metadata, NodeFiles};

/// More elements per point than any attribute has; keeps a bad count from requesting memory.
const MAX_ELEMENTS: u64 = 256;

/// The reference divides the cube's side by about 115, older ones its diagonal by 250; what has no spacing gets this.
const USUAL_CELLS: f64 = 200.0;

impl Metadata {
    /// Parses `cloud.js`, JSON or the JavaScript that some call it; `path` is for messages.
    ///
    /// # Errors
    /// What is missing, of the wrong type or out of range, and where; [`crate::ErrorKind::Unsupported`] for a version or
    /// an attribute that is not of Potree 1.4 to 1.8.
    pub fn from_json(bytes: &[u8], path: impl AsRef<Path>) -> Result<Self, ReadError> {
        parse(bytes, path.as_ref())
    }
}

fn parse(bytes: &[u8], path: &Path) -> Result<Metadata, ReadError> {
    let json = without_javascript(bytes);
    let value = serde_json::from_slice(&json).map_err(|e| syntax_error(&json, path, &e))?;
    from_value(value).map_err(|fault| fault.of(path))
}

fn from_value(value: Value) -> Result<Metadata, Fault> {
    let Value::Object(mut map) = value else { return broken("is not a JSON object") };
    let mut top = Fields { map: &mut map, place: "" };
    let minor = version(&top.text("version")?)?;
    let octree_dir = octree_dir(&top.text("octreeDir")?)?;
    let (projection, points) = (projection(&mut top)?, top.optional_integer("points")?);
    let Some(cube) = bounds(&mut top, "boundingBox")? else { return broken("boundingBox is missing") };
    let tight_box = bounds(&mut top, "tightBoundingBox")?;
    let (files, attributes) = attributes(top.take("pointAttributes"))?;
    let side = cube.extent()[0];
    let spacing = match top.optional_number("spacing")? {
        Some(spacing) if spacing < 0.0 => return broken(format!("spacing {spacing} has to be greater than 0")),
        Some(spacing) if spacing > 0.0 => spacing,
        _ => side / USUAL_CELLS,
    };
    let scale = scale(top.take("scale"))?;
    let step = top.integer("hierarchyStepSize").or_else(|fault| if minor < 5 { Ok(5) } else { Err(fault) })?;
    let Some(step) = u32::try_from(step).ok().filter(|step| *step > 0) else {
        return broken(format!("hierarchyStepSize is {step}, not a number from 1 to 2^32 - 1"));
    };
    let nodes = top.take("hierarchy").map(nodes).transpose()?;
    if nodes.is_none() && minor < 5 {
        return broken(format!("version 1.{minor} keeps its nodes in hierarchy, which is missing"));
    }
    let extra = map;
    Ok(Metadata {
        minor,
        octree_dir,
        projection,
        points,
        cube,
        tight_box,
        files,
        attributes,
        spacing,
        scale,
        step,
        nodes,
        extra,
    })
}

fn version(text: &str) -> Result<u32, Fault> {
    let minor = text.strip_prefix("1.").and_then(|minor| minor.parse().ok());
    match minor {
        Some(minor @ 4..=8) => Ok(minor),
        None if text.is_empty() => broken("version is missing"),
        _ => unsupported(format!("version \"{text}\"; 1.4 to 1.8 are those that are read")),
    }
}

/// The parts of a folder that is below that of `cloud.js`, and of no other place.
fn octree_dir(text: &str) -> Result<String, Fault> {
    let parts: Vec<&str> = text.split('/').filter(|part| !matches!(*part, "" | ".")).collect();
    let leaves = text.starts_with('/') || text.contains(['\\', ':']) || parts.contains(&"..");
    match parts.is_empty() || leaves {
        true => broken(format!("octreeDir is \"{text}\", not a folder beside cloud.js")),
        false => Ok(parts.join("/")),
    }
}

/// A proj4 definition; `null` occurs.
fn projection(top: &mut Fields<'_>) -> Result<String, Fault> {
    if top.map.get("projection").is_some_and(Value::is_null) {
        top.take("projection");
    }
    top.text("projection")
}

fn bounds(top: &mut Fields<'_>, key: &str) -> Result<Option<Aabb>, Fault> {
    if !top.map.contains_key(key) {
        return Ok(None);
    }
    let (mut map, place) = (top.object(key)?, format!("{key}."));
    let mut fields = Fields { map: &mut map, place: &place };
    let mut corner = |keys: [&str; 3]| Ok([fields.number(keys[0])?, fields.number(keys[1])?, fields.number(keys[2])?]);
    let bounds = Aabb { min: corner(["lx", "ly", "lz"])?, max: corner(["ux", "uy", "uz"])? };
    if bounds.is_empty() {
        return broken(format!("{key} has its min {:?} above its max {:?}", bounds.min, bounds.max));
    }
    Ok(Some(bounds))
}

/// One number; three that are equal stand for it.
fn scale(value: Option<Value>) -> Result<f64, Fault> {
    let Some(value) = value else { return broken("scale is missing") };
    let one = match &value {
        Value::Array(axes) => match axes.as_slice() {
            [x, y, z] if x == y && y == z => x.as_f64(),
            _ => None,
        },
        value => value.as_f64(),
    };
    match one {
        Some(scale) if (Lattice { scale: [scale; 3], offset: [0.0; 3] }).is_valid() => Ok(scale),
        _ => broken(format!("scale is {value}, not one number greater than 0")),
    }
}

fn attributes(value: Option<Value>) -> Result<(NodeFiles, Vec<PointAttribute>), Fault> {
    let list = match value {
        Some(Value::String(word)) if word.eq_ignore_ascii_case("LAS") => return Ok((NodeFiles::Las, Vec::new())),
        Some(Value::String(word)) if word.eq_ignore_ascii_case("LAZ") => return Ok((NodeFiles::Laz, Vec::new())),
        Some(Value::String(word)) => return unsupported(format!("pointAttributes \"{word}\"; LAS and LAZ are read")),
        Some(Value::Array(list)) => list,
        _ => return broken("pointAttributes is missing or not an array"),
    };
    let mut attributes = Vec::new();
    for (index, value) in list.into_iter().enumerate() {
        attributes.push(match value {
            Value::String(word) => named(&word)?,
            value => object(value, index)?,
        });
    }
    check(&attributes)?;
    Ok((NodeFiles::Bin, attributes))
}

/// Just one position, and no column twice.
fn check(attributes: &[PointAttribute]) -> Result<(), Fault> {
    let positions = attributes.iter().filter(|a| a.field == Field::Position).count();
    if positions != 1 {
        return broken(format!("pointAttributes has {positions} times POSITION_CARTESIAN"));
    }
    let mut names = HashSet::new();
    let columns = attributes.iter().flat_map(PointAttribute::columns);
    for Attribute { name, .. } in columns {
        if !names.insert(name.clone()) {
            return broken(format!("two of pointAttributes are \"{name}\""));
        }
    }
    Ok(())
}

/// An attribute of version 1.7 and older. What is not known has bytes that are not known either.
fn named(word: &str) -> Result<PointAttribute, Fault> {
    match Field::from_word(word) {
        Some(field) => Ok(PointAttribute::new(field, word)),
        None => unsupported(format!("the attribute \"{word}\", of which it is not known how many bytes it has")),
    }
}

fn object(value: Value, index: usize) -> Result<PointAttribute, Fault> {
    let place = format!("pointAttributes[{index}].");
    let Value::Object(mut map) = value else { return broken(format!("pointAttributes[{index}] is no object or word")) };
    let mut fields = Fields { map: &mut map, place: &place };
    let name = fields.text("name")?;
    if name.is_empty() {
        return broken(format!("{place}name is missing"));
    }
    let word = fields.text("type")?;
    let Some(ty) = AttributeType::from_potree_name(&word) else {
        return unsupported(format!("attribute \"{name}\" has the type \"{word}\""));
    };
    let elements = fields.integer("elements")?;
    if !(1..=MAX_ELEMENTS).contains(&elements) {
        return broken(format!("attribute \"{name}\" has elements {elements}"));
    }
    let field = Field::from_object_name(&name);
    let (elements, description) = (elements as usize, fields.text("description")?);
    let attribute = PointAttribute { field, name, ty, elements, description };
    let name = &attribute.name;
    for (key, expected) in [("elementSize", ty.size()), ("size", attribute.size())] {
        let found = fields.integer(key)?;
        if found != expected as u64 {
            return broken(format!(
                "attribute \"{name}\" is {word} x {elements}, so its {key} is {expected}, not {found}"
            ));
        }
    }
    if !attribute.is_sound() {
        return unsupported(format!("attribute \"{name}\" as {word} x {elements}"));
    }
    Ok(attribute)
}

fn nodes(value: Value) -> Result<Vec<(NodeKey, u64)>, Fault> {
    let Value::Array(list) = value else { return broken("hierarchy is not an array") };
    let mut nodes = Vec::with_capacity(list.len());
    for (index, value) in list.iter().enumerate() {
        let name = value[0].as_str().and_then(NodeKey::from_name);
        match name.zip(value[1].as_u64()) {
            Some(node) => nodes.push(node),
            None => return broken(format!("hierarchy[{index}] is not the name of a node and its points")),
        }
    }
    Ok(nodes)
}
