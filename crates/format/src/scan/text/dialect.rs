//! What separates the columns of a text, and what its decimal mark is, by a sample of its rows.
//!
//! Candidates are tried on every sampled row. One fits if each field is a number, empty, or words; a field that is made
//! of digits and still no number (`1,5` where points are decimal marks, `5 2` between commas) speaks against it.

use super::commas::{AXES, example, groups_thousands, joins_decimals, joins_numbers};
use super::options::TextOptions;
use crate::scan::tabular::ascii::{Tokens, parse};
use crate::scan::tabular::{DecimalMark, LineRule};
use crate::{Decimal, ScanWarning};

/// How a row becomes fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Dialect {
    /// Between two fields; `None`: blanks.
    pub(super) separator: Option<u8>,
    /// Blanks alone do not separate where there is a separator.
    pub(super) strict: bool,
    pub(super) decimal: DecimalMark,
}

/// What a field is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FieldKind {
    Number,
    Empty,
    Words,
    /// Made of digits, and no number.
    Odd,
}

impl Dialect {
    const BLANKS: Self = Self { separator: None, strict: true, decimal: DecimalMark::Point };
    const BLANKS_COMMA: Self = Self { decimal: DecimalMark::Comma, ..Self::BLANKS };
    pub(super) const COMMAS: Self = Self { separator: Some(b','), ..Self::BLANKS };
    const COMMAS_COMMA: Self = Self { decimal: DecimalMark::InnerComma, ..Self::COMMAS };
    const LOOSE: Self = Self { strict: false, ..Self::COMMAS };

    /// The two candidates with that separator: with decimal points, and with decimal commas.
    fn both(separator: Option<u8>) -> [Self; 2] {
        match separator {
            None => [Self::BLANKS, Self::BLANKS_COMMA],
            Some(b',') => [Self::COMMAS, Self::COMMAS_COMMA],
            separator => {
                [DecimalMark::Point, DecimalMark::Comma].map(|decimal| Self { separator, strict: true, decimal })
            }
        }
    }

    /// How the rows are read.
    pub(super) fn rule(self, is_row: fn(&[u8]) -> bool) -> LineRule {
        LineRule { strict: self.strict, decimal: self.decimal, sampled: true, ..LineRule::new(self.separator, is_row) }
    }

    /// The fields of a row, with points as decimal marks and without quotes.
    pub(super) fn split(self, row: &[u8]) -> Vec<Vec<u8>> {
        let mut buffer = Vec::new();
        let line = self.decimal.to_points(row, &mut buffer);
        let mut tokens = Tokens { line, at: 0, separator: self.separator, strict: self.strict };
        std::iter::from_fn(|| (!tokens.is_empty()).then(|| tokens.token().to_vec())).collect()
    }

    fn split_all(self, rows: &[Vec<u8>]) -> Vec<Vec<Vec<u8>>> {
        rows.iter().map(|row| self.split(row)).collect()
    }

    pub(super) fn kinds(self, row: &[u8]) -> Vec<FieldKind> {
        self.split(row).iter().map(|field| FieldKind::of(field, self.decimal)).collect()
    }

    /// For people: "separated by commas".
    pub(super) fn describe(self) -> String {
        let separator = match self.separator {
            Some(b',') => "separated by commas",
            Some(b';') => "separated by semicolons",
            Some(_) => "with separators",
            None => "separated by blanks",
        };
        let mark = if self.has_decimal_commas() { ", decimal commas" } else { "" };
        format!("{separator}{mark}")
    }

    pub(super) fn has_decimal_commas(self) -> bool {
        self.decimal != DecimalMark::Point
    }
}

impl FieldKind {
    fn of(field: &[u8], decimal: DecimalMark) -> Self {
        if field.is_empty() {
            return Self::Empty;
        }
        if parse(field).is_ok() {
            return Self::Number;
        }
        let numeric = |b: &u8| b.is_ascii_digit() || b"+-.,`eE \t".contains(b);
        let marks = |byte: u8| field.iter().filter(|b| **b == byte).count();
        // several commas where they are decimal marks; several points make a date or a version
        let is_list = decimal != DecimalMark::Point && marks(b'.') > 1;
        let is_other = is_list || field.iter().any(|b| b",` \t".contains(b)) && !is_date(field);
        if field.iter().all(numeric) && is_other { Self::Odd } else { Self::Words }
    }
}

/// A date like 24.12.2020, whose points are marked.
fn is_date(field: &[u8]) -> bool {
    let parts: Vec<_> = field.split(|b| *b == b'`').map(<[u8]>::len).collect();
    matches!(parts.as_slice(), [1 | 2, 1 | 2, 2 | 4] | [4, 1 | 2, 1 | 2])
}

/// How well a dialect fits the rows.
struct Fit {
    dialect: Dialect,
    /// Rows that fit.
    rows: usize,
    all: bool,
    /// Most numbers of a row that fits.
    numbers: usize,
    /// Columns, and numbers among them, if they are as many in all rows that fit.
    shape: Option<(usize, usize)>,
}

impl Fit {
    fn new(dialect: Dialect, rows: &[Vec<u8>]) -> Self {
        let mut shapes = Vec::new();
        for row in rows {
            let kinds = dialect.kinds(row);
            let numbers = kinds.iter().filter(|k| **k == FieldKind::Number).count();
            if numbers > 1 && !kinds.contains(&FieldKind::Odd) {
                shapes.push((kinds.len(), numbers));
            }
        }
        let shape = shapes.first().copied().filter(|first| shapes.iter().all(|s| s.0 == first.0));
        let numbers = shapes.iter().map(|s| s.1).max().unwrap_or(0);
        Self { dialect, rows: shapes.len(), all: shapes.len() == rows.len(), numbers, shape }
    }

    /// All rows fit and have the same number of columns, `AXES` or as many as are named.
    fn is_scan(&self, named: Option<usize>) -> bool {
        let fits = |(columns, numbers)| named.map_or(numbers >= AXES, |n| n == columns);
        self.all && self.shape.is_some_and(fits)
    }
}

/// The dialect of `rows` (data lines, the first one first), and what was chosen against the usual. `titled`: how many titles
/// stand between commas above them.
///
/// `Err` says what cannot be told.
pub(super) fn detect(
    rows: &[Vec<u8>],
    titled: Option<usize>,
    options: &TextOptions,
) -> Result<(Dialect, Option<ScanWarning>), String> {
    let found = match separator(rows, options) {
        Separators::One(separator) => one(separator, rows, options)?,
        Separators::Unknown => unknown(rows, titled, options)?,
    };
    let warning = match found {
        Dialect { decimal: DecimalMark::Point, strict: true, .. } => None,
        _ if options.decimal != Decimal::Auto => None,
        Dialect { decimal: DecimalMark::Point, .. } => Some(ScanWarning::SeparatorsMixed),
        _ => Some(ScanWarning::DecimalComma { example: example(rows) }),
    };
    Ok((found, warning))
}

enum Separators {
    One(Option<u8>),
    /// Blanks, commas, or both.
    Unknown,
}

fn separator(rows: &[Vec<u8>], options: &TextOptions) -> Separators {
    if let Some(separator) = options.separator {
        return Separators::One(u8::try_from(separator).ok().filter(|b| *b > b' '));
    }
    let first = rows.first().map_or(&b""[..], Vec::as_slice);
    if without_quoted(first).contains(&b';') {
        return Separators::One(Some(b';'));
    }
    if rows.iter().any(|row| row.contains(&b',')) { Separators::Unknown } else { Separators::One(None) }
}

fn one(separator: Option<u8>, rows: &[Vec<u8>], options: &TextOptions) -> Result<Dialect, String> {
    let [point, comma] = Dialect::both(separator);
    match options.decimal {
        Decimal::Point => return Ok(point),
        Decimal::Comma => return Ok(comma),
        Decimal::Auto if !rows.iter().any(|row| row.contains(&b',')) => return Ok(point),
        Decimal::Auto => {}
    }
    let (points, commas) = (Fit::new(point, rows), Fit::new(comma, rows));
    if points.all || points.rows > commas.rows {
        return Ok(point);
    }
    if commas.rows == 0 {
        return Err(unclear(rows));
    }
    if groups_thousands(&comma.split_all(rows)) {
        return Err(unclear(rows));
    }
    Ok(comma)
}

fn unknown(rows: &[Vec<u8>], titled: Option<usize>, options: &TextOptions) -> Result<Dialect, String> {
    let fit = |dialect| Fit::new(dialect, rows);
    let (commas, blanks) = (fit(Dialect::COMMAS), fit(Dialect::BLANKS));
    let (comma, inner) = (fit(Dialect::BLANKS_COMMA), fit(Dialect::COMMAS_COMMA));
    let named = options.columns.as_ref().map(Vec::len);
    match options.decimal {
        Decimal::Point if commas.all => Ok(commas.dialect),
        Decimal::Point if !blanks.all && fit(Dialect::LOOSE).is_scan(named) => Ok(Dialect::LOOSE),
        Decimal::Point => Ok(most([commas, blanks]).dialect),
        Decimal::Comma if inner.is_scan(named) && !comma.is_scan(named) => Ok(inner.dialect),
        Decimal::Comma => Ok(most([comma, inner]).dialect),
        // as many fields as titles, between the same commas
        Decimal::Auto if commas.all && titled.is_some() && titled == commas.shape.map(|s| s.0) => Ok(commas.dialect),
        Decimal::Auto if commas.all => {
            let other = inner.is_scan(named) && inner.shape.map(|s| s.0) != commas.shape.map(|s| s.0);
            if other || joins_decimals(&Dialect::COMMAS.split_all(rows)) {
                Err(unclear(rows))
            } else {
                Ok(commas.dialect)
            }
        }
        Decimal::Auto if blanks.all => Ok(blanks.dialect),
        Decimal::Auto if comma.is_scan(named) => {
            if groups_thousands(&comma.dialect.split_all(rows)) {
                Err(unclear(rows))
            } else {
                Ok(comma.dialect)
            }
        }
        Decimal::Auto if inner.is_scan(named) => Ok(inner.dialect),
        Decimal::Auto if fit(Dialect::LOOSE).is_scan(named) && joins_numbers(rows) => Ok(Dialect::LOOSE),
        Decimal::Auto => {
            // rows that do not fit are errors where they are decoded
            let best = most([commas, blanks, comma, inner]);
            if best.rows * 2 > rows.len() && best.numbers >= AXES { Ok(best.dialect) } else { Err(unclear(rows)) }
        }
    }
}

/// The one that fits most rows; the first of equal ones.
fn most<const N: usize>(fits: [Fit; N]) -> Fit {
    let better = |best: Fit, next: Fit| if next.rows > best.rows { next } else { best };
    let none = Fit { dialect: Dialect::BLANKS, rows: 0, all: false, numbers: 0, shape: None };
    let mut fits = fits.into_iter();
    let first = fits.next().unwrap_or(none);
    fits.fold(first, better)
}

fn unclear(rows: &[Vec<u8>]) -> String {
    format!("the comma in {} may be a decimal mark, or separate columns or thousands", example(rows))
}

/// `;` before `,` before blanks: a decimal comma needs another separator.
pub(super) fn usual_separator(line: &[u8]) -> Option<u8> {
    [b';', b','].into_iter().find(|s| line.contains(s))
}

/// The bytes outside of quotes.
fn without_quoted(line: &[u8]) -> Vec<u8> {
    line.split(|b| *b == b'"').step_by(2).flatten().copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(rows: &[&str], options: &TextOptions) -> Result<Dialect, String> {
        let rows: Vec<_> = rows.iter().map(|r| r.as_bytes().to_vec()).collect();
        detect(&rows, None, options).map(|(dialect, _)| dialect)
    }

    fn auto(rows: &[&str]) -> Result<Dialect, String> {
        found(rows, &TextOptions::default())
    }

    #[test]
    fn decimal_commas_are_found_between_blanks_tabs_and_semicolons() {
        for rows in [
            &["345678,123 5432109,456 87,250"][..],
            &["1,5\t2,5\t3,5", "-1,25 \t 2 3"],
            &["1,5 2,5 3,5", "1 2 3"],
            &["1 2 3", "1,5 2,5 3,5"],
            &["1,500 2,500 3,500"],
            &["0,123 12 1,500", "1,234 5,678 7,125"],
            &["1,5 2,5 3,5 24.12.2020 oak"],
        ] {
            assert_eq!(auto(rows), Ok(Dialect::BLANKS_COMMA), "{rows:?}");
        }
        let semicolons = Dialect { separator: Some(b';'), ..Dialect::BLANKS_COMMA };
        for rows in [&["1,5;2,5;3,5"][..], &["1;2;3", "1,5; 2,5 ;3"], &["\"1,5\";\"2,5\";3;\"a, b\""]] {
            assert_eq!(auto(rows), Ok(semicolons), "{rows:?}");
        }
        assert_eq!(auto(&["\"1,5\",\"2,5\",\"3,5\""]), Ok(Dialect::COMMAS_COMMA));
    }

    #[test]
    fn commas_alone_separate_and_points_stay_points() {
        for rows in [&["1,2,3"][..], &["1.5, 2.5, 3"], &["1.5,2.5,3.5,big tree"], &["1,5,2", "x,5,2"], &["1.5,2,,"]] {
            assert_eq!(auto(rows), Ok(Dialect::COMMAS), "{rows:?}");
        }
        for rows in [&["1 2 3"][..], &["1.5 2.5 3.5 a,b"], &["1 2 3", "1 2"]] {
            assert_eq!(auto(rows), Ok(Dialect::BLANKS), "{rows:?}");
        }
        assert_eq!(auto(&["1.5;2.5;3;a,b"]), Ok(Dialect::both(Some(b';'))[0]));
        assert_eq!(auto(&["1.5,2.5,3.5 255 0 0"]), Ok(Dialect::LOOSE));
        assert_eq!(auto(&["1,2,3 255 0 0"]), Ok(Dialect::LOOSE));
    }

    #[test]
    fn what_cannot_be_told_is_not_guessed() {
        for rows in [
            &["1,2 3"][..],
            &["1,5, 2,5, 3,5"],
            &["345678,123 5432109.456 87"],
            &["1,5;2.5;3,5"],
            &["345,678.12 5,432,109.46 87.25"],
            &["1.234,56 2.345,67 3.456,78"],
            &["1,234 5,678 87"],
            &["1,234;5,678;87"],
            &["5,432,109 1,234 87"],
            &["345678,123,5432109,056,87,250"],
            &["5,432,109 1,234 87 4"],
        ] {
            assert!(auto(rows).is_err(), "{rows:?}: {:?}", auto(rows));
        }
        assert!(auto(&["1,234 5,678 87"]).unwrap_err().contains("the comma in 1,234 may be"));
    }

    #[test]
    fn titles_between_commas_decide_if_there_is_one_for_each_field() {
        let titled = |row: &str, titles| {
            let rows = [row.as_bytes().to_vec()];
            detect(&rows, Some(titles), &TextOptions::default()).map(|(dialect, _)| dialect)
        };
        for row in ["345678,123,5432109,056,87,250", "1,2,3,4,5,6"] {
            assert_eq!(titled(row, 6), Ok(Dialect::COMMAS), "{row}");
        }
        assert!(titled("345678,123,5432109,056,87,250", 3).is_err());
        assert_eq!(titled("1,5 2,5 3,5", 3), Ok(Dialect::BLANKS_COMMA));
    }

    #[test]
    fn options_overrule_the_sample() {
        let point = TextOptions::default().decimal(Decimal::Point);
        let comma = TextOptions::default().decimal(Decimal::Comma);
        assert_eq!(found(&["1,5 2,5 3,5"], &point), Ok(Dialect::LOOSE));
        assert_eq!(found(&["1,5;2,5;3,5"], &point).map(|d| d.decimal), Ok(DecimalMark::Point));
        assert_eq!(found(&["1,234 5,678 87"], &comma), Ok(Dialect::BLANKS_COMMA));
        assert_eq!(found(&["1,5, 2,5, 3,5"], &comma), Ok(Dialect::COMMAS_COMMA));
        assert_eq!(found(&["1 2 3"], &comma), Ok(Dialect::BLANKS_COMMA));
        assert_eq!(found(&["1,5 2,5"], &TextOptions::default().columns(["x", "y"])), Ok(Dialect::BLANKS_COMMA));
        assert!(found(&["1,2 3,4"], &TextOptions::default().separator(',')).is_err());
        assert_eq!(
            found(&["1|2,5|3"], &TextOptions::default().separator('|')).map(|d| d.decimal),
            Ok(DecimalMark::Comma)
        );
    }
}
