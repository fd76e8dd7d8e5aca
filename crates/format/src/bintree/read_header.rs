//! The keys of `index.json` beside the nodes.

use std::collections::HashMap;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use crate::{Attribute, AttributeType, Lattice};

use super::header::{FORMAT, VERSION};
use super::json::{Fault, Json};
use super::{Header, PlacedAttribute, RecordLayout};

/// The values of header keys as text, and where they stand.
#[derive(Default)]
pub(super) struct HeaderText(HashMap<&'static str, (u64, Vec<u8>)>);

/// Every key of the header; others are skipped.
const KEYS: [&str; 14] = [
    "format",
    "version",
    "generator",
    "name",
    "points",
    "capacity",
    "layout",
    "split",
    "origin",
    "projection",
    "lattice",
    "pointmill",
    "attributes",
    "stride",
];

/// The key as one of ours.
pub(super) fn known_key(key: &str) -> Option<&'static str> {
    KEYS.into_iter().find(|k| *k == key)
}

#[derive(Deserialize)]
struct LatticeJson {
    scale: [f64; 3],
    offset: [f64; 3],
}

#[derive(Deserialize)]
struct ColumnJson {
    name: String,
    #[serde(rename = "type")]
    ty: String,
    elements: usize,
    offset: usize,
    scale: Option<Vec<f64>>,
    shift: Option<Vec<f64>>,
}

impl HeaderText {
    /// Takes the value of `key`, which comes next. What the file is, is checked at once: no gigabyte of something else
    /// is read to its end.
    pub(super) fn take(&mut self, key: &'static str, json: &mut Json) -> Result<(), Fault> {
        json.peek()?;
        let at = json.position();
        let text = json.value()?;
        if self.0.insert(key, (at, text)).is_some() {
            return Err(Fault::Broken(at, format!("the key {key} stands there twice")));
        }
        match key {
            "format" | "version" => self.check_kind(key),
            _ => Ok(()),
        }
    }

    fn check_kind(&self, key: &str) -> Result<(), Fault> {
        match self.0.get(key) {
            Some((at, text)) if key == "format" && text != format!("\"{FORMAT}\"").as_bytes() => {
                Err(Fault::Unsupported(*at, format!("the format is {}, not \"{FORMAT}\"", shown(text))))
            }
            Some((at, text)) if key == "version" && text != VERSION.to_string().as_bytes() => Err(Fault::Unsupported(
                *at,
                format!("the version is {}; {VERSION} is the one that is read", shown(text)),
            )),
            Some(_) => Ok(()),
            None => Err(Fault::Broken(0, format!("the key {key} is missing: this is no index of a binary tree"))),
        }
    }

    pub(super) fn parse(self) -> Result<Header, Fault> {
        self.check_kind("format")?;
        self.check_kind("version")?;
        let word = |key| self.required::<String>(key, "a string");
        let layout = word("layout")?.parse().ok();
        let split = word("split")?.parse().ok();
        let header = Header {
            generator: self.optional("generator", "a string")?.unwrap_or_default(),
            name: self.optional("name", "a string")?.unwrap_or_default(),
            points: self.required("points", "a whole number")?,
            capacity: self.required("capacity", "a whole number")?,
            layout: layout.map_or_else(|| self.wrong("layout", "\"files\" or \"packed\""), Ok)?,
            split: split.map_or_else(|| self.wrong("split", "\"mean\", \"median\" or \"midpoint\""), Ok)?,
            origin: self.optional("origin", "three numbers")?.unwrap_or_default(),
            projection: self.optional("projection", "a string")?.unwrap_or_default(),
            lattice: self.lattice()?,
            pointmill: self.optional::<Map<String, Value>>("pointmill", "an object")?.unwrap_or_default(),
            record: self.record()?,
        };
        if header.capacity == 0 {
            return self.wrong("capacity", "at least 1");
        }
        Ok(header)
    }

    /// Where the value of `key` stands; the start of the file if it is not there.
    pub(super) fn place(&self, key: &str) -> u64 {
        self.0.get(key).map_or(0, |(at, _)| *at)
    }

    fn lattice(&self) -> Result<Lattice, Fault> {
        let found = self.optional("lattice", "an object with a scale and an offset, three numbers each")?;
        let LatticeJson { scale, offset } = found.unwrap_or(LatticeJson { scale: [1.0; 3], offset: [0.0; 3] });
        let lattice = Lattice { scale, offset };
        if lattice.is_valid() { Ok(lattice) } else { self.wrong("lattice", "of scales greater than 0") }
    }

    fn record(&self) -> Result<RecordLayout, Fault> {
        let expected = "an array of objects with name, type, elements and offset";
        let columns: Vec<ColumnJson> = self.required("attributes", expected)?;
        let stride: usize = self.required("stride", "a whole number")?;
        let broken = |what: String| Fault::Broken(self.place("attributes"), what);
        let core = columns.iter().map(|c| (c.name.as_str(), c.ty.as_str(), c.elements, c.offset)).take(4);
        if !core.eq(["x", "y", "z", "classification"].into_iter().zip([0, 4, 8, 12]).map(|(n, o)| (n, "float", 1, o))) {
            let what = "the first four attributes have to be x, y, z and classification: floats at 0, 4, 8 and 12";
            return Err(broken(what.into()));
        }
        let extras = columns.into_iter().skip(4).map(placed).collect::<Result<Vec<_>, Fault>>();
        let extras = extras.map_err(|fault| fault.at(self.place("attributes")))?;
        RecordLayout::from_places(extras, stride).map_err(broken)
    }

    fn required<T: DeserializeOwned>(&self, key: &'static str, expected: &str) -> Result<T, Fault> {
        let missing = || Fault::Broken(0, format!("the key {key} is missing"));
        self.optional(key, expected)?.ok_or_else(missing)
    }

    fn optional<T: DeserializeOwned>(&self, key: &'static str, expected: &str) -> Result<Option<T>, Fault> {
        match self.0.get(key).map(|(_, text)| serde_json::from_slice(text)) {
            None => Ok(None),
            Some(Ok(value)) => Ok(Some(value)),
            Some(Err(_)) => self.wrong(key, expected),
        }
    }

    fn wrong<T>(&self, key: &'static str, expected: &str) -> Result<T, Fault> {
        let (at, text) = self.0.get(key).map_or((0, &[][..]), |(at, text)| (*at, text.as_slice()));
        Err(Fault::Broken(at, format!("{key} is {}, it has to be {expected}", shown(text))))
    }
}

fn placed(column: ColumnJson) -> Result<PlacedAttribute, Fault> {
    let ColumnJson { name, ty, elements, offset, scale, shift } = column;
    let Some(known) = AttributeType::from_potree_name(&ty) else {
        return Err(Fault::Unsupported(0, format!("the attribute \"{name}\" has the type \"{ty}\"")));
    };
    for (key, values) in [("scale", &scale), ("shift", &shift)] {
        if values.as_ref().is_some_and(|v| v.len() != elements) {
            return Err(Fault::Broken(
                0,
                format!("the attribute \"{name}\" has {elements} elements, its {key} has not"),
            ));
        }
    }
    // Elements are checked with the places; until then nothing of that size is made.
    let mut attribute = Attribute::new(name, known, 0);
    attribute.elements = elements;
    let of = |values: Option<Vec<f64>>, default| values.unwrap_or_else(|| vec![default; elements.min(256)]);
    (attribute.scale, attribute.offset) = (of(scale, 1.0), of(shift, 0.0));
    Ok(PlacedAttribute { attribute, offset })
}

/// The beginning of a text, on one line.
fn shown(text: &[u8]) -> String {
    let mut shown: String =
        String::from_utf8_lossy(text).chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
    if let Some((end, _)) = shown.char_indices().nth(40) {
        shown.truncate(end);
        shown.push('…');
    }
    shown
}
