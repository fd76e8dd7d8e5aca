//! Lines of numbers without more order than that.

use super::columns::{Column, Table};
use super::options::TextOptions;
use super::rows::{BOM, fields, is_comment, is_data, is_number, separator};
use crate::scan::source::Source;
use crate::scan::tabular::{LineRule, Role, lines};
use crate::{Advice, ReadError, Scan};

/// Lines before the first row that are looked at.
const MAX_HEAD: usize = 1000;

/// What stands before the rows.
pub(super) struct Head {
    /// Names that a header line gives.
    names: Option<Vec<String>>,
    /// Where the first row starts.
    start: u64,
    separator: Option<u8>,
    /// For each field of the first row, whether it is a number.
    numeric: Vec<bool>,
}

pub(super) fn open(source: Source, options: &TextOptions) -> Result<Box<dyn Scan>, ReadError> {
    let head = Head::read(&source, options)?;
    let index = lines::index(&source, head.start, u64::MAX, is_data)?;
    let kind = match head.separator {
        Some(b',') => "separated by commas",
        Some(b';') => "separated by semicolons",
        Some(_) => "with separators",
        None => "separated by blanks",
    };
    let columns = head.columns(&source, options)?;
    let table = Table {
        format: format!("text, {} columns {kind}", head.numeric.len()),
        declared: index.rows,
        pieces: index.pieces,
        rule: LineRule::new(head.separator, is_data),
        warnings: Vec::new(),
        numeric: head.numeric,
        pts_intensity: false,
        first_row: head.start,
        source,
    };
    Ok(Box::new(table.scan(columns)?))
}

impl Head {
    fn read(source: &Source, options: &TextOptions) -> Result<Self, ReadError> {
        let from = if source.vec_at(0, 3)? == BOM { 3 } else { 0 };
        let lines = lines::first_filled(source, from, MAX_HEAD)?;
        let data: Vec<_> = lines.iter().filter(|(_, line)| is_data(line)).collect();
        let none = || ReadError::broken(source.path(), from, "there are no lines of numbers").advise(Advice::WrongFile);
        let (mut at, mut row) = data.first().map(|(at, line)| (*at, line)).ok_or_else(none)?;
        let mut separator = wanted_separator(options).unwrap_or_else(|| separator(row));
        let comment = lines.iter().rev().find(|(place, line)| *place < at && is_comment(line)).map(|(_, line)| line);
        let mut names = comment.and_then(|line| comment_names(line));
        let first = fields(row, separator);
        if first.first().is_some_and(|f| !is_number(f)) {
            names = Some(header_names(row, separator));
            (at, row) = data.get(1).map(|(at, line)| (*at, line)).ok_or_else(none)?;
            separator = wanted_separator(options).unwrap_or_else(|| super::rows::separator(row));
        }
        let numeric: Vec<bool> = fields(row, separator).iter().map(|f| is_number(f)).collect();
        if numeric.iter().filter(|n| **n).count() < 2 {
            let what = format!("the line {:?} is no row of numbers", shown(row));
            return Err(ReadError::broken(source.path(), at, what)
                .advise("only one header line is skipped; delete the others or start them with #"));
        }
        Ok(Self { names, start: at, separator, numeric })
    }

    /// The columns by name: as given, else by the header.
    pub(super) fn columns(&self, source: &Source, options: &TextOptions) -> Result<Option<Vec<Column>>, ReadError> {
        named(source, self.start, options, self.names.as_deref(), self.numeric.len())
    }
}

/// `options`' columns, else those of `header`, if these name x and y.
pub(super) fn named(
    source: &Source,
    at: u64,
    options: &TextOptions,
    header: Option<&[String]>,
    count: usize,
) -> Result<Option<Vec<Column>>, ReadError> {
    let list = |names: &[String]| -> Result<Vec<Column>, ReadError> {
        let columns: Result<Vec<_>, String> = names.iter().map(|n| Column::named(n)).collect();
        let columns = columns.map_err(|what| ReadError::unsupported(source.path(), what))?;
        if columns.len() == count {
            return Ok(columns);
        }
        let shown: String = names.join(", ").chars().take(100).collect();
        let what = format!("{} columns are named ({shown}) but the row has {count}", columns.len());
        Err(ReadError::broken(source.path(), at, what).advise("name every column in order, - for those to leave out"))
    };
    if let Some(names) = &options.columns {
        return list(names).map(Some);
    }
    let Some(names) = header else { return Ok(None) };
    // a colon in a header is part of the name
    let names: Vec<_> = names.iter().map(|n| n.replace(':', " ")).collect();
    list(&names).map(Some)
}

/// The separator given; `Some(None)` means blanks.
pub(super) fn wanted_separator(options: &TextOptions) -> Option<Option<u8>> {
    let wanted = options.separator?;
    Some(u8::try_from(wanted).ok().filter(|b| *b > b' '))
}

/// The names of a header line; they may have blanks where tabs or separators stand between them.
fn header_names(line: &[u8], separator: Option<u8>) -> Vec<String> {
    let name = |f: &[u8]| String::from_utf8_lossy(f).trim().trim_matches('"').to_owned();
    match separator.or_else(|| line.contains(&b'\t').then_some(b'\t')) {
        Some(s) => line.trim_ascii_end().split(|b| *b == s).map(name).collect(),
        None => fields(line, None).into_iter().map(name).collect(),
    }
}

/// The names in a comment, if x and y are among them.
fn comment_names(line: &[u8]) -> Option<Vec<String>> {
    let text = line.trim_ascii().trim_ascii_start();
    let bare: Vec<u8> = text.iter().copied().skip_while(|b| matches!(b, b'#' | b'/' | b'%' | b' ')).collect();
    let names = header_names(&bare, separator(&bare));
    let has = |axis: usize| names.iter().any(|n| Column::named(n).is_ok_and(|c| c.role == Role::Axis(axis)));
    (has(0) && has(1)).then_some(names)
}

fn shown(line: &[u8]) -> String {
    String::from_utf8_lossy(line).chars().take(40).collect()
}
