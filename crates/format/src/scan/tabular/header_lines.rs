//! The lines of a text header with any line ends, and where the data behind it start.

/// UTF-8's mark at the start of a text; it says nothing.
pub(crate) const BOM: &[u8] = b"\xef\xbb\xbf";

/// How a line ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LineEnd {
    Lf,
    CrLf,
    /// As old Macs wrote it.
    Cr,
    /// With the bytes.
    Missing,
}

/// A line of a header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct HeaderLine<'a> {
    /// Where it starts.
    pub(crate) at: usize,
    /// Without its end.
    pub(crate) text: &'a [u8],
    pub(crate) end: LineEnd,
}

/// The lines of `bytes` behind a BOM, if there is one; kinds of line ends may alternate.
pub(crate) fn header_lines(bytes: &[u8]) -> impl Iterator<Item = HeaderLine<'_>> {
    let mut start = if bytes.starts_with(BOM) { BOM.len() } else { 0 };
    std::iter::from_fn(move || {
        let rest = bytes.get(start..).filter(|r| !r.is_empty())?;
        let len = memchr::memchr2(b'\n', b'\r', rest).unwrap_or(rest.len());
        let (end, end_len) = match &rest[len..] {
            [b'\n', ..] => (LineEnd::Lf, 1),
            [b'\r', b'\n', ..] => (LineEnd::CrLf, 2),
            [b'\r', ..] => (LineEnd::Cr, 1),
            _ => (LineEnd::Missing, 0),
        };
        let line = HeaderLine { at: start, text: &rest[..len], end };
        start += len + end_len;
        Some(line)
    })
}

/// Where the data start behind `last`, the last line of a header.
///
/// CR LF there may be a line end, or a CR and the first byte of the data. `fits` tells if data that start at a byte fill
/// the file as the header says; where it does not decide, the lines before do (`all_cr`: each ended with CR alone).
pub(crate) fn data_start(last: &HeaderLine<'_>, all_cr: bool, fits: impl Fn(u64) -> bool) -> u64 {
    let text_end = (last.at + last.text.len()) as u64;
    let (behind_cr, behind_lf) = (text_end + 1, text_end + 2);
    match last.end {
        LineEnd::Missing => text_end,
        LineEnd::Lf | LineEnd::Cr => behind_cr,
        LineEnd::CrLf if fits(behind_lf) => behind_lf,
        LineEnd::CrLf if fits(behind_cr) || all_cr => behind_cr,
        LineEnd::CrLf => behind_lf,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_line_ends_are_told_apart_and_a_bom_is_passed_over() {
        let lines: Vec<_> = header_lines(b"\xef\xbb\xbfa\nb\r\nc\r\rd").map(|l| (l.at, l.text, l.end)).collect();
        let expected: [(usize, &[u8], LineEnd); 5] = [
            (3, b"a", LineEnd::Lf),
            (5, b"b", LineEnd::CrLf),
            (8, b"c", LineEnd::Cr),
            (10, b"", LineEnd::Cr),
            (11, b"d", LineEnd::Missing),
        ];
        assert_eq!(lines, expected);
    }

    #[test]
    fn a_line_feed_behind_a_carriage_return_is_data_where_the_bytes_or_the_header_say_so() {
        let last = HeaderLine { at: 10, text: b"end", end: LineEnd::CrLf };
        assert_eq!(data_start(&last, false, |_| false), 15);
        assert_eq!(data_start(&last, true, |_| false), 14);
        assert_eq!(data_start(&last, true, |at| at == 15), 15);
        assert_eq!(data_start(&last, false, |at| at == 14), 14);
        assert_eq!(data_start(&HeaderLine { end: LineEnd::Lf, ..last }, true, |at| at == 15), 14);
        assert_eq!(data_start(&HeaderLine { end: LineEnd::Missing, ..last }, true, |_| true), 13);
    }
}
