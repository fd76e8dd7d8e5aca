//! A first column that numbers or names the rows, as pandas and R write it, and titles that are numbers.

use super::dialect::Dialect;

/// Rows are numbered from there.
const FIRST_NUMBERS: [u64; 2] = [0, 1];

/// What the first column looks like in the rows at the start of the file.
#[derive(Debug)]
pub(super) struct First {
    /// All are whole numbers, without a decimal mark.
    whole: bool,
    /// They are words.
    words: bool,
    /// Every one stands in quotes, and nothing else does.
    quoted: bool,
    /// They are 0, 1, 2 … or 1, 2, 3 ….
    consecutive: bool,
    /// The three columns behind it have decimals in every row.
    before_decimals: bool,
}

impl First {
    /// `rows` from the first of the file on, without gaps.
    pub(super) fn of(dialect: Dialect, rows: &[Vec<u8>]) -> Self {
        let split: Vec<_> = rows.iter().map(|row| dialect.split(row)).collect();
        let numbers: Vec<Option<u64>> = split.iter().map(|fields| fields.first().and_then(|f| number(f))).collect();
        let counts_from = |first: u64| numbers.iter().zip(first..).all(|(n, i)| *n == Some(i));
        let start_quoted = |row: &Vec<u8>| {
            let row = row.trim_ascii_start();
            row.first() == Some(&b'"') && row.iter().filter(|b| **b == b'"').count() == 2
        };
        Self {
            whole: numbers.iter().all(Option::is_some),
            words: split
                .iter()
                .all(|fields| fields.first().is_some_and(|f| crate::scan::tabular::ascii::parse(f).is_err())),
            quoted: rows.iter().all(start_quoted),
            consecutive: FIRST_NUMBERS.into_iter().any(counts_from),
            before_decimals: split.iter().all(|fields| have_decimals(fields.get(1..4))),
        }
    }

    /// Under an empty title.
    pub(super) fn is_whole_or_words(&self) -> bool {
        self.whole || self.words
    }

    /// Where one title is missing.
    pub(super) fn numbers_or_names_rows(&self) -> bool {
        self.consecutive || self.quoted || self.words
    }

    /// Without titles: whoever writes x as a bare number does not write y, z and one more with decimals.
    pub(super) fn counts_rows_without_titles(&self) -> bool {
        self.before_decimals && (self.consecutive || (self.quoted && self.is_whole_or_words()))
    }
}

/// A whole number as a counter writes it.
fn number(field: &[u8]) -> Option<u64> {
    std::str::from_utf8(field).ok().filter(|f| f.bytes().all(|b| b.is_ascii_digit()))?.parse().ok()
}

fn have_decimals(fields: Option<&[Vec<u8>]>) -> bool {
    fields.is_some_and(|fields| fields.iter().all(|f| f.iter().any(|b| b".eE".contains(b))))
}

/// True if the first of the rows is 0, 1, 2 … (behind an empty field, perhaps) or 1, 2, 3 … in quotes, and the others
/// are written another way.
pub(super) fn are_numeric_titles(dialect: Dialect, rows: &[Vec<u8>]) -> bool {
    let Some((first, others)) = rows.split_first() else { return false };
    let fields = dialect.split(first);
    let skip = usize::from(fields.first().is_some_and(Vec::is_empty));
    let titles = &fields[skip..];
    let counts_from = |first: u64| titles.iter().zip(first..).all(|(f, i)| number(f) == Some(i));
    if titles.len() < 3 || others.is_empty() || !FIRST_NUMBERS.into_iter().any(counts_from) {
        return false;
    }
    let quotes = |row: &[u8]| row.iter().filter(|b| **b == b'"').count();
    let quoted = quotes(first) >= 2 * titles.len() && others.iter().all(|row| quotes(row) < 2 * titles.len());
    quoted || others.iter().all(|row| have_decimals(dialect.split(row).get(skip..skip + 3)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::text::TextOptions;
    use crate::scan::text::dialect::detect;

    fn rows(lines: &[&str]) -> (Dialect, Vec<Vec<u8>>) {
        let rows: Vec<_> = lines.iter().map(|l| l.as_bytes().to_vec()).collect();
        (detect(&rows, None, &TextOptions::default()).unwrap().0, rows)
    }

    #[test]
    fn a_column_that_counts_is_told_from_coordinates() {
        let counts = |lines: &[&str]| {
            let (dialect, rows) = rows(lines);
            First::of(dialect, &rows).counts_rows_without_titles()
        };
        assert!(counts(&["0,1.5,2.5,3.5", "1,4.5,5.5,6.5"]));
        assert!(counts(&["\"a\" 1.5 2.5 3.5", "\"b\" 4.5 5.5 6.5"]));
        for coordinates in [
            &["0.0 1.5 2.5 3.5", "1.0 4.5 5.5 6.5"][..],
            &["0 1 2 3", "1 4 5 6"],
            &["0 1.5 2.5", "1 4.5 5.5"],
            &["3 1.5 2.5 3.5", "4 4.5 5.5 6.5"],
            &["0 1.5 2.5 3.5", "2 4.5 5.5 6.5"],
        ] {
            assert!(!counts(coordinates), "{coordinates:?}");
        }
    }

    #[test]
    fn titles_that_are_numbers_are_told_from_a_point() {
        let titles = |lines: &[&str]| {
            let (dialect, rows) = rows(lines);
            are_numeric_titles(dialect, &rows)
        };
        assert!(titles(&[",0,1,2", "0,1.5,2.5,3.5"]));
        assert!(titles(&["0,1,2", "1.5,2.5,3.5"]));
        assert!(titles(&["\"0\",\"1\",\"2\"", "5,6,7"]));
        for point in [&["0,1,2", "3,4,5"][..], &["0,1,2"], &["0,1,2", "1.5,2,3.5"], &["0,1,3", "1.5,2.5,3.5"]] {
            assert!(!titles(point), "{point:?}");
        }
    }
}
