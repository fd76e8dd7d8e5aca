//! Lines and their fields, as all kinds of text have them.

use crate::scan::tabular::ascii::{Tokens, parse};
use crate::scan::tabular::lines;

/// The filled lines of the first bytes, 64 at most; the last one may be cut and counts only if it is the only one.
pub(super) fn filled(first_bytes: &[u8]) -> Vec<&[u8]> {
    let text = first_bytes.strip_prefix(BOM).unwrap_or(first_bytes);
    let mut lines: Vec<_> = lines::lines(text).map(|(_, l)| l).filter(|l| lines::is_filled(l)).take(64).collect();
    if lines.len() > 3 && lines.len() < 64 && !text.ends_with(b"\n") {
        lines.pop();
    }
    lines
}

/// UTF-8 with a signature.
pub(super) const BOM: &[u8] = &[0xef, 0xbb, 0xbf];

/// Line starts of comments.
const COMMENTS: [&[u8]; 3] = [b"#", b"//", b"%"];

pub(super) fn is_comment(line: &[u8]) -> bool {
    let line = line.trim_ascii_start();
    COMMENTS.iter().any(|c| line.starts_with(c))
}

/// A line of numbers, if the file is what it should be.
pub(super) fn is_data(line: &[u8]) -> bool {
    // a digit first is the usual row
    if line.first().is_some_and(|b| b.is_ascii_digit() || *b == b'-') {
        return true;
    }
    lines::is_filled(line) && !is_comment(line)
}

/// A line of one whole number without sign.
pub(super) fn is_count(line: &[u8]) -> bool {
    let line = line.trim_ascii();
    (1..=20).contains(&line.len()) && line.iter().all(u8::is_ascii_digit)
}

/// `;` before `,` before blanks: a decimal comma needs another separator.
pub(super) fn separator(line: &[u8]) -> Option<u8> {
    [b';', b','].into_iter().find(|s| line.contains(s))
}

/// The fields of a line.
pub(super) fn fields(line: &[u8], separator: Option<u8>) -> Vec<&[u8]> {
    let mut tokens = Tokens { line, at: 0, separator };
    std::iter::from_fn(|| (!tokens.is_empty()).then(|| tokens.token())).collect()
}

pub(super) fn is_number(field: &[u8]) -> bool {
    parse(field).is_ok()
}

/// Fields up to the first that is no number.
pub(super) fn number_count(line: &[u8]) -> usize {
    fields(line, separator(line)).iter().take_while(|f| !f.is_empty() && is_number(f)).count()
}
