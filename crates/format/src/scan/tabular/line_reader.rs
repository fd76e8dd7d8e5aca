//! The lines of a piece of text, read a little at a time.

use memchr::{memchr, memchr2};

use super::lines::{END_BYTES, WINDOW, endless_line, line_end, trim_end};
use crate::ReadError;
use crate::scan::source::Source;

/// Bytes that are read at once: small beside a batch, so that they are still in a cache when they become numbers.
const READ: u64 = 256 << 10;

/// Reads lines one after the other, whatever the size of the piece.
pub(super) struct LineReader<'a> {
    source: &'a Source,
    /// Bytes of the file from `at` on, `filled` of them.
    bytes: &'a mut Vec<u8>,
    at: u64,
    filled: usize,
    /// Where the next line starts in `bytes`.
    start: usize,
    /// The end of the piece.
    end: u64,
    /// The last byte of each line, once it is known.
    line_end: Option<u8>,
}

impl<'a> LineReader<'a> {
    /// The lines of the bytes `at..end`; `bytes` is memory to use.
    pub(super) fn new(source: &'a Source, at: u64, end: u64, bytes: &'a mut Vec<u8>) -> Self {
        Self { source, bytes, at, filled: 0, start: 0, end, line_end: None }
    }

    /// Bytes of memory that reading a piece of so many takes at most.
    pub(super) fn bytes(piece: u64) -> u64 {
        piece.min(WINDOW + READ)
    }

    /// The next line for which `is_row` says so, with its place in the file and without its line end.
    #[inline]
    pub(super) fn next_row(&mut self, is_row: fn(&[u8]) -> bool) -> Result<Option<(u64, &[u8])>, ReadError> {
        loop {
            let Some((start, end)) = self.next_line()? else { return Ok(None) };
            if is_row(trim_end(&self.bytes[start..end])) {
                return Ok(Some((self.at + start as u64, trim_end(&self.bytes[start..end]))));
            }
        }
    }

    /// The place of the next line in `bytes`.
    #[inline]
    fn next_line(&mut self) -> Result<Option<(usize, usize)>, ReadError> {
        loop {
            let rest = &self.bytes[self.start..self.filled];
            let len = self.line_end.and_then(|line_end| memchr(line_end, rest)).map(|newline| newline + 1);
            // the last line needs no line end
            let is_all = self.at + self.filled as u64 >= self.end;
            let is_last = is_all && self.line_end.is_some() && !rest.is_empty();
            if let Some(len) = len.or(is_last.then_some(rest.len())) {
                let line = (self.start, self.start + len);
                self.start = line.1;
                return Ok(Some(line));
            }
            if is_all && (rest.is_empty() || self.line_end.is_some()) {
                return Ok(None);
            }
            self.refill()?;
        }
    }

    /// Reads on, and tells how lines end once enough of them are there.
    fn refill(&mut self) -> Result<(), ReadError> {
        self.bytes.copy_within(self.start..self.filled, 0);
        self.at += self.start as u64;
        self.filled -= self.start;
        self.start = 0;
        if self.filled as u64 >= WINDOW {
            return Err(endless_line(self.source, self.at));
        }
        let more = READ.min(self.end.saturating_sub(self.at + self.filled as u64)) as usize;
        if self.bytes.len() < self.filled + more {
            self.bytes.reserve_exact(self.filled + more - self.bytes.len());
            self.bytes.resize(self.filled + more, 0);
        }
        let place = self.at + self.filled as u64;
        self.source.read_at(place, &mut self.bytes[self.filled..self.filled + more])?;
        self.filled += more;
        let bytes = &self.bytes[..self.filled];
        let is_all = self.at + self.filled as u64 >= self.end;
        let is_shown = || memchr2(b'\r', b'\n', bytes).is_some_and(|first| first + END_BYTES <= bytes.len());
        if self.line_end.is_none() && (is_all || is_shown()) {
            self.line_end = Some(line_end(bytes));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::tabular::lines;

    #[test]
    fn lines_are_those_of_the_whole_piece_whatever_the_windows() {
        let long = "7 ".repeat(150_000);
        for newline in ["\n", "\r\n", "\r"] {
            let text = ["1 2 3", "", &long, "4 5 6", &long, &long, &long, "9"].join(newline);
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), &text).unwrap();
            let source = Source::open(file.path()).unwrap();
            let mut bytes = Vec::new();
            let mut reader = LineReader::new(&source, 0, source.len(), &mut bytes);
            for (at, line) in lines::lines(text.as_bytes()).filter(|(_, line)| !line.is_empty()) {
                assert_eq!(reader.next_row(|line| !line.is_empty()).unwrap(), Some((at as u64, line)));
            }
            assert_eq!(reader.next_row(lines::is_filled).unwrap(), None);
            assert!(bytes.len() as u64 <= LineReader::bytes(source.len()), "{}", bytes.len());
        }
    }

    #[test]
    fn a_line_without_end_is_refused_and_not_held() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), vec![b'1'; 5 << 20]).unwrap();
        let source = Source::open(file.path()).unwrap();
        let mut bytes = Vec::new();
        let error = LineReader::new(&source, 0, source.len(), &mut bytes).next_row(lines::is_filled).unwrap_err();
        assert!(error.what().contains("a line of more than 1048576 bytes"), "{error}");
        assert!(bytes.len() as u64 <= WINDOW + READ);
    }
}
