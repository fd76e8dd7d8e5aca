//! Text to pieces: one pass over the newlines, so that every piece knows the number of its first point.

use memchr::{memchr, memchr_iter, memchr2, memrchr};

use crate::scan::source::Source;
use crate::{Piece, ReadError};

/// Bytes of a piece: large beside the cost of a task, small beside the memory of a job.
pub(crate) const PIECE_BYTES: u64 = 8 << 20;
/// Bytes that are read at once while counting, and the longest line.
pub(super) const WINDOW: u64 = 1 << 20;
/// Lines at the start of a text are held up to so many bytes together.
const MAX_FIRST: usize = 1 << 20;
/// Bytes that are read first: a file may have very many small headers.
const FIRST_WINDOW: u64 = 4 << 10;

/// The rows of a part of a file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Index {
    pub(crate) pieces: Vec<Piece>,
    pub(crate) rows: u64,
    /// Where the line behind the last row starts.
    pub(crate) end: u64,
}

/// True if the line holds more than blanks.
pub(crate) fn is_filled(line: &[u8]) -> bool {
    // mostly the first byte decides
    line.first().is_some_and(|b| *b > b' ') || line.iter().any(|b| *b > b' ')
}

/// Bytes that show how lines end.
pub(super) const END_BYTES: usize = 4 << 10;

/// The last byte of each line: CR where most of the first lines end with it alone (old Macintosh), else LF.
pub(crate) fn line_end(bytes: &[u8]) -> u8 {
    let first = memchr2(b'\r', b'\n', bytes).unwrap_or(0);
    let head = &bytes[first..bytes.len().min(first + END_BYTES)];
    let is_alone = |at: &usize| head.get(at + 1).is_none_or(|next| *next != b'\n');
    let alone = memchr_iter(b'\r', head).filter(is_alone).count();
    if alone > memchr_iter(b'\n', head).count() { b'\r' } else { b'\n' }
}

/// Without the line end (LF, CR LF or CR).
pub(crate) fn trim_end(line: &[u8]) -> &[u8] {
    let line = line.strip_suffix(b"\n").unwrap_or(line);
    line.strip_suffix(b"\r").unwrap_or(line)
}

/// Walks lines from byte `from` on, with their places; stops early where `visit` says `false`.
///
/// Returns where it stopped: behind the last line, or at the start of the one that was refused.
pub(crate) fn walk(
    source: &Source,
    from: u64,
    mut visit: impl FnMut(u64, &[u8]) -> Result<bool, ReadError>,
) -> Result<u64, ReadError> {
    let (mut at, mut buf, mut size, mut known) = (from, Vec::new(), FIRST_WINDOW, None);
    while at < source.len() {
        let window = source.slice_at(at, size.min(source.len() - at), &mut buf)?;
        let is_last = at + window.len() as u64 == source.len();
        let line_end = known.unwrap_or_else(|| line_end(window));
        let whole = match memrchr(line_end, window) {
            _ if is_last => window.len(),
            Some(newline) => newline + 1,
            None if size < WINDOW => {
                size = WINDOW;
                continue;
            }
            None => return Err(endless_line(source, at)),
        };
        known = Some(line_end);
        size = (size * 4).min(WINDOW);
        let mut start = 0;
        let ends = memchr_iter(line_end, &window[..whole]).map(|n| n + 1);
        for end in ends.chain((is_last && !window.ends_with(&[line_end])).then_some(whole)) {
            if !visit(at + start as u64, trim_end(&window[start..end]))? {
                return Ok(at + start as u64);
            }
            start = end;
        }
        at += whole as u64;
    }
    Ok(at)
}

/// Counts the rows from byte `from` on and cuts them into pieces that number from 0.
/// A line is a row if `is_row` says so; the others are skipped. Stops before row `limit`.
pub(crate) fn index(
    source: &Source,
    from: u64,
    limit: u64,
    is_row: impl Fn(&[u8]) -> bool,
) -> Result<Index, ReadError> {
    let mut cutter = Cutter::new(from, 0);
    let mut rows = 0;
    let end = walk(source, from, |at, line| {
        if rows == limit {
            return Ok(false);
        }
        let row = is_row(line);
        cutter.line(at, row);
        rows += u64::from(row);
        Ok(true)
    })?;
    Ok(Index { pieces: cutter.finish(end), rows, end })
}

/// Passes over `count` filled lines from byte `from` on; returns where the next one starts and how many were missing.
pub(crate) fn skip(source: &Source, from: u64, count: u64) -> Result<(u64, u64), ReadError> {
    let mut left = count;
    let end = walk(source, from, |_, line| {
        let go_on = left > 0;
        left -= u64::from(go_on && is_filled(line));
        Ok(go_on)
    })?;
    Ok((end, left))
}

/// The first `count` lines that are not blank, with their places; fewer if they are very long.
pub(crate) fn first_filled(source: &Source, from: u64, count: usize) -> Result<Vec<(u64, Vec<u8>)>, ReadError> {
    let (mut lines, mut bytes) = (Vec::new(), 0);
    walk(source, from, |at, line| {
        if is_filled(line) && lines.len() < count {
            lines.push((at, line.to_vec()));
            bytes += line.len();
        }
        Ok(lines.len() < count && bytes < MAX_FIRST)
    })?;
    Ok(lines)
}

/// Cuts lines into pieces as they pass by.
pub(crate) struct Cutter {
    pieces: Vec<Piece>,
    next: u64,
    /// Where the open piece starts, and its rows.
    from: u64,
    count: u64,
}

impl Cutter {
    /// Pieces from byte `from` on, numbering from `first_point`.
    pub(crate) fn new(from: u64, first_point: u64) -> Self {
        Self { pieces: Vec::new(), next: first_point, from, count: 0 }
    }

    /// A line that starts at byte `at`, and whether it is a point.
    pub(crate) fn line(&mut self, at: u64, is_row: bool) {
        if at - self.from >= PIECE_BYTES {
            self.cut(at);
        }
        self.count += u64::from(is_row);
    }

    /// The pieces; the last line ends before byte `end`.
    pub(crate) fn finish(mut self, end: u64) -> Vec<Piece> {
        self.cut(end);
        self.pieces
    }

    fn cut(&mut self, at: u64) {
        if self.count > 0 {
            let Self { next: first_point, from: byte_offset, count: points, .. } = *self;
            self.pieces.push(Piece { first_point, points, byte_offset, byte_len: at - byte_offset });
        }
        self.next += self.count;
        self.count = 0;
        self.from = at;
    }
}

/// The lines of `bytes`, each with its place and without its line end.
pub(crate) fn lines(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let (mut start, line_end) = (0, line_end(bytes));
    std::iter::from_fn(move || {
        let rest = bytes.get(start..).filter(|r| !r.is_empty())?;
        let end = memchr(line_end, rest).map_or(rest.len(), |n| n + 1);
        let line = (start, trim_end(&rest[..end]));
        start += end;
        Some(line)
    })
}

pub(super) fn endless_line(source: &Source, at: u64) -> ReadError {
    ReadError::broken(source.path(), at, format!("a line of more than {WINDOW} bytes starts here"))
        .advise("this is no text of points, or its line ends are lost; export it again")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(bytes: &[u8]) -> Source {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        Source::open(file.path()).unwrap()
    }

    #[test]
    fn blank_lines_and_both_line_ends_are_no_rows_and_the_last_needs_none() {
        let text = b"1\r\n\r\n2\n  \n3";
        let index = index(&source(text), 0, u64::MAX, is_filled).unwrap();
        assert_eq!((index.rows, index.end), (3, text.len() as u64));
        assert_eq!(index.pieces, [Piece { first_point: 0, points: 3, byte_offset: 0, byte_len: text.len() as u64 }]);
        assert_eq!(lines(text).map(|(_, l)| l.len()).collect::<Vec<_>>(), [1, 0, 1, 2, 1]);
    }

    #[test]
    fn lines_may_end_with_cr_alone() {
        let text = b"1 2\r3 4\r\r5 6";
        let found: Vec<_> = lines(text).map(|(at, line)| (at, line.len())).collect();
        assert_eq!(found, [(0, 3), (4, 3), (8, 0), (9, 3)]);
        assert_eq!(index(&source(text), 0, u64::MAX, is_filled).unwrap().rows, 3);
        let long = [b"1".repeat(5000), b"\r2\r".to_vec()].concat();
        assert_eq!(index(&source(&long), 0, u64::MAX, is_filled).unwrap().rows, 2);
        assert_eq!((line_end(b"1\r\n2\r\n3\r"), line_end(b"1 2"), line_end(b"1\r2\r3\n")), (b'\n', b'\n', b'\r'));
    }

    #[test]
    fn pieces_are_cut_at_newlines_and_numbered_without_gaps() {
        let text = "123456 1234567 12345678\n".repeat(1_000_000);
        let index = index(&source(text.as_bytes()), 0, 999_999, is_filled).unwrap();
        assert_eq!((index.rows, index.pieces.len(), index.end), (999_999, 3, 24 * 999_999));
        let mut next = (0, 0);
        for p in &index.pieces {
            assert_eq!((p.first_point, p.byte_offset), next);
            assert_eq!(p.byte_len, p.points * 24);
            next = (next.0 + p.points, next.1 + p.byte_len);
        }
    }

    #[test]
    fn a_line_without_end_is_refused() {
        let bytes = vec![b'1'; 3 << 20];
        assert!(index(&source(&bytes), 0, 10, is_filled).unwrap_err().what().contains("a line of more"));
    }

    #[test]
    fn long_lines_at_the_start_are_few() {
        let text = [b"1 ".repeat(300_000), b"\n".to_vec()].concat().repeat(5);
        assert_eq!(first_filled(&source(&text), 0, 5).unwrap().len(), 2);
    }

    #[test]
    fn lines_are_skipped_by_count() {
        assert_eq!(skip(&source(b"a\n\nb\nc\n"), 0, 2).unwrap(), (5, 0));
        assert_eq!(skip(&source(b"a\n"), 0, 2).unwrap(), (2, 1));
    }
}
