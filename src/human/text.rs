//! The words and the table that all commands share.

use std::fmt::Write as _;
use std::path::Path;

use pointmill_converter::ResolvedCrs;
use pointmill_format::{Attribute, Unit};

use super::quantities::{count, number, numbers};
use crate::printable::printable;

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

/// The unit of x and y, and of z, as far as they are known: "US survey foot; of heights: metre".
pub(crate) fn units(crs: &ResolvedCrs) -> String {
    let known = |unit: Option<Unit>| unit.map_or_else(|| "not known".to_owned(), |unit| unit.to_string());
    match (crs.unit, crs.vertical_unit) {
        (None, None) => known(None),
        (unit, None) => format!("{}; that of heights is not known", known(unit)),
        (unit, heights) if unit == heights => format!("{}, heights too", known(unit)),
        (unit, heights) => format!("{}; of heights: {}", known(unit), known(heights)),
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
        Self(printable(&path.to_string_lossy()).into_owned() + "\n")
    }

    /// Adds a line.
    pub(crate) fn row(&mut self, word: &str, text: impl AsRef<str>) {
        let _ = writeln!(self.0, "  {word:<13} {}", printable(text.as_ref()));
    }
}
