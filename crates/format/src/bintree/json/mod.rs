//! A pull parser for JSON of any length: it holds one token and 64 KiB of text, knows the byte it is at, and never
//! recurses, so that neither the size nor the depth of an index can do harm.

mod scalars;

use std::io;

use super::node::MAX_DEPTH;
use crate::bytes::ByteSource;

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
    /// The byte at which what is read does not fit memory any more.
    Memory(u64),
    /// The source could not be read.
    Io(io::Error),
}

impl Fault {
    /// The same at byte `at`.
    pub(super) fn at(self, at: u64) -> Self {
        match self {
            Self::Broken(_, what) => Self::Broken(at, what),
            Self::Unsupported(_, what) => Self::Unsupported(at, what),
            Self::Memory(_) => Self::Memory(at),
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
    #[inline]
    fn raw(&mut self) -> Result<Option<u8>, Fault> {
        if self.at == self.chunk.len() {
            self.refill()?;
        }
        Ok(self.chunk.get(self.at).copied())
    }

    #[cold]
    fn refill(&mut self) -> Result<(), Fault> {
        self.start += self.chunk.len() as u64;
        self.at = 0;
        self.chunk.resize(CHUNK.min(self.size.saturating_sub(self.start)) as usize, 0);
        self.source.read_at(self.file, self.start, &mut self.chunk).map_err(Fault::Io)
    }

    fn advance(&mut self) -> Result<(), Fault> {
        self.pass(1)
    }

    /// Passes the next `count` bytes of the chunk.
    #[inline]
    fn pass(&mut self, count: usize) -> Result<(), Fault> {
        let end = (self.at + count).min(self.chunk.len());
        if let Some(text) = &mut self.captured {
            text.extend_from_slice(&self.chunk[self.at..end]);
            if text.len() > MAX_TOKEN {
                return self.broken("is a value of more than 16 MiB");
            }
        }
        self.at = end;
        Ok(())
    }

    /// Adds the bytes that come to the token, as long as they are `wanted`: run by run, as numbers and strings are most
    /// of an index.
    fn take_while(&mut self, wanted: impl Fn(u8) -> bool) -> Result<(), Fault> {
        while self.raw()?.is_some() {
            let rest = &self.chunk[self.at..];
            let run = rest.iter().position(|b| !wanted(*b)).unwrap_or(rest.len());
            self.token.extend_from_slice(&rest[..run]);
            if self.token.len() > MAX_TOKEN {
                return self.broken("is a string or number of more than 16 MiB");
            }
            self.pass(run)?;
            if self.at < self.chunk.len() {
                break;
            }
        }
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
                b'n' => self.null().map(|_| ())?,
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bytes::Memory;

    fn with<T>(text: &str, read: impl Fn(&mut Json) -> Result<T, Fault>) -> Result<T, String> {
        let memory = Memory::from([("a".to_owned(), text.as_bytes().to_vec())]);
        let mut json = Json::new(&memory, "a").map_err(|_| "io")?;
        read(&mut json).and_then(|v| json.end().map(|()| v)).map_err(|fault| match fault {
            Fault::Broken(at, what) | Fault::Unsupported(at, what) => format!("{at}: {what}"),
            Fault::Memory(at) => format!("{at}: memory"),
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
