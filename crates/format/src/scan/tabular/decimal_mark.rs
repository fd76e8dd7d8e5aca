//! The byte before the decimals of a number.

/// The byte before the decimals of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) enum DecimalMark {
    /// A point.
    #[default]
    Point,
    /// A comma, always.
    Comma,
    /// A comma between two digits; any other is a separator.
    InnerComma,
}

impl DecimalMark {
    /// The line with points as decimal marks, in `buffer` unless it has them already.
    ///
    /// Every byte keeps its place. A point of the line becomes a byte that no number has: beside decimal commas it
    /// groups thousands or contradicts the other numbers.
    pub(crate) fn to_points<'a>(self, line: &'a [u8], buffer: &'a mut Vec<u8>) -> &'a [u8] {
        if self == Self::Point {
            return line;
        }
        let is_digit = |i: Option<usize>| i.and_then(|i| line.get(i)).is_some_and(u8::is_ascii_digit);
        let is_mark = |i: usize| self == Self::Comma || (is_digit(i.checked_sub(1)) && is_digit(i.checked_add(1)));
        buffer.clear();
        buffer.extend(line.iter().enumerate().map(|(i, b)| match b {
            b',' if is_mark(i) => b'.',
            b'.' => NO_NUMBER,
            b => *b,
        }));
        buffer
    }
}

/// Not part of any number, and no separator.
pub(crate) const NO_NUMBER: u8 = b'`';

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commas_become_points_in_their_places() {
        let mut buffer = Vec::new();
        let mut text = |mark: DecimalMark, line: &str| {
            String::from_utf8(mark.to_points(line.as_bytes(), &mut buffer).to_vec()).unwrap()
        };
        assert_eq!(text(DecimalMark::Point, "1,5 2.5"), "1,5 2.5");
        assert_eq!(text(DecimalMark::Comma, "1,5 ,25 2.5"), "1.5 .25 2`5");
        assert_eq!(text(DecimalMark::InnerComma, "1,5, -2,5,\"3,5\",,4"), "1.5, -2.5,\"3.5\",,4");
    }
}
