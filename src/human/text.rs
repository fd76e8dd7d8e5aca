//! The words and the table that all commands share.

use std::fmt::Write as _;
use std::path::Path;

use pointmill_format::{Attribute, Crs};

use super::quantities::{count, number, numbers};

/// "1 batch", "7 batches".
pub(crate) fn batches(n: u64) -> String {
    if n == 1 { "1 batch".to_owned() } else { format!("{} batches", count(n)) }
}

/// A column: its name, type, and range where it is known.
pub(crate) fn attribute_line(attribute: &Attribute, ranges: Option<&[[f64; 2]]>) -> String {
    let times = if attribute.elements > 1 { format!(" × {}", attribute.elements) } else { String::new() };
    let mut line = format!("{:<22} {}{times}", attribute.name, attribute.ty.potree_name());
    if attribute.scale.iter().any(|s| *s != 1.0) || attribute.offset.iter().any(|o| *o != 0.0) {
        let _ = write!(line, " · {} + {}", numbers(&attribute.scale), numbers(&attribute.offset));
    }
    if let Some(no_data) = &attribute.no_data {
        let _ = write!(line, ", {} means no data", numbers(no_data));
    }
    for [min, max] in ranges.unwrap_or_default().iter().filter(|r| r[0] <= r[1]) {
        let _ = write!(line, ", {} to {}", number(*min), number(*max));
    }
    line
}

/// The coordinate reference system in a few words.
pub(crate) fn crs(crs: &Crs) -> String {
    let codes = [crs.epsg, crs.vertical_epsg].into_iter().flatten().map(|code| format!("EPSG:{code}"));
    let codes = codes.collect::<Vec<_>>().join(" + ");
    let name = crs.wkt.as_deref().map(|wkt| wkt.split('"').nth(1).unwrap_or("no name"));
    match name {
        Some(name) if codes.is_empty() => format!("WKT {name}"),
        Some(name) => format!("WKT {name}, {codes}"),
        None => or_none(&codes).to_owned(),
    }
}

/// Lower and upper corner of a box.
pub(crate) fn corners(min: &[f64], max: &[f64]) -> String {
    format!("{} … {}", numbers(min), numbers(max))
}

pub(crate) fn or_none(text: &str) -> &str {
    if text.is_empty() { "no CRS" } else { text }
}

/// Lines of a label and a text.
#[derive(Default)]
pub(crate) struct Table(pub(crate) String);

impl Table {
    /// A table about a file or folder.
    pub(crate) fn about(path: &Path) -> Self {
        Self(printable(&path.to_string_lossy()) + "\n")
    }

    /// Adds a line.
    pub(crate) fn row(&mut self, word: &str, text: impl AsRef<str>) {
        let _ = writeln!(self.0, "  {word:<13} {}", printable(text.as_ref()));
    }
}

/// Replaces control characters from a file (a CRS, an attribute name), so that they never reach the terminal.
pub(super) fn printable(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
