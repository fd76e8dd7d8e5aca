//! Lines and their fields, as all kinds of text have them.

use super::dialect::usual_separator;
use crate::scan::tabular::DecimalMark;
use crate::scan::tabular::ascii::{Tokens, parse};
use crate::scan::tabular::lines;

/// The filled lines of the first bytes, 64 at most; the last one may be cut and counts only if it is the only one.
pub(super) fn filled(first_bytes: &[u8]) -> Vec<&[u8]> {
    let text = first_bytes.strip_prefix(BOM).unwrap_or(first_bytes);
    let mut lines: Vec<_> = lines::lines(text).map(|(_, l)| l).filter(|l| lines::is_filled(l)).take(64).collect();
    if lines.len() > 3 && lines.len() < 64 && !text.ends_with(&[lines::line_end(text)]) {
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

/// The value of a line of one whole number without sign; quotes do not count.
pub(super) fn count(line: &[u8]) -> Option<u64> {
    let line = line.trim_ascii();
    let bare = line.strip_prefix(b"\"").and_then(|l| l.strip_suffix(b"\"")).unwrap_or(line);
    if !(1..=20).contains(&bare.len()) || !bare.iter().all(u8::is_ascii_digit) {
        return None;
    }
    Some(std::str::from_utf8(bare).ok().and_then(|t| t.parse().ok()).unwrap_or(u64::MAX))
}

pub(super) fn is_count(line: &[u8]) -> bool {
    // a row has a blank or a separator among its first bytes, mostly
    line.len() <= 24 && count(line).is_some()
}

/// The fields of a line.
pub(super) fn fields(line: &[u8], separator: Option<u8>) -> Vec<&[u8]> {
    let mut tokens = Tokens { line, at: 0, separator, strict: false };
    std::iter::from_fn(|| (!tokens.is_empty()).then(|| tokens.token())).collect()
}

pub(super) fn is_number(field: &[u8]) -> bool {
    parse(field).is_ok()
}

/// Numbers of a line up to the first field that is none; commas separate, or stand before decimals.
pub(super) fn number_count(line: &[u8]) -> usize {
    let count = |line: &[u8], separator| fields(line, separator).iter().take_while(|f| is_number(f)).count();
    let mut buffer = Vec::new();
    let points = count(line, usual_separator(line));
    if points > 0 || !line.contains(&b',') {
        return points;
    }
    let line = DecimalMark::Comma.to_points(line, &mut buffer);
    count(line, usual_separator(line))
}
