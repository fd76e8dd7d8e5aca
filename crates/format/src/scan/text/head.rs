//! The lines before the first row, and a sample of the rows.

use super::column::Column;
use super::dialect::{Dialect, FieldKind, detect, usual_separator};
use super::index_column::{self, First};
use super::options::TextOptions;
use super::rows::{BOM, count, is_comment, is_data};
use super::titles::Titles;
use crate::scan::source::Source;
use crate::scan::tabular::ascii::parse;
use crate::scan::tabular::lines;
use crate::{Advice, Fault, ReadError, ScanWarning};

/// Lines that are looked at from the start of the file.
const MAX_HEAD: usize = 1000;
/// Other places in the file, their bytes, and the rows that are looked at there.
const PLACES: u64 = 16;
const PLACE_BYTES: u64 = 8 << 10;
const PLACE_ROWS: usize = 32;

/// What stands before the rows, and how these are written.
#[derive(Debug)]
pub(super) struct Head {
    titles: Option<Titles>,
    /// The first column is not of the points: it numbers or names the rows.
    pub(super) row_numbers: bool,
    /// Where the first row starts.
    pub(super) start: u64,
    pub(super) dialect: Dialect,
    /// For each column, whether it holds numbers.
    pub(super) numeric: Vec<bool>,
    /// Points that count lines before the first row declare, and how many such lines there are.
    pub(super) counts: (u64, u64),
    /// Rows from the first on without gaps.
    rows: Vec<Vec<u8>>,
    pub(super) warnings: Vec<ScanWarning>,
}

/// A line that is none of the rows.
enum Line {
    Comment,
    Count(u64),
    Titles,
}

impl Head {
    /// `counted`: lines of one whole number say how many rows follow them.
    pub(super) fn read(source: &Source, options: &TextOptions, counted: bool) -> Result<Self, ReadError> {
        let from = if source.vec_at(0, 3)? == BOM { BOM.len() as u64 } else { 0 };
        let lines = lines::first_filled(source, from, MAX_HEAD)?;
        let (mut comments, mut titles, mut counts) = (Vec::new(), None, (0u64, 0));
        let mut rows = lines.iter().map(|(at, line)| (*at, line.as_slice())).peekable();
        while let Some((_, line)) = rows.peek().copied() {
            match Line::of(line, counted, titles.is_none(), options) {
                Some(Line::Comment) => comments.push(line),
                Some(Line::Count(n)) => counts = (counts.0.saturating_add(n), counts.1 + 1),
                Some(Line::Titles) => titles = Some(line),
                None => break,
            }
            rows.next();
        }
        let rows: Vec<_> = rows.filter(|(_, line)| is_data(line) && !(counted && count(line).is_some())).collect();
        let Some((start, first)) = rows.first().copied() else {
            let what = "there are no lines of numbers";
            return Err(ReadError::broken(source.path(), from, what).advise(Advice::WrongFile));
        };
        let last = lines.last().map_or(start, |(at, line)| at + line.len() as u64);
        let mut sample: Vec<Vec<u8>> = rows.iter().map(|(_, line)| line.to_vec()).collect();
        let in_head = sample.len();
        sample.extend(elsewhere(source, last, counted)?);
        if let Some(named) = options.separator.filter(|named| !sample.iter().any(|row| has_separator(row, *named))) {
            let what = format!("no row has the separator {named:?} that was named");
            return Err(ReadError::broken(source.path(), start, Fault::Row(what)).advise(Advice::DetectSeparator));
        }
        let has_commas = |line: &&[u8]| line.contains(&b',') && !line.contains(&b';');
        let titled = titles.filter(has_commas).map(|line| Titles::of_line(line, 0, Some(b',')).len());
        let (dialect, warning) = detect(&sample, titled, options)
            .map_err(|what| ReadError::broken(source.path(), start, Fault::Row(what)).advise(Advice::DecimalMark))?;
        let numeric = numeric(dialect, &sample);
        let in_first = dialect.kinds(first).into_iter().filter(|k| matches!(k, FieldKind::Number | FieldKind::Empty));
        if in_first.count() < 2 || numeric.iter().filter(|n| **n).count() < 2 {
            let what = format!("the line {:?} is no row of numbers", shown(first));
            return Err(ReadError::broken(source.path(), start, what)
                .advise("only one header line is skipped; delete the others or start them with #"));
        }
        sample.truncate(in_head);
        let columns = numeric.len();
        let titles = match titles {
            Some(line) => Some(Titles::of_line(line, columns, dialect.separator)),
            None => comments.iter().rev().find_map(|line| Titles::of_comment(line, columns, dialect.separator)),
        };
        let mut head = Self {
            titles,
            row_numbers: false,
            start,
            dialect,
            numeric,
            counts,
            rows: sample,
            warnings: warning.into_iter().collect(),
        };
        if let Some((second, _)) = rows.get(1) {
            head.pass_numeric_titles(*second);
        }
        Ok(head)
    }

    /// pandas and R number columns without names: 0, 1, 2 above rows with decimals (or in quotes) is no point.
    fn pass_numeric_titles(&mut self, second: u64) {
        if self.titles.is_some() || !index_column::are_numeric_titles(self.dialect, &self.rows) {
            return;
        }
        let first = self.rows.remove(0);
        self.row_numbers = self.dialect.split(&first).first().is_some_and(Vec::is_empty);
        self.start = second;
        self.warnings.push(ScanWarning::TitlesOfNumbers { line: shown(&first) });
    }

    /// The columns by name: as given, else by the titles. `None`: neither; the row's own number of columns decides.
    pub(super) fn columns(&mut self, source: &Source, options: &TextOptions) -> Result<Option<Vec<Column>>, ReadError> {
        let count = self.numeric.len();
        if let Some(names) = &options.columns {
            let columns: Result<Vec<_>, String> = names.iter().map(|n| Column::named(n)).collect();
            let columns = columns.map_err(|what| ReadError::unsupported(source.path(), what))?;
            return if columns.len() == count { Ok(Some(columns)) } else { Err(self.mismatch(source, names)) };
        }
        self.row_numbers = self.has_row_numbers();
        if self.row_numbers {
            self.warnings.push(ScanWarning::RowNumbersIgnored);
            self.numeric[0] = false;
        }
        let Some(titles) = &mut self.titles else { return Ok(None) };
        if self.row_numbers && titles.len() == count {
            titles.drop_first();
        }
        if titles.len() + usize::from(self.row_numbers) != count {
            let names = titles.names().to_vec();
            return Err(self.mismatch(source, &names));
        }
        let mut columns = titles.columns(&mut self.warnings);
        if self.row_numbers {
            columns.insert(0, Column::padding());
        }
        Ok(Some(columns))
    }

    fn has_row_numbers(&self) -> bool {
        let first = First::of(self.dialect, &self.rows);
        match &self.titles {
            None => self.row_numbers || first.counts_rows_without_titles(),
            Some(titles) if titles.len() == self.numeric.len() => titles.lack_the_first() && first.is_whole_or_words(),
            Some(titles) => titles.len() + 1 == self.numeric.len() && first.numbers_or_names_rows(),
        }
    }

    /// True if the colours are of 0–1 by their titles.
    pub(super) fn have_unit_colours(&self) -> bool {
        self.titles.as_ref().is_some_and(Titles::have_unit_colours)
    }

    fn mismatch(&self, source: &Source, names: &[String]) -> ReadError {
        let count = self.numeric.len();
        let shown: String = names.join(", ").chars().take(100).collect();
        let what = format!("{} columns are named ({shown}) but the row has {count}", names.len());
        let error = ReadError::broken(source.path(), self.start, what);
        // x,y,z above 1,5,2,5,3,5
        if count == 2 * names.len() && self.dialect == Dialect::COMMAS {
            return error.advise("its commas may be decimal marks; export it with another separator");
        }
        error.advise("name every column in order, - for those to leave out")
    }
}

impl Line {
    /// `None`: a row.
    fn of(line: &[u8], counted: bool, may_be_titles: bool, options: &TextOptions) -> Option<Self> {
        if is_comment(line) {
            return Some(Self::Comment);
        }
        if let Some(n) = count(line).filter(|_| counted) {
            return Some(Self::Count(n));
        }
        (may_be_titles && is_titles(line, options)).then_some(Self::Titles)
    }
}

/// True if a data line has less than two numbers, or names x and y.
fn is_titles(line: &[u8], options: &TextOptions) -> bool {
    let bare = |field: &[u8]| field.iter().copied().filter(|b| *b != b'"').collect::<Vec<_>>();
    let given = options.separator.and_then(|s| u8::try_from(s).ok());
    let separates = |b: &u8| *b <= b' ' || b",;".contains(b) || Some(*b) == given;
    let fields = line.split(separates).map(bare).filter(|f| !f.is_empty());
    let (mut all, mut numbers) = (0, 0);
    fields.for_each(|field| {
        all += 1;
        numbers += usize::from(parse(&field).is_ok());
    });
    let separator = given.or_else(|| usual_separator(line));
    numbers < all && (numbers < 2 || Titles::of_line(line, all, separator).name_x_and_y())
}

/// Titles in these lines above a row: whether they name x and y. `None`: there are none.
pub(super) fn titles_name_x_and_y(lines: &[&[u8]]) -> Option<bool> {
    let options = TextOptions::default();
    let mut data = lines.iter().copied().filter(|line| is_data(line));
    let (first, second) = (data.next()?, data.next()?);
    let columns = super::rows::fields(second, usual_separator(second)).len();
    is_titles(first, &options).then(|| Titles::of_line(first, columns, usual_separator(first)).name_x_and_y())
}

/// Rows from places behind byte `from`.
fn elsewhere(source: &Source, from: u64, counted: bool) -> Result<Vec<Vec<u8>>, ReadError> {
    let mut rows = Vec::new();
    let left = source.len().saturating_sub(from);
    if left < PLACES * PLACE_BYTES {
        return Ok(rows);
    }
    for place in 1..=PLACES {
        let bytes = source.vec_at(from + (left - PLACE_BYTES) / PLACES * place, PLACE_BYTES)?;
        let Some(end) = memchr::memrchr(lines::line_end(&bytes), &bytes) else { continue };
        let whole = lines::lines(&bytes[..end]).skip(1).map(|(_, line)| line);
        let data = whole.filter(|line| is_data(line) && lines::is_filled(line) && !(counted && count(line).is_some()));
        rows.extend(data.take(PLACE_ROWS).map(<[u8]>::to_vec));
    }
    Ok(rows)
}

/// Which columns hold numbers: those where not most rows have words, so that a damaged row is an error where it is read.
fn numeric(dialect: Dialect, sample: &[Vec<u8>]) -> Vec<bool> {
    let kinds: Vec<_> = sample.iter().map(|row| dialect.kinds(row)).collect();
    let Some(mut width) = kinds.first().map(Vec::len) else { return Vec::new() };
    // a last field that is empty shows in other rows only
    let is_open = dialect.separator.is_some_and(|s| sample[0].trim_ascii_end().last() == Some(&s));
    width += usize::from(is_open && kinds.iter().any(|row| row.len() == width + 1));
    let count = |i: usize, is_it: fn(&FieldKind) -> bool| {
        kinds.iter().filter_map(|row| row.get(i)).filter(|k| is_it(k)).count()
    };
    let has_words =
        |i: usize| count(i, |k| *k == FieldKind::Words) > count(i, |k| matches!(k, FieldKind::Number | FieldKind::Odd));
    (0..width).map(|i| !has_words(i)).collect()
}

/// True if the row has the separator; blanks of any kind are one.
fn has_separator(row: &[u8], separator: char) -> bool {
    match u8::try_from(separator) {
        Ok(b'\t' | b' ') => row.trim_ascii().iter().any(|b| matches!(b, b'\t' | b' ')),
        Ok(separator) => row.contains(&separator),
        Err(_) => false,
    }
}

fn shown(line: &[u8]) -> String {
    String::from_utf8_lossy(line).chars().take(40).collect()
}
