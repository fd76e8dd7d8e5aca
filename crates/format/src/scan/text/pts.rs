//! PTS: a count, then as many rows; that may repeat. Titles may stand before or behind the first count.

use std::cell::Cell;

use super::head::Head;
use super::options::TextOptions;
use super::rows::{count, is_count, is_data};
use super::table::Table;
use crate::scan::source::Source;
use crate::scan::tabular::{lines, reconcile};
use crate::{ReadError, Scan, ScanWarning};

pub(super) fn open(source: Source, options: &TextOptions) -> Result<Box<dyn Scan>, ReadError> {
    let mut head = Head::read(&source, options, true)?;
    let columns = head.columns(&source, options)?;
    let (declared, counts) = (Cell::new(head.counts.0), Cell::new(head.counts.1));
    let index = lines::index(&source, head.start, u64::MAX, |line| {
        if is_data(line) && is_count(line) {
            declared.set(declared.get().saturating_add(count(line).unwrap_or(u64::MAX)));
            counts.set(counts.get() + 1);
        }
        is_row(line)
    })?;
    let (declared, counts) = (declared.get(), counts.get());
    let mut warnings = Vec::new();
    reconcile(declared, index.rows, &mut warnings);
    if index.rows > declared {
        warnings.push(ScanWarning::PointsUndeclared { declared, found: index.rows });
    }
    head.warnings.extend(warnings);
    let scans = if counts > 1 { format!(", {counts} scans") } else { String::new() };
    let mark = if head.dialect.has_decimal_commas() { ", decimal commas" } else { "" };
    let format = format!("PTS, {} columns{scans}{mark}", head.numeric.len());
    let table = Table { declared, pts_intensity: true, ..Table::new(source, format, head, index, is_row) };
    Ok(Box::new(table.scan(columns)?))
}

fn is_row(line: &[u8]) -> bool {
    is_data(line) && !is_count(line)
}
