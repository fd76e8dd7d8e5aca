//! Writes `index.json` node by node: no node is kept.

use std::io::Write;

use serde_json::Value;

use crate::WriteError;

use super::header::{FORMAT, VERSION};
use super::preorder::Preorder;
use super::{Header, Layout, Node, NodeKind, PlacedAttribute};

/// Writes an index: first [`Self::new`], then every node in preorder, then [`Self::finish`]. Needs memory for the path
/// to the current node only. Give it a buffered writer.
///
/// Nothing wrong is written: nodes that are not a tree in preorder, counts that do not add up and numbers that JSON does
/// not know are [`WriteError::Input`].
///
/// ```
/// use pointmill_format::bintree::{Bintree, IndexWriter};
/// use pointmill_format::bytes::Memory;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let tree = Bintree::open(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/bintree/files"))?;
/// let mut index = IndexWriter::new(Vec::new(), tree.header())?;
/// for node in tree.nodes() {
///     index.node(node)?;
/// }
/// let copy = Memory::from([("index.json".to_owned(), index.finish()?)]);
/// assert_eq!(Bintree::from_source(copy)?.nodes(), tree.nodes());
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
#[must_use = "the index is complete after `finish`"]
pub struct IndexWriter<W> {
    out: W,
    layout: Layout,
    points: u64,
    order: Preorder,
}

impl<W: Write> IndexWriter<W> {
    /// Writes all keys before `nodes`.
    ///
    /// # Errors
    /// What the writer says; a header with numbers that are not finite or scales that are not greater than 0.
    pub fn new(mut out: W, header: &Header) -> Result<Self, WriteError> {
        if !header.lattice.is_valid() || header.origin.iter().any(|v| !v.is_finite()) || header.capacity == 0 {
            return invalid(format!(
                "index.json cannot have the scales {:?}, the offsets {:?}, the origin {:?} or the capacity {}",
                header.lattice.scale, header.lattice.offset, header.origin, header.capacity
            ));
        }
        out.write_all(b"{\n")?;
        for (key, value) in fields(header) {
            writeln!(out, "\t\"{key}\": {value},")?;
        }
        out.write_all(b"\t\"nodes\": [")?;
        Ok(Self { out, layout: header.layout, points: header.points, order: Preorder::default() })
    }

    /// Index of the next node.
    pub fn next_index(&self) -> u32 {
        self.order.len()
    }

    /// The file of the next node in layout `files`, should it be a leaf.
    pub fn next_file_name(&self) -> String {
        self.order.file_name()
    }

    /// Writes the next node; the file name of a leaf follows from its place in the tree.
    ///
    /// # Errors
    /// What the writer says; a node that is not the next of a tree in preorder, or has a `start` where the layout has
    /// none, or none where it has one.
    pub fn node(&mut self, node: &Node) -> Result<(), WriteError> {
        let index = self.order.len();
        let file = if node.is_leaf() && self.layout == Layout::Files { self.order.file_name() } else { String::new() };
        self.order.push(node, Some(self.layout)).or_else(|fault| invalid(format!("node {index} {fault}")))?;
        if index == 0 && node.count != self.points {
            return invalid(format!("the root has {} points, the header says {}", node.count, self.points));
        }
        let start = if index == 0 { "\n" } else { ",\n" };
        let (min, max) = (numbers(&node.bounds.min), numbers(&node.bounds.max));
        write!(self.out, "{start}{{\"min\":{min},\"max\":{max},\"count\":{}", node.count)?;
        match node.kind {
            NodeKind::Inner { axis, split, high } => {
                let split = Value::from(split);
                write!(self.out, ",\"axis\":{axis},\"split\":{split},\"children\":[{},{high}]", index + 1)
            }
            NodeKind::Degenerate { high } => {
                write!(self.out, ",\"axis\":-1,\"degenerate\":true,\"children\":[{},{high}]", index + 1)
            }
            NodeKind::Leaf { center, start: Some(start) } => {
                write!(self.out, ",\"center\":{},\"start\":{start}", numbers(&center))
            }
            NodeKind::Leaf { center, start: None } => {
                write!(self.out, ",\"center\":{},\"file\":\"{file}\"", numbers(&center))
            }
        }?;
        Ok(self.out.write_all(b"}")?)
    }

    /// Writes the end and gives the writer back, flushed.
    ///
    /// # Errors
    /// What the writer says; nodes that are missing.
    pub fn finish(mut self) -> Result<W, WriteError> {
        self.order.finish().or_else(invalid)?;
        if self.order.len() == 0 && self.points > 0 {
            return invalid(format!("there are no nodes, the header says {} points", self.points));
        }
        self.out.write_all(if self.order.len() == 0 { b"]\n}\n" } else { b"\n\t]\n}\n" })?;
        self.out.flush()?;
        Ok(self.out)
    }
}

fn invalid<T>(what: impl Into<String>) -> Result<T, WriteError> {
    Err(WriteError::input(what))
}

/// The keys before `nodes` and their values as JSON, in order.
fn fields(h: &Header) -> [(&'static str, String); 14] {
    let text = |text: &str| Value::from(text).to_string();
    let columns: Vec<String> = h.record.columns().map(|column| column_json(&column)).collect();
    [
        ("format", text(FORMAT)),
        ("version", VERSION.to_string()),
        ("generator", text(&h.generator)),
        ("name", text(&h.name)),
        ("points", h.points.to_string()),
        ("capacity", h.capacity.to_string()),
        ("layout", text(h.layout.name())),
        ("split", text(h.split.name())),
        ("origin", numbers(&h.origin)),
        ("projection", text(&h.projection)),
        ("lattice", format!("{{\"scale\":{},\"offset\":{}}}", numbers(&h.lattice.scale), numbers(&h.lattice.offset))),
        ("pointmill", Value::from(h.pointmill.clone()).to_string()),
        ("attributes", format!("[{}]", columns.join(","))),
        ("stride", h.record.stride().to_string()),
    ]
}

fn column_json(column: &PlacedAttribute) -> String {
    let PlacedAttribute { attribute: a, offset } = column;
    let (name, ty) = (Value::from(a.name.as_str()), a.ty.potree_name());
    let mut json = format!("{{\"name\":{name},\"type\":\"{ty}\",\"elements\":{},\"offset\":{offset}", a.elements);
    if a.scale.iter().any(|s| *s != 1.0) || a.offset.iter().any(|o| *o != 0.0) {
        json += &format!(",\"scale\":{},\"shift\":{}", numbers(&a.scale), numbers(&a.offset));
    }
    json + "}"
}

/// An array of doubles, each as the shortest text that reads back. What JSON cannot say becomes 0: scales of extra bytes
/// come from files of others.
fn numbers(values: &[f64]) -> String {
    let number = |v: &f64| Value::from(if v.is_finite() { *v } else { 0.0 }).to_string();
    format!("[{}]", values.iter().map(number).collect::<Vec<_>>().join(","))
}
