//! PTS: a count, then as many rows; that may repeat.

use std::cell::Cell;

use super::columns::Table;
use super::options::TextOptions;
use super::rows::{BOM, fields, is_count, is_data, is_number, separator};
use super::xyz::{named, wanted_separator};
use crate::scan::source::Source;
use crate::scan::tabular::{LineRule, lines, reconcile};
use crate::{Advice, ReadError, Scan, ScanWarning};

pub(super) fn open(source: Source, options: &TextOptions) -> Result<Box<dyn Scan>, ReadError> {
    let from = if source.vec_at(0, 3)? == BOM { 3 } else { 0 };
    let (declared, counts) = (Cell::new(0u64), Cell::new(0u64));
    let index = lines::index(&source, from, u64::MAX, |line| {
        if is_data(line) && is_count(line) {
            let count = std::str::from_utf8(line.trim_ascii()).ok().and_then(|t| t.parse().ok()).unwrap_or(u64::MAX);
            declared.set(declared.get().saturating_add(count));
            counts.set(counts.get() + 1);
        }
        is_row(line)
    })?;
    let mut warnings = Vec::new();
    let (declared, counts) = (declared.get(), counts.get());
    reconcile(declared, index.rows, &mut warnings);
    if index.rows > declared {
        let rows = index.rows;
        warnings.push(ScanWarning::PointsUndeclared { declared, found: rows });
    }
    let first = lines::first_filled(&source, from, 64)?;
    let Some((first_row, row)) = first.into_iter().find(|(_, line)| is_row(line)) else {
        return Err(ReadError::broken(source.path(), from, "there are no rows of points").advise(Advice::WrongFile));
    };
    let separator = wanted_separator(options).unwrap_or_else(|| separator(&row));
    let numeric: Vec<bool> = fields(&row, separator).iter().map(|f| is_number(f)).collect();
    let columns = named(&source, first_row, options, None, numeric.len())?;
    let scans = if counts > 1 { format!(", {counts} scans") } else { String::new() };
    let table = Table {
        format: format!("PTS, {} columns{scans}", numeric.len()),
        declared,
        pieces: index.pieces,
        rule: LineRule::new(separator, is_row),
        warnings,
        numeric,
        pts_intensity: true,
        first_row,
        source,
    };
    Ok(Box::new(table.scan(columns)?))
}

fn is_row(line: &[u8]) -> bool {
    is_data(line) && !is_count(line)
}
