//! A pull parser for JSON of any length: it holds one token and 64 KiB of text, knows the byte it is at, and never
//! recurses, so that neither the size nor the depth of an index can do harm.

use std::io;

use super::ByteSource;
use super::node::MAX_DEPTH;

/// Bytes read at a time.
const CHUNK: u64 = 64 << 10;

/// The longest string, number or header value; all that are meant are far shorter.
const MAX_TOKEN: usize = 16 << 20;

/// Why parsing stopped.
#[derive(Debug)]
pub(super) enum Fault {
    /// The byte at which it is wrong, and what.
    Broken(u64, String),
    /// The byte at which it is something that this version does not read, and what.
    Unsupported(u64, String),
    /// The source could not be read.
    Io(io::Error),
}

impl Fault {
    /// The same at byte `at`.
    pub(super) fn at(self, at: u64) -> Self {
        match self {
            Self::Broken(_, what) => Self::Broken(at, what),
            Self::Unsupported(_, what) => Self::Unsupported(at, what),
            Self::Io(e) => Self::Io(e),
        }
    }
}

/// The text of one file, read from its front.
pub(super) struct Json<'a> {
    source: &'a dyn ByteSource,
    file: &'a str,
    size: u64,
    /// Text that was read, from byte `start` of the file on, and the place in it.
    chunk: Vec<u8>,
    start: u64,
    at: usize,
    /// The last string (without escapes) or number.
    token: Vec<u8>,
    /// What [`Self::value`] has passed, while it does.
    captured: Option<Vec<u8>>,
}

impl<'a> Json<'a> {
    pub(super) fn new(source: &'a dyn ByteSource, file: &'a str) -> Result<Self, Fault> {
        let size = source.size(file).map_err(Fault::Io)?;
        let mut json =
            Self { source, file, size, chunk: Vec::new(), start: 0, at: 0, token: Vec::new(), captured: None };
        json.raw()?;
        if json.chunk.starts_with(b"\xef\xbb\xbf") {
            json.at = 3;
        }
        Ok(json)
    }

    /// The byte of the file that comes next.
    pub(super) fn position(&self) -> u64 {
        self.start + self.at as u64
    }

    pub(super) fn broken<T>(&self, what: impl Into<String>) -> Result<T, Fault> {
        Err(Fault::Broken(self.position(), what.into()))
    }

    /// The next byte, if there is one; it stays.
    fn raw(&mut self) -> Result<Option<u8>, Fault> {
        if self.at == self.chunk.len() {
            self.start += self.chunk.len() as u64;
            self.at = 0;
            self.chunk.resize(CHUNK.min(self.size.saturating_sub(self.start)) as usize, 0);
            self.source.read_at(self.file, self.start, &mut self.chunk).map_err(Fault::Io)?;
        }
        Ok(self.chunk.get(self.at).copied())
    }

    fn advance(&mut self) -> Result<(), Fault> {
        if let (Some(text), Some(&byte)) = (&mut self.captured, self.chunk.get(self.at)) {
            text.push(byte);
            if text.len() > MAX_TOKEN {
                return self.broken("is a value of more than 16 MiB");
            }
        }
        self.at += 1;
        Ok(())
    }

    /// The next byte that is not white space; it stays.
    pub(super) fn peek(&mut self) -> Result<u8, Fault> {
        loop {
            match self.raw()? {
                Some(b' ' | b'\t' | b'\n' | b'\r') => self.advance()?,
                Some(byte) => return Ok(byte),
                None => return self.broken("the text ends too early: the file was cut short"),
            }
        }
    }

    /// Takes the byte `expected`, which may stand behind white space.
    pub(super) fn expect(&mut self, expected: u8) -> Result<(), Fault> {
        match self.peek()? {
            byte if byte == expected => self.advance(),
            byte => self.broken(format!("expected '{}', found '{}'", char::from(expected), byte.escape_ascii())),
        }
    }

    /// Checks that only white space is left.
    pub(super) fn end(&mut self) -> Result<(), Fault> {
        while let Some(byte) = self.raw()? {
            if !byte.is_ascii_whitespace() {
                return self.broken("there is text behind the end of the JSON object");
            }
            self.advance()?;
        }
        Ok(())
    }

    /// In an array or object that ends with `close`: true if another element comes, whose comma is taken; false if the
    /// end was taken. `first`: none was taken before.
    pub(super) fn another(&mut self, close: u8, first: bool) -> Result<bool, Fault> {
        match self.peek()? {
            byte if byte == close => self.advance().map(|()| false),
            b',' if !first => self.advance().map(|()| true),
            _ if first => Ok(true),
            byte => {
                let (close, byte) = (char::from(close), byte.escape_ascii());
                self.broken(format!("expected ',' or '{close}', found '{byte}'"))
            }
        }
    }

    /// The next key of an object and its colon, or nothing if the object ended.
    pub(super) fn key(&mut self, first: bool) -> Result<Option<&str>, Fault> {
        if !self.another(b'}', first)? {
            return Ok(None);
        }
        self.string()?;
        self.expect(b':')?;
        Ok(Some(std::str::from_utf8(&self.token).unwrap_or_default())) // `string` has checked it
    }

    /// A string, without its escapes.
    pub(super) fn string(&mut self) -> Result<&str, Fault> {
        self.expect(b'"')?;
        self.token.clear();
        loop {
            if self.token.len() > MAX_TOKEN {
                return self.broken("is a string of more than 16 MiB");
            }
            match self.raw()? {
                Some(b'"') => break,
                Some(b'\\') => self.escape()?,
                Some(byte) if byte >= 0x20 => {
                    self.token.push(byte);
                    self.advance()?;
                }
                Some(_) => return self.broken("there is a control character in a string"),
                None => return self.broken("the text ends in a string: the file was cut short"),
            }
        }
        self.advance()?;
        let position = self.position();
        std::str::from_utf8(&self.token).map_err(|_| Fault::Broken(position, "the string before is not UTF-8".into()))
    }

    fn escape(&mut self) -> Result<(), Fault> {
        self.advance()?;
        let byte = self.raw()?;
        let character = match byte {
            Some(b'"' | b'\\' | b'/') => char::from(byte.unwrap_or_default()),
            Some(b'b') => '\u{8}',
            Some(b'f') => '\u{c}',
            Some(b'n') => '\n',
            Some(b'r') => '\r',
            Some(b't') => '\t',
            Some(b'u') => {
                let unit = self.unit()?;
                let low = if (0xd800..0xdc00).contains(&unit) && self.raw()? == Some(b'\\') {
                    self.advance()?;
                    self.unit()?
                } else {
                    0
                };
                let units = if low == 0 { vec![unit] } else { vec![unit, low] };
                let character = char::decode_utf16(units).next().and_then(Result::ok);
                let Some(character) = character else { return self.broken("an escape is half a character") };
                self.token.extend_from_slice(character.encode_utf8(&mut [0; 4]).as_bytes());
                return Ok(());
            }
            _ => return self.broken("an escape in a string is not of JSON"),
        };
        self.token.extend_from_slice(character.encode_utf8(&mut [0; 4]).as_bytes());
        self.advance()
    }

    /// `u` and four digits.
    fn unit(&mut self) -> Result<u16, Fault> {
        if self.raw()? != Some(b'u') {
            return self.broken("an escape is half a character");
        }
        self.advance()?;
        let mut unit = 0;
        for _ in 0..4 {
            let digit = self.raw()?.and_then(|b| char::from(b).to_digit(16));
            let Some(digit) = digit else { return self.broken("an escape in a string is not of JSON") };
            unit = unit << 4 | digit as u16;
            self.advance()?;
        }
        Ok(unit)
    }

    /// A number as it is written.
    fn number(&mut self) -> Result<&str, Fault> {
        self.peek()?;
        self.token.clear();
        while let Some(byte @ (b'0'..=b'9' | b'-' | b'+' | b'.' | b'e' | b'E')) = self.raw()? {
            self.token.push(byte);
            self.advance()?;
            if self.token.len() > MAX_TOKEN {
                return self.broken("is a number of more than 16 MiB");
            }
        }
        if !is_number(&self.token) {
            return self.broken("expected a number");
        }
        Ok(std::str::from_utf8(&self.token).unwrap_or_default())
    }

    /// A number as the nearest double, which has to be finite.
    pub(super) fn double(&mut self) -> Result<f64, Fault> {
        let value = self.number()?.parse().ok().filter(|v: &f64| v.is_finite());
        value.map_or_else(|| self.broken("a number is beyond the range of doubles"), Ok)
    }

    /// A whole number from 0 to 2^64 − 1.
    pub(super) fn whole(&mut self) -> Result<u64, Fault> {
        let value = self.number()?.parse().ok();
        value.map_or_else(|| self.broken("expected a whole number, at least 0 and below 2^64"), Ok)
    }

    /// Three numbers.
    pub(super) fn vector(&mut self) -> Result<[f64; 3], Fault> {
        self.expect(b'[')?;
        let mut values = [0.0; 3];
        for (i, value) in values.iter_mut().enumerate() {
            if i > 0 {
                self.expect(b',')?;
            }
            *value = self.double()?;
        }
        self.expect(b']')?;
        Ok(values)
    }

    fn literal(&mut self, word: &str) -> Result<(), Fault> {
        for byte in word.bytes() {
            if self.raw()? != Some(byte) {
                return self.broken(format!("expected {word}"));
            }
            self.advance()?;
        }
        Ok(())
    }

    /// `true` or `false`.
    pub(super) fn boolean(&mut self) -> Result<bool, Fault> {
        let value = self.peek()? == b't';
        self.literal(if value { "true" } else { "false" }).map(|()| value)
    }

    /// Passes `null` if it is what comes.
    pub(super) fn null(&mut self) -> Result<bool, Fault> {
        let null = self.peek()? == b'n';
        if null {
            self.literal("null")?;
        }
        Ok(null)
    }

    /// Passes a value of any kind and gives its text, of at most 16 MiB.
    pub(super) fn value(&mut self) -> Result<Vec<u8>, Fault> {
        self.peek()?;
        self.captured = Some(Vec::new());
        let passed = self.skip();
        let text = self.captured.take();
        passed.map(|()| text.unwrap_or_default())
    }

    /// Passes a value of any kind. Brackets are kept on a stack of ours.
    pub(super) fn skip(&mut self) -> Result<(), Fault> {
        let mut closing: Vec<u8> = Vec::new();
        loop {
            let byte = self.peek()?;
            match byte {
                b'{' | b'[' => {
                    if closing.len() == MAX_DEPTH {
                        return self.broken(format!("values are nested more than {MAX_DEPTH} deep"));
                    }
                    self.advance()?;
                    closing.push(if byte == b'{' { b'}' } else { b']' });
                    if self.next_in(&mut closing, true)? {
                        continue;
                    }
                }
                b'"' => self.string().map(|_| ())?,
                b't' | b'f' => self.boolean().map(|_| ())?,
                b'n' => self.literal("null")?,
                _ => self.number().map(|_| ())?,
            }
            loop {
                if closing.is_empty() {
                    return Ok(());
                }
                if self.next_in(&mut closing, false)? {
                    break;
                }
            }
        }
    }

    /// In the innermost bracket: true if another value comes, whose key was taken; else the bracket was closed.
    fn next_in(&mut self, closing: &mut Vec<u8>, first: bool) -> Result<bool, Fault> {
        let Some(&close) = closing.last() else { return Ok(false) };
        let another = match close {
            b'}' => self.key(first)?.is_some(),
            _ => self.another(close, first)?,
        };
        if !another {
            closing.pop();
        }
        Ok(another)
    }
}

/// True for numbers as JSON spells them.
fn is_number(text: &[u8]) -> bool {
    let digits = |text: &[u8]| text.iter().take_while(|b| b.is_ascii_digit()).count();
    let mut rest = text.strip_prefix(b"-").unwrap_or(text);
    match digits(rest) {
        0 => return false,
        n if n > 1 && rest[0] == b'0' => return false,
        n => rest = &rest[n..],
    }
    if let Some(fraction) = rest.strip_prefix(b".") {
        match digits(fraction) {
            0 => return false,
            n => rest = &fraction[n..],
        }
    }
    if let Some(exponent) = rest.strip_prefix(b"e").or(rest.strip_prefix(b"E")) {
        let exponent = exponent.strip_prefix(b"-").or(exponent.strip_prefix(b"+")).unwrap_or(exponent);
        return digits(exponent) == exponent.len() && !exponent.is_empty();
    }
    rest.is_empty()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bintree::Memory;

    fn with<T>(text: &str, read: impl Fn(&mut Json) -> Result<T, Fault>) -> Result<T, String> {
        let memory = Memory::from([("a".to_owned(), text.as_bytes().to_vec())]);
        let mut json = Json::new(&memory, "a").map_err(|_| "io")?;
        read(&mut json).and_then(|v| json.end().map(|()| v)).map_err(|fault| match fault {
            Fault::Broken(at, what) | Fault::Unsupported(at, what) => format!("{at}: {what}"),
            Fault::Io(e) => e.to_string(),
        })
    }

    #[test]
    fn values_are_passed_whole_and_told_as_they_stand() {
        let text = r#" {"a": [1, -2.5e-3, "x\"}\u00e9\ud83d\ude00", {}, [], [[]]], "b": {"c": null, "d": true}} "#;
        assert_eq!(with(text, |j| j.value()), Ok(text.trim().as_bytes().to_vec()));
        assert_eq!(with(r#""\u00e9\n\ud83d\ude00""#, |j| Ok(j.string()?.to_owned())), Ok("é\n😀".to_owned()));
        let long = format!("[{}1]", "12345, ".repeat(30_000));
        assert_eq!(with(&long, |j| j.value()).map(|v| v.len()), Ok(long.len()), "more than a chunk");
    }

    #[test]
    fn what_is_not_json_is_refused_at_its_byte() {
        let faults = [
            ("{\"a\" 1}", "5: expected ':'"),
            ("[1 2]", "3: expected ',' or ']', found '2'"),
            ("[1,]", "3: expected a number"),
            ("{\"a\":1,}", "7: expected '\"'"),
            ("[01]", "3: expected a number"),
            ("[1.]", "3: expected a number"),
            ("[nan]", "2: expected null"),
            ("[\"\\x\"]", "3: an escape"),
            ("\"\\ud800\"", "half a character"),
            ("\"\\udc00\"", "half a character"),
            ("\"\\ud800\\u0041\"", "half a character"),
            ("\"a\nb\"", "2: there is a control character"),
            ("[1", "2: the text ends too early"),
            ("\"abc", "4: the text ends in a string"),
            ("[1]]", "3: there is text behind"),
            ("", "0: the text ends"),
        ];
        for (text, expected) in faults {
            let fault = with(text, |j| j.skip()).unwrap_err();
            assert!(fault.contains(expected), "{text}: {fault}");
        }
    }

    #[test]
    fn depth_costs_no_stack_and_has_an_end() {
        let nested = |n: usize| "[".repeat(n) + &"]".repeat(n);
        assert_eq!(with(&nested(512), |j| j.skip()), Ok(()));
        assert!(with(&nested(2_000_000), |j| j.skip()).unwrap_err().contains("nested more than 512"));
        assert!(with(&"{\"a\":".repeat(1_000_000), |j| j.skip()).unwrap_err().contains("nested more"));
    }

    #[test]
    fn numbers_are_read_to_the_last_bit_or_refused() {
        for value in [0.1 + 0.2, 5e-324, f64::MAX, -0.0, 636_001.760_000_000_1] {
            assert_eq!(with(&format!("{value:e}"), |j| j.double()).map(f64::to_bits), Ok(value.to_bits()));
        }
        assert!(with("1e999", |j| j.double()).unwrap_err().contains("beyond the range"));
        assert_eq!(with("18446744073709551615", |j| j.whole()), Ok(u64::MAX));
        for bad in ["18446744073709551616", "-1", "1.0", "1e3"] {
            assert!(with(bad, |j| j.whole()).unwrap_err().contains("whole number"), "{bad}");
        }
    }
}
