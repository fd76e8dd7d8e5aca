//! Everything in `index.json` but the shape of the tree. The reader tolerates more than the page allows.

use std::fmt;
use std::io::{BufRead, BufReader};
use std::path::Path;

use pointmill_format::ReadError;
use pointmill_format::bintree::{CORE_BYTES, Header, INDEX_FILE};
use pointmill_format::bytes::open_file;
use serde::Deserialize;
use serde::de::{DeserializeSeed, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::Value;

use super::tree::Tree;
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Every key in the order of the page; the last is the tree, in its flat form.
const KEYS: [&str; 15] = [
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
    "nodes",
];

/// Checks the index that `tree` was read from. False if it does not state the lattice.
///
/// # Errors
/// The file cannot be read.
pub(super) fn check(folder: &Path, tree: &Tree<'_>, findings: &Findings) -> Result<bool, ReadError> {
    findings.checked(Check::Index, 1);
    let header = tree.header();
    let Some(head) = read(folder, tree, findings)? else {
        findings.note(Check::Index, "keys were not looked at: values are nested too deep");
        return Ok(true);
    };
    for missing in KEYS.iter().filter(|key| **key != "nodes" && head.get(key).is_none()) {
        findings.push(Finding::new(Check::Index, *missing, "a value", Value::Null));
    }
    let known: Vec<&str> = head.keys.iter().map(|(k, _)| k.as_str()).filter_map(in_flat_form).collect();
    let in_order: Vec<&str> = KEYS.into_iter().filter(|k| known.contains(k)).collect();
    let last = head.keys.last().and_then(|(k, _)| in_flat_form(k));
    if known != in_order || (last != Some("nodes") && !tree.nodes().is_empty()) {
        findings.push(Finding::new(Check::Index, "order of keys", KEYS.join(", "), known.join(", ")));
    }
    check_origin(&head, tree, findings);
    check_columns(header, findings);
    if header.capacity == 0 {
        findings.push(Finding::new(Check::Index, "capacity", "at least 1", 0));
    }
    Ok(head.get("lattice").is_some())
}

/// The key as one of [`KEYS`]; others are free.
fn in_flat_form(key: &str) -> Option<&'static str> {
    let key = if key == "root" { "nodes" } else { key };
    KEYS.into_iter().find(|k| *k == key)
}

/// The origin is in whole units and at the low corner of the cloud.
fn check_origin(head: &Head, tree: &Tree<'_>, findings: &Findings) {
    if head.get("origin").is_none() {
        return;
    }
    let origin = tree.header().origin;
    let near = tree.nodes().first().map_or([0.0; 3], |root| root.bounds.min.map(f64::floor));
    if origin.iter().any(|v| v.fract() != 0.0) {
        findings.push(Finding::new(Check::Index, "origin", "whole units", origin.to_vec()));
    } else if origin != near {
        findings.push(Finding::new(Check::Index, "origin", near.to_vec(), origin.to_vec()).warning());
    }
}

/// Each column stands at the next multiple of its element's size, and the stride is the least there is.
fn check_columns(header: &Header, findings: &Findings) {
    let (mut end, mut widest) = (CORE_BYTES, 4);
    for extra in header.record.extras() {
        let size = extra.attribute.ty.size();
        let expected = end.next_multiple_of(size);
        if extra.offset != expected {
            let subject = format!("offset of {}", extra.attribute.name);
            findings.push(Finding::new(Check::Index, subject, expected, extra.offset));
        }
        end = extra.offset + extra.attribute.size();
        widest = widest.max(size);
    }
    let expected = end.next_multiple_of(widest);
    if header.record.stride() != expected {
        findings.push(Finding::new(Check::Index, "stride", expected, header.record.stride()));
    }
}

/// Keys in their order, with the values of those that are looked at.
#[derive(Default)]
struct Head {
    keys: Vec<(String, Value)>,
}

impl Head {
    fn get(&self, key: &str) -> Option<&Value> {
        self.keys.iter().find(|(k, _)| k == key).map(|(_, value)| value)
    }
}

/// Reads the index as JSON, node by node; `None` if that cannot be done, though the reader could.
fn read(folder: &Path, tree: &Tree<'_>, findings: &Findings) -> Result<Option<Head>, ReadError> {
    let path = folder.join(INDEX_FILE);
    let io = |error| ReadError::io(&path, "reading", error);
    let mut file = BufReader::with_capacity(1 << 16, open_file(&path).map_err(io)?);
    if file.fill_buf().map_err(io)?.starts_with(b"\xef\xbb\xbf") {
        file.consume(3);
    }
    let mut json = serde_json::Deserializer::from_reader(file);
    match json.deserialize_map(HeadVisitor { tree, findings }) {
        Err(error) if error.is_io() => Err(io(error.into())),
        read => Ok(read.ok()),
    }
}

struct HeadVisitor<'a> {
    tree: &'a Tree<'a>,
    findings: &'a Findings,
}

impl<'de> Visitor<'de> for HeadVisitor<'_> {
    type Value = Head;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an index")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Head, A::Error> {
        let mut head = Head::default();
        while let Some(key) = map.next_key::<String>()? {
            let value = match key.as_str() {
                "nodes" => {
                    map.next_value_seed(NodesSeed { tree: self.tree, findings: self.findings })?;
                    Value::Null
                }
                "origin" | "lattice" => map.next_value()?,
                _ => {
                    map.next_value::<IgnoredAny>()?;
                    Value::Null
                }
            };
            head.keys.push((key, value));
        }
        Ok(head)
    }
}

/// The keys of a node that do not go together whatever the reader makes of them.
#[derive(Deserialize)]
struct NodeKeys {
    axis: Option<f64>,
    split: Option<IgnoredAny>,
    degenerate: Option<bool>,
    children: Option<IgnoredAny>,
    center: Option<IgnoredAny>,
}

impl NodeKeys {
    /// What the page requires of a node of this kind, unless it is met.
    fn fault(&self) -> Option<&'static str> {
        let is_split = self.axis.is_some() || self.split.is_some() || self.degenerate.is_some();
        match (&self.children, self.degenerate) {
            (None, _) if is_split => Some("a leaf without axis, split and degenerate"),
            (Some(_), _) if self.center.is_some() => Some("an inner node without center"),
            (Some(_), Some(true)) if self.axis != Some(-1.0) => Some("a degenerate node with axis -1"),
            (Some(_), Some(true)) if self.split.is_some() => Some("a degenerate node without split"),
            (Some(_), Some(false)) => Some("no key degenerate where a node is not"),
            _ => None,
        }
    }
}

struct NodesSeed<'a> {
    tree: &'a Tree<'a>,
    findings: &'a Findings,
}

impl<'de> DeserializeSeed<'de> for NodesSeed<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, nodes: D) -> Result<(), D::Error> {
        nodes.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for NodesSeed<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("nodes")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut nodes: A) -> Result<(), A::Error> {
        let mut index = 0;
        while let Some(node) = nodes.next_element::<NodeKeys>()? {
            if let Some(expected) = node.fault() {
                let finding = Finding::new(Check::Index, "keys of a node", expected, "others");
                self.findings.push(finding.at(self.tree.place(index)));
            }
            index += 1;
        }
        Ok(())
    }
}
