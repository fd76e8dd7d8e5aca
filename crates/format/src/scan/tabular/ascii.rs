//! Rows written as text to columns.

use super::binary::{Misfit, harmonic_colour, out_of_range, unpack};
use super::number::{Number, count_change, unit_to_u16};
use super::schema::{Field, Rule, Target};
use crate::{AttributeType, Changes, Column, Element, PointBatch, Positions, Wanted};

/// How the numbers of a line are set apart: by blanks, and by this byte if there is one.
pub(crate) type Separator = Option<u8>;

/// Writes lines to a batch.
pub(crate) struct RowParser<'a> {
    pub(crate) fields: &'a [Field],
    pub(crate) wanted: &'a Wanted,
    pub(crate) separator: Separator,
    /// See [`Tokens::strict`].
    pub(crate) strict: bool,
    /// Least fields per line; missing ones are 0.
    pub(crate) least: usize,
    /// Elements of each column.
    pub(crate) elements: &'a [usize],
}

impl RowParser<'_> {
    /// Writes a line to row `row` of the batch, whose columns have room.
    pub(crate) fn row(&self, line: &[u8], row: usize, batch: &mut PointBatch) -> Result<(), Misfit> {
        let mut tokens = Tokens { line, at: 0, separator: self.separator, strict: self.strict };
        self.numbers(&mut tokens, row, batch)?;
        let at = tokens.start();
        if !tokens.is_empty() {
            let need = self.fields.len();
            return Err(Misfit {
                row,
                at,
                what: format!("the line has more than the {need} numbers that are expected"),
            });
        }
        Ok(())
    }

    /// Writes the next numbers, as many as a row has.
    #[inline]
    pub(crate) fn numbers(&self, tokens: &mut Tokens<'_>, row: usize, batch: &mut PointBatch) -> Result<(), Misfit> {
        let fail = |at, what| Misfit { row, at, what };
        for (i, field) in self.fields.iter().enumerate() {
            let at = tokens.start();
            let is_missing = at == tokens.line.len();
            if is_missing && i >= self.least {
                self.field(field, &mut Tokens::of(b"0"), row, batch).map_err(|what| fail(at, what))?;
                continue;
            }
            if is_missing && i + 1 == self.fields.len() && tokens.ends_with_separator() {
                // the last field is empty, which is NaN as anywhere else in the line
                self.field(field, &mut Tokens::of(b""), row, batch).map_err(|what| fail(at, what))?;
                continue;
            }
            if is_missing {
                let need = self.fields.len();
                return Err(fail(at, format!("the line has {i} numbers, {need} are expected")));
            }
            self.field(field, tokens, row, batch).map_err(|what| fail(at, what))?;
        }
        Ok(())
    }

    #[inline]
    fn field(&self, field: &Field, tokens: &mut Tokens<'_>, row: usize, batch: &mut PointBatch) -> Result<(), String> {
        match field.target {
            Target::Axis(axis) => {
                let v = tokens.number()?;
                if let Positions::World(xyz) = &mut batch.positions
                    && let Some(out) = xyz[axis].get_mut(row)
                {
                    *out = v;
                }
            }
            Target::Value { column, element, rule } if self.wanted.is_wanted(column) => {
                let index = row * self.elements[column] + element;
                if let Some(v) = self.value(field.ty, rule, tokens, index, &mut batch.columns[column])? {
                    let mut changes = Changes::default();
                    count_change(v, rule == Rule::Unit, &mut changes);
                    batch.count_changes(column, &changes);
                }
            }
            Target::Packed { column, alpha } => {
                let start = tokens.start();
                let v = tokens.number()?;
                let bits = packed_bits(&tokens.line[start..tokens.at], v, field.ty);
                if bits.is_none() && self.wanted.is_wanted(column) {
                    batch.count_changes(column, &Changes { not_finite: 1, ..Changes::default() });
                }
                let (rgb, a) = unpack(bits.unwrap_or(0));
                put(&mut batch.columns[column], row * 3, rgb);
                if let Some(alpha) = alpha {
                    put(&mut batch.columns[alpha], row, [a]);
                }
            }
            Target::Harmonic { value, colour, element } => {
                let v = tokens.number()?;
                match &mut batch.columns[value] {
                    Column::Float32(out) => store(out, row, v as f32),
                    Column::Float64(out) => store(out, row, v),
                    _ => {}
                }
                if let Column::UInt16(out) = &mut batch.columns[colour] {
                    store(out, row * 3 + element, harmonic_colour(v));
                }
            }
            Target::List => {
                let count = tokens.number()?;
                // a count beyond the line ends with it
                for _ in 0..count.min(tokens.line.len() as f64) as usize {
                    tokens.skip();
                }
            }
            Target::Skip | Target::Value { .. } => tokens.skip(),
        }
        Ok(())
    }

    /// Stores the next number; `Some` if its column cannot hold it as it is.
    #[inline]
    fn value(
        &self,
        ty: AttributeType,
        rule: Rule,
        tokens: &mut Tokens<'_>,
        index: usize,
        column: &mut Column,
    ) -> Result<Option<f64>, String> {
        macro_rules! integer {
            ($out:ident, $t:ty) => {{
                let Some(v) = tokens.integer(ty)? else {
                    store($out, index, 0);
                    return Ok(Some(f64::NAN));
                };
                store(
                    $out,
                    index,
                    <$t>::try_from(v).map_err(|_| format!("{v} does not fit the type {}", ty.potree_name()))?,
                );
            }};
        }
        match (rule, column) {
            (_, Column::Float64(out)) => store(out, index, tokens.number()?),
            (_, Column::Float32(out)) => store(out, index, tokens.number()? as f32),
            (Rule::Unit, Column::UInt16(out)) => {
                return store_checked(out, index, tokens.number()?, rule, unit_to_u16);
            }
            (Rule::Shift, Column::UInt16(out)) => {
                return store_checked(out, index, tokens.number()?, rule, |v| (v + 2048.0).as_u16());
            }
            (Rule::Convert, Column::UInt16(out)) => {
                return store_checked(out, index, tokens.number()?, rule, f64::as_u16);
            }
            (Rule::Convert, Column::UInt8(out)) => {
                return store_checked(out, index, tokens.number()?, rule, f64::as_u8);
            }
            (_, Column::Int8(out)) => integer!(out, i8),
            (_, Column::UInt8(out)) => integer!(out, u8),
            (_, Column::Int16(out)) => integer!(out, i16),
            (_, Column::UInt16(out)) => integer!(out, u16),
            (_, Column::Int32(out)) => integer!(out, i32),
            (_, Column::UInt32(out)) => integer!(out, u32),
            (_, Column::Int64(out)) => integer!(out, i64),
            (_, Column::UInt64(out)) => integer!(out, u64),
        }
        Ok(None)
    }
}

/// The bits of a packed colour that was written as the number `v`, which `text` starts with.
///
/// PCL writes a float's colour as that float, or as the integer of its bits under the type F: digits alone are the bits.
/// `None`: NaN, which has lost them.
#[inline]
fn packed_bits(text: &[u8], v: f64, ty: AttributeType) -> Option<u32> {
    let is_digits = !text.iter().any(|b| matches!(b, b'.' | b'a'..=b'z' | b'A'..=b'Z'));
    if ty == AttributeType::Float32 && !is_digits {
        // not by way of a double: that would round twice
        let single = fast_float2::parse_partial::<f32, _>(text).map_or(v as f32, |(v, _)| v);
        return (!single.is_nan()).then(|| single.to_bits());
    }
    Some(if v < 0.0 { v as i32 as u32 } else { v as u32 })
}

fn store<T>(out: &mut [T], index: usize, v: T) {
    if let Some(out) = out.get_mut(index) {
        *out = v;
    }
}

/// Stores a converted number; `Some` if that is not the number itself.
fn store_checked<T: Number>(
    out: &mut [T],
    index: usize,
    v: f64,
    rule: Rule,
    convert: impl Fn(f64) -> Option<T>,
) -> Result<Option<f64>, String> {
    let stored = convert(v).ok_or_else(|| out_of_range(v, rule))?;
    store(out, index, stored);
    let is_kept = match rule {
        Rule::Unit => (0.0..=1.0).contains(&v),
        Rule::Harmonic => !v.is_nan(),
        Rule::Shift => stored.as_f64() - 2048.0 == v,
        Rule::Keep | Rule::Convert => stored.as_f64() == v,
    };
    Ok((!is_kept).then_some(v))
}

/// Values side by side, if the column is of their type and not omitted.
fn put<T: Element, const N: usize>(column: &mut Column, at: usize, values: [T; N]) {
    if let Some(out) = column.values_mut::<T>().and_then(|v| v.get_mut(at..at + N)) {
        out.copy_from_slice(&values);
    }
}

/// A line, read from left to right.
pub(crate) struct Tokens<'a> {
    pub(crate) line: &'a [u8],
    pub(crate) at: usize,
    pub(crate) separator: Separator,
    /// Blanks alone do not separate where there is a separator: text may hold them, numbers may not.
    pub(crate) strict: bool,
}

impl<'a> Tokens<'a> {
    /// Numbers between blanks.
    pub(crate) fn of(line: &'a [u8]) -> Self {
        Self { line, at: 0, separator: None, strict: false }
    }

    /// True if the line ends with a separator, so that its last field is empty.
    fn ends_with_separator(&self) -> bool {
        self.strict && self.separator.is_some() && self.line.trim_ascii_end().last().copied() == self.separator
    }

    /// Passes over blanks; where the next token starts.
    #[inline]
    fn start(&mut self) -> usize {
        while self.line.get(self.at).is_some_and(|b| *b <= b' ') {
            self.at += 1;
        }
        self.at
    }

    /// True at the end of the line.
    pub(crate) fn is_empty(&mut self) -> bool {
        self.start() == self.line.len()
    }

    #[inline]
    fn ends_token(&self, b: u8) -> bool {
        b <= b' ' || Some(b) == self.separator
    }

    /// The bytes up to the next separator, which is skipped; without quotes.
    pub(crate) fn token(&mut self) -> &'a [u8] {
        self.ended_token().0
    }

    /// The same, and false if a strict line goes on without a separator.
    fn ended_token(&mut self) -> (&'a [u8], bool) {
        let start = self.start();
        let rest = &self.line[start..];
        if rest.first() == Some(&b'"') {
            let len = quoted_len(&rest[1..]);
            self.at = (start + len + 2).min(self.line.len());
            return (&rest[1..=len], self.pass_separator());
        }
        let len = match self.separator.filter(|_| self.strict) {
            Some(separator) => memchr::memchr(separator, rest).unwrap_or(rest.len()),
            None => rest.iter().position(|b| self.ends_token(*b)).unwrap_or(rest.len()),
        };
        self.at = start + len;
        (rest[..len].trim_ascii_end(), self.pass_separator())
    }

    /// False if a strict line goes on without a separator.
    #[inline]
    fn pass_separator(&mut self) -> bool {
        if self.separator.is_none() {
            return true;
        }
        match self.line.get(self.start()).copied() {
            None => true,
            next if next == self.separator => {
                self.at += 1;
                true
            }
            Some(_) => !self.strict,
        }
    }

    fn skip(&mut self) {
        self.token();
    }

    /// The next number; an empty field between separators is NaN.
    #[inline]
    fn number(&mut self) -> Result<f64, String> {
        let start = self.start();
        if let Some((v, len)) = short_decimal(&self.line[start..], self.separator) {
            self.at = start + len;
            if self.pass_separator() {
                return Ok(v);
            }
            self.at = start;
        }
        self.any_number(start)
    }

    #[cold]
    fn any_number(&mut self, start: usize) -> Result<f64, String> {
        if let Ok((v, len)) = fast_float2::parse_partial::<f64, _>(&self.line[start..]) {
            let end = start + len;
            if self.line.get(end).is_none_or(|b| self.ends_token(*b)) {
                self.at = end;
                if self.pass_separator() {
                    return Ok(v);
                }
                self.at = start;
            }
        }
        match self.ended_token() {
            (token, true) => parse(token),
            (token, false) => Err(format!("\"{}\" is not followed by a separator", String::from_utf8_lossy(token))),
        }
    }

    /// The next number as an integer of up to 64 bits; "255.0" is one. `None`: not a number, or an empty field.
    fn integer(&mut self, ty: AttributeType) -> Result<Option<i128>, String> {
        let v = if ty.size() < 8 {
            self.number()?
        } else {
            let token = self.token();
            if let Some(v) = std::str::from_utf8(token).ok().and_then(|t| t.parse().ok()) {
                return Ok(Some(v));
            }
            parse(token)?
        };
        match v {
            v if v.is_nan() => Ok(None),
            v if v.fract() != 0.0 => Err(format!("{v} is not an integer")),
            v => Ok(Some(v as i128)),
        }
    }
}

/// Powers of ten that doubles hold exactly, as far as they are needed.
const POWERS: [f64; 16] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15];

/// A number of at most 15 digits without exponent, and its bytes: nearly all that text scans hold.
///
/// Its digits as an integer and the power of ten are exact in double precision, so that one division rounds it
/// correctly (W. Clinger, "How to Read Floating Point Numbers Accurately", 1990). Twice as fast as the general way.
#[inline]
fn short_decimal(bytes: &[u8], separator: Separator) -> Option<(f64, usize)> {
    let negative = bytes.first() == Some(&b'-');
    let (mut digits, mut count, mut point, mut at) = (0u64, 0usize, None, usize::from(negative));
    while let Some(b) = bytes.get(at) {
        let digit = b.wrapping_sub(b'0');
        if digit <= 9 {
            digits = digits.wrapping_mul(10).wrapping_add(u64::from(digit));
            count += 1;
        } else if *b == b'.' && point.is_none() {
            point = Some(count);
        } else if *b <= b' ' || Some(*b) == separator {
            break;
        } else {
            return None;
        }
        at += 1;
    }
    if !(1..=15).contains(&count) {
        return None;
    }
    let decimals = point.map_or(0, |p| count - p);
    let v = digits as f64 / POWERS[decimals];
    Some((if negative { -v } else { v }, at))
}

/// Bytes up to the closing quote; a doubled quote is one of the text.
fn quoted_len(rest: &[u8]) -> usize {
    let mut at = 0;
    while let Some(quote) = memchr::memchr(b'"', rest.get(at..).unwrap_or_default()) {
        if rest.get(at + quote + 1) != Some(&b'"') {
            return at + quote;
        }
        at += quote + 2;
    }
    rest.len()
}

/// What R, pandas and databases write for "no value".
const NO_VALUE: [&[u8]; 8] = [b"NA", b"N/A", b"#N/A", b"<NA>", b"NULL", b"Null", b"null", b"None"];

/// A number in any spelling; Microsoft's runtime writes NaN and infinity as "1.#IND", "-1.#INF".
pub(crate) fn parse(token: &[u8]) -> Result<f64, String> {
    if let Ok(v) = fast_float2::parse::<f64, _>(token) {
        return Ok(v);
    }
    if token.is_empty() || NO_VALUE.contains(&token) {
        return Ok(f64::NAN);
    }
    let unsigned = token.strip_prefix(b"-").unwrap_or(token);
    if unsigned.starts_with(b"1.#INF") {
        return Ok(if unsigned.len() < token.len() { f64::NEG_INFINITY } else { f64::INFINITY });
    }
    if unsigned.starts_with(b"1.#") {
        return Ok(f64::NAN);
    }
    let shown: String = String::from_utf8_lossy(token).chars().take(40).flat_map(char::escape_default).collect();
    Err(format!("\"{shown}\" is not a number"))
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    fn numbers(line: &str, separator: Separator) -> Result<Vec<f64>, String> {
        read(&mut Tokens { line: line.as_bytes(), at: 0, separator, strict: false })
    }

    fn strict(line: &str) -> Result<Vec<f64>, String> {
        read(&mut Tokens { line: line.as_bytes(), at: 0, separator: Some(b','), strict: true })
    }

    fn read(tokens: &mut Tokens<'_>) -> Result<Vec<f64>, String> {
        let mut list = Vec::new();
        while !tokens.is_empty() {
            list.push(tokens.number()?);
        }
        Ok(list)
    }

    #[test]
    fn numbers_are_read_in_their_usual_spellings() {
        let line = " 1 -2.5 +3 1e3\t.5 5. 123456789012345678 inf 1.#INF -1.#INF ";
        let expected = [1.0, -2.5, 3.0, 1000.0, 0.5, 5.0, 123456789012345678.0];
        let list = numbers(line, None).unwrap();
        assert_eq!(list[..7], expected);
        assert_eq!(list[7..], [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY]);
        assert!(numbers("nan NaN -nan 1.#IND -1.#QNAN", None).unwrap().iter().all(|v| v.is_nan()));
    }

    #[test]
    fn a_separator_may_have_blanks_around_it_and_quotes_are_dropped() {
        assert_eq!(numbers("1 , 2,3", Some(b',')).unwrap(), [1.0, 2.0, 3.0]);
        assert_eq!(numbers("\"1.5\";\"2\";", Some(b';')).unwrap(), [1.5, 2.0]);
        assert!(numbers("1,,3", Some(b',')).unwrap()[1].is_nan());
    }

    #[test]
    fn what_is_no_number_is_shown() {
        assert_eq!(numbers("1 two", None), Err("\"two\" is not a number".to_owned()));
        assert_eq!(numbers("1.5x", None), Err("\"1.5x\" is not a number".to_owned()));
        assert_eq!(numbers("1,2", None), Err("\"1,2\" is not a number".to_owned()));
    }

    #[test]
    fn blanks_alone_separate_only_where_the_line_is_not_strict() {
        assert_eq!(strict("1 , 2,3 ").unwrap(), [1.0, 2.0, 3.0]);
        assert_eq!(numbers("1,5 2", Some(b',')).unwrap(), [1.0, 5.0, 2.0]);
        for line in ["1,5 2", "1,1e3 2", "1,\"5\" 2"] {
            assert!(strict(line).is_err(), "{line}");
        }
        let mut tokens =
            Tokens { line: b"\"a \"\"b\"\", c\", 1 Jan 2020 , 7", at: 0, separator: Some(b','), strict: true };
        assert_eq!([tokens.token(), tokens.token(), tokens.token()], [&b"a \"\"b\"\", c"[..], b"1 Jan 2020", b"7"]);
    }

    #[test]
    fn what_stands_for_no_value_is_nan() {
        assert!(strict("NA,,NULL,<NA>,None,N/A").unwrap().iter().all(|v| v.is_nan()));
        assert!(numbers("NAN1", None).is_err());
    }

    #[test]
    fn packed_colours_are_read_as_float_and_as_integer() {
        let bits =
            |text: &str, ty| packed_bits(text.as_bytes(), parse(text.trim().as_bytes()).unwrap(), ty).unwrap_or(7);
        let float = |text: &str| bits(text, AttributeType::Float32);
        assert_eq!((float("4.2108e+06"), float("4210800.0")), (0x4a80_80e0, 0x4a80_80e0));
        assert_eq!((float("4210800 "), float("-8355712")), (4_210_800, (-8_355_712i32) as u32));
        assert_eq!(float("8.206463e-39"), 0x0059_5c48);
        assert_eq!((float("0"), float("1.4e-45"), float("-1.7146522e+38")), (0, 1, 0xff00_ff00));
        assert_eq!((float("nan"), float("inf"), float("-inf")), (7, 0x7f80_0000, 0xff80_0000));
        assert_eq!(bits("-1", AttributeType::Int32), u32::MAX);
        assert_eq!(
            (bits("4286611584", AttributeType::UInt32), bits("16777215.0", AttributeType::UInt32)),
            (4_286_611_584, 0xff_ffff)
        );
    }

    #[test]
    fn the_short_way_gives_the_bits_of_the_long_one() {
        let mut random = Random::new(7);
        for _ in 0..20_000 {
            let decimals = random.index(16);
            let text = format!("{:.decimals$}", random.between(-5000.0, 12_592.0));
            if let Some((v, len)) = short_decimal(text.as_bytes(), None) {
                assert_eq!((v.to_bits(), len), (text.parse::<f64>().unwrap().to_bits(), text.len()), "{text}");
            }
        }
        assert_eq!(short_decimal(b"-0.5,", Some(b',')), Some((-0.5, 4)));
        for other in ["", "-", ".", "1e3", "1.2.3", "1234567890123456", "0x1"] {
            assert_eq!(short_decimal(other.as_bytes(), None), None, "{other}");
        }
    }

    #[test]
    fn wide_integers_keep_every_bit() {
        let mut tokens = Tokens::of(b"18446744073709551615 2.0");
        assert_eq!(tokens.integer(AttributeType::UInt64), Ok(Some(i128::from(u64::MAX))));
        assert_eq!(tokens.integer(AttributeType::Int64), Ok(Some(2)));
    }
}
