//! Rows as a stream of numbers: a line end is a blank like others, so that a row may take several lines, or share one.

use super::ascii::parse;
use crate::scan::source::Source;
use crate::{Advice, Piece, ReadError};

/// Bytes that are read at once, and the longest number.
const WINDOW: u64 = 1 << 20;
/// Bytes of a piece, which is held in memory while it is decoded.
const PIECE_BYTES: u64 = 1 << 20;
/// The longest row of points.
const MAX_ROW: u64 = 1 << 20;

/// What the numbers of a row are: one for each property, `true` where it says how many numbers follow it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RowShape(pub(crate) Vec<bool>);

impl RowShape {
    /// Rows of `count` numbers.
    pub(crate) fn plain(count: usize) -> Self {
        Self(vec![false; count])
    }

    /// True if the line holds exactly one row.
    pub(crate) fn is_line(&self, line: &[u8]) -> bool {
        let mut tokens = line.split(|b| *b <= b' ').filter(|t| !t.is_empty());
        let whole = self.0.iter().all(|is_list| match tokens.next() {
            Some(token) if *is_list => items(token).is_some_and(|n| tokens.by_ref().take(n).count() == n),
            token => token.is_some(),
        });
        whole && tokens.next().is_none()
    }
}

/// The length of a list; `None` if it is no number, or negative.
fn items(token: &[u8]) -> Option<usize> {
    parse(token).ok().filter(|n| *n >= 0.0).map(|n| n as usize)
}

/// `count` rows of one shape, one behind the other.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rows {
    pub(crate) shape: RowShape,
    pub(crate) count: u64,
}

/// The rows of a stream that were found.
#[derive(Debug, PartialEq)]
pub(crate) struct Stream {
    pub(crate) pieces: Vec<Piece>,
    pub(crate) rows: u64,
    /// All rows of all elements are there, and nothing behind them.
    pub(crate) is_whole: bool,
    /// The byte behind the last row.
    pub(crate) end: u64,
}

/// Cuts `points`, which stand between the rows `before` and `after`, into pieces.
///
/// `None` if the numbers from byte `from` on cannot be those rows: some before the points are missing, or more are there.
pub(crate) fn index(
    source: &Source,
    from: u64,
    before: &[Rows],
    points: &Rows,
    after: &[Rows],
) -> Result<Option<Stream>, ReadError> {
    let mut reader = Reader { source, window: Vec::new(), filled: 0, window_at: from, at: 0, token: 0..0 };
    for rows in before {
        if !reader.pass(rows)? {
            return Ok(None);
        }
    }
    let (pieces, rows, end) = reader.pieces(points)?;
    let mut is_whole = rows == points.count;
    for rows in after {
        is_whole = is_whole && reader.pass(rows)?;
    }
    if is_whole && reader.next()?.is_some() {
        return Ok(None);
    }
    Ok(Some(Stream { pieces, rows, is_whole, end }))
}

/// Reads numbers one after the other.
struct Reader<'a> {
    source: &'a Source,
    /// Bytes of the file from `window_at` on, `filled` of them.
    window: Vec<u8>,
    filled: usize,
    window_at: u64,
    /// Next byte in the window.
    at: usize,
    /// The last number in the window.
    token: std::ops::Range<usize>,
}

impl Reader<'_> {
    /// Passes over rows; false if not all are there.
    fn pass(&mut self, rows: &Rows) -> Result<bool, ReadError> {
        if rows.shape.0.is_empty() {
            return Ok(true);
        }
        for _ in 0..rows.count {
            if self.row(&rows.shape)?.is_none() {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Pieces of the rows that are there whole, how many these are, and where they end.
    fn pieces(&mut self, rows: &Rows) -> Result<(Vec<Piece>, u64, u64), ReadError> {
        let mut pieces = Vec::new();
        let mut open = Piece { first_point: 0, points: 0, byte_offset: 0, byte_len: 0 };
        for row in 0..rows.count {
            let Some((start, end)) = self.row(&rows.shape)? else { break };
            if end - start > MAX_ROW {
                let what = format!("a row of {} bytes starts here, more than {MAX_ROW}", end - start);
                return Err(ReadError::broken(self.source.path(), start, what).advise(Advice::Damaged));
            }
            if open.byte_len >= PIECE_BYTES {
                pieces.push(open.clone());
                open = Piece { first_point: row, points: 0, byte_offset: 0, byte_len: 0 };
            }
            if open.points == 0 {
                open.byte_offset = start;
            }
            open.points += 1;
            open.byte_len = end - open.byte_offset;
        }
        let (rows, end) = (open.first_point + open.points, open.byte_offset + open.byte_len);
        if open.points > 0 {
            pieces.push(open);
        }
        Ok((pieces, rows, end))
    }

    /// Where the next row starts and ends; `None` if it is not there whole, or a list of it has no length.
    fn row(&mut self, shape: &RowShape) -> Result<Option<(u64, u64)>, ReadError> {
        let mut start = None;
        for is_list in &shape.0 {
            let Some(at) = self.next()? else { return Ok(None) };
            start = start.or(Some(at));
            if *is_list {
                let Some(items) = items(&self.window[self.token.clone()]) else { return Ok(None) };
                for _ in 0..items {
                    if self.next()?.is_none() {
                        return Ok(None);
                    }
                }
            }
        }
        Ok(start.map(|start| (start, self.window_at + self.token.end as u64)))
    }

    /// Where the next number starts; it is `token` of the window.
    fn next(&mut self) -> Result<Option<u64>, ReadError> {
        loop {
            let rest = &self.window[self.at..self.filled];
            let blanks = rest.iter().position(|b| *b > b' ').unwrap_or(rest.len());
            let start = self.at + blanks;
            let is_last = self.window_at + self.filled as u64 >= self.source.len();
            match rest[blanks..].iter().position(|b| *b <= b' ') {
                Some(len) => self.token = start..start + len,
                None if !is_last => {
                    self.refill(start)?;
                    continue;
                }
                None if start == self.filled => return Ok(None),
                None => self.token = start..self.filled,
            }
            self.at = self.token.end;
            return Ok(Some(self.window_at + start as u64));
        }
    }

    /// Moves the window to its byte `start`.
    fn refill(&mut self, start: usize) -> Result<(), ReadError> {
        if start == 0 && self.filled > 0 {
            let what = format!("what stands here is no number of less than {WINDOW} bytes");
            return Err(ReadError::broken(self.source.path(), self.window_at, what)
                .advise("this is no text of points; export it again"));
        }
        self.window_at += start as u64;
        let len = WINDOW.min(self.source.len() - self.window_at);
        self.filled = self.source.slice_at(self.window_at, len, &mut self.window)?.len();
        self.at = 0;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn source(bytes: &[u8]) -> Source {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), bytes).unwrap();
        Source::open(file.path()).unwrap()
    }

    fn rows(shape: &[bool], count: u64) -> Rows {
        Rows { shape: RowShape(shape.to_vec()), count }
    }

    #[test]
    fn a_line_is_told_from_a_part_of_a_row_and_from_two() {
        let three = RowShape::plain(3);
        assert!(three.is_line(b" 1 2\t3 ") && !three.is_line(b"1 2") && !three.is_line(b"1 2 3 4"));
        let list = RowShape(vec![false, true, false]);
        assert!(list.is_line(b"1 2 7 8 5") && list.is_line(b"1 0 5") && !list.is_line(b"1 2 7 8"));
        assert!(!list.is_line(b"1 -1 5") && !list.is_line(b"1 x 5") && !list.is_line(b"1 1e300 5"));
    }

    #[test]
    fn rows_are_found_between_others_whatever_the_line_ends() {
        let text = b"9 2 5\r5\n1 2\r\n3 4 5\n\n6 3 0 1 2";
        let (before, points, after) = ([rows(&[false, true], 1)], rows(&[false; 3], 2), [rows(&[true], 1)]);
        let found = index(&source(text), 0, &before, &points, &after).unwrap().unwrap();
        assert_eq!((found.rows, found.is_whole, found.end), (2, true, 21));
        assert_eq!(found.pieces, [Piece { first_point: 0, points: 2, byte_offset: 8, byte_len: 13 }]);
        let more = rows(&[false; 3], 3);
        let found = index(&source(text), 0, &before, &more, &after).unwrap().unwrap();
        assert_eq!((found.rows, found.is_whole), (3, false));
        assert_eq!(index(&source(text), 0, &before, &points, &[]).unwrap(), None);
        assert_eq!(index(&source(b"1 2"), 0, &[rows(&[false; 3], 1)], &points, &[]).unwrap(), None);
    }

    #[test]
    fn a_row_whose_list_goes_on_and_on_is_refused() {
        let text = [b"1 1 5\n3 900000".as_slice(), &b" 7".repeat(900_000), b"\n"].concat();
        let error = index(&source(&text), 0, &[], &rows(&[false, true], 2), &[]).unwrap_err();
        assert!(error.to_string().contains("a row of 1800008 bytes starts here"), "{error}");
        assert_eq!(error.offset(), Some(6));
    }

    #[test]
    fn pieces_and_windows_end_between_rows() {
        let text = "123456 1234567\n12345678\n".repeat(1_000_000);
        let found = index(&source(text.as_bytes()), 0, &[], &rows(&[false; 3], 1_000_000), &[]).unwrap().unwrap();
        assert_eq!((found.rows, found.pieces.len(), found.is_whole), (1_000_000, 23, true));
        let mut next = (0, 0);
        for p in &found.pieces {
            assert_eq!((p.first_point, p.byte_offset, p.byte_len), (next.0, next.1, p.points * 24 - 1));
            next = (next.0 + p.points, next.1 + p.byte_len + 1);
        }
        let endless = index(&source(&vec![b'1'; 3 << 20]), 0, &[], &rows(&[false], 9), &[]);
        assert!(endless.unwrap_err().what().contains("no number of less than"));
    }
}
