//! Rows of text whose numbers are known in advance: as a rule one on each line, but that is only a habit of writers.

use std::cell::Cell;

use super::lines::{self, is_filled};
use super::scan::{LineRule, Storage};
use super::stream::{self, RowShape, Rows};
use crate::scan::source::Source;
use crate::{Advice, Piece, ReadError};

/// Lines at the start that are all looked at.
const CHECKED: u64 = 1024;
/// Of the others, one of so many: to count the numbers of every line would cost more than to find its end.
const CHECKED_OF: u64 = 61;

/// The points and how to read them.
pub(crate) struct TextRows {
    pub(crate) pieces: Vec<Piece>,
    pub(crate) rows: u64,
    /// Where the line behind the last row starts.
    pub(crate) end: u64,
    pub(crate) storage: Storage,
}

/// Finds `points`, which stand between the rows `before` and `after`, from byte `from` on.
///
/// Each row is expected on a line of its own, one for which `is_row` says so. Where a sample shows others, the text is a stream of numbers, if it can be
/// one; else lines stay rows, and their decode says what is wrong with them.
pub(crate) fn place(
    source: &Source,
    from: u64,
    is_row: fn(&[u8]) -> bool,
    before: &[Rows],
    points: &Rows,
    after: &[Rows],
) -> Result<TextRows, ReadError> {
    let sample = Sample { is_row, lines: Cell::new(0), is_lined: Cell::new(true) };
    let lined = by_lines(source, from, before, points, &sample);
    let is_broken = |e: &ReadError| !e.is_io();
    if sample.is_lined.get() && !lined.as_ref().is_err_and(is_broken) {
        return lined;
    }
    let Some(stream) = stream::index(source, from, before, points, after)? else { return lined };
    let declared = [before, std::slice::from_ref(points), after].concat();
    if !stream.is_whole && line_count(source, from) == declared.iter().map(|r| r.count).fold(0, u64::saturating_add) {
        // as many lines as rows: numbers are missing in the lines, not line ends
        return lined;
    }
    let stream::Stream { pieces, rows, end, .. } = stream;
    Ok(TextRows { pieces, rows, end, storage: Storage::Stream })
}

fn by_lines(
    source: &Source,
    from: u64,
    before: &[Rows],
    points: &Rows,
    sample: &Sample,
) -> Result<TextRows, ReadError> {
    let mut at = from;
    for rows in before.iter().filter(|r| !r.shape.0.is_empty()) {
        let index = lines::index(source, at, rows.count, |line| sample.counts(line, &rows.shape))?;
        if index.rows < rows.count {
            let (missing, count) = (rows.count - index.rows, rows.count);
            let what = format!("{missing} of {count} lines before the vertices are missing");
            return Err(ReadError::broken(source.path(), index.end, what).advise(Advice::CutShort));
        }
        at = index.end;
    }
    let index = lines::index(source, at, points.count, |line| sample.counts(line, &points.shape))?;
    let storage = Storage::Lines(LineRule::new(None, sample.is_row));
    Ok(TextRows { pieces: index.pieces, rows: index.rows, end: index.end, storage })
}

/// Lines that hold anything; 0 where they cannot be counted.
fn line_count(source: &Source, from: u64) -> u64 {
    lines::index(source, from, u64::MAX, is_filled).map_or(0, |index| index.rows)
}

/// Whether lines are rows, by some of them.
struct Sample {
    is_row: fn(&[u8]) -> bool,
    lines: Cell<u64>,
    is_lined: Cell<bool>,
}

impl Sample {
    fn counts(&self, line: &[u8], shape: &RowShape) -> bool {
        let filled = (self.is_row)(line);
        let number = self.lines.get();
        self.lines.set(number + u64::from(filled));
        if filled && (number < CHECKED || number.is_multiple_of(CHECKED_OF)) && !shape.is_line(line) {
            self.is_lined.set(false);
        }
        filled
    }
}
