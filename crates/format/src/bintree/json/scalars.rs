//! Strings, numbers and words.

use super::{Fault, Json};

impl Json<'_> {
    /// A string, without its escapes.
    pub(in crate::bintree) fn string(&mut self) -> Result<&str, Fault> {
        self.expect(b'"')?;
        self.token.clear();
        loop {
            self.take_while(|b| b >= 0x20 && b != b'"' && b != b'\\')?;
            match self.raw()? {
                Some(b'"') => break,
                Some(b'\\') => self.escape()?,
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
    pub(super) fn number(&mut self) -> Result<&str, Fault> {
        self.peek()?;
        self.token.clear();
        self.take_while(|b| matches!(b, b'0'..=b'9' | b'-' | b'+' | b'.' | b'e' | b'E'))?;
        if !is_number(&self.token) {
            return self.broken("expected a number");
        }
        Ok(std::str::from_utf8(&self.token).unwrap_or_default())
    }

    /// A number as the nearest double, which has to be finite.
    pub(in crate::bintree) fn double(&mut self) -> Result<f64, Fault> {
        let value = self.number()?.parse().ok().filter(|v: &f64| v.is_finite());
        value.map_or_else(|| self.broken("a number is beyond the range of doubles"), Ok)
    }

    /// A whole number from 0 to 2^64 − 1.
    pub(in crate::bintree) fn whole(&mut self) -> Result<u64, Fault> {
        let value = self.number()?.parse().ok();
        value.map_or_else(|| self.broken("expected a whole number, at least 0 and below 2^64"), Ok)
    }

    /// Three numbers.
    pub(in crate::bintree) fn vector(&mut self) -> Result<[f64; 3], Fault> {
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
    pub(in crate::bintree) fn boolean(&mut self) -> Result<bool, Fault> {
        let value = self.peek()? == b't';
        self.literal(if value { "true" } else { "false" }).map(|()| value)
    }

    /// Passes `null` if it is what comes.
    pub(in crate::bintree) fn null(&mut self) -> Result<bool, Fault> {
        let null = self.peek()? == b'n';
        if null {
            self.literal("null")?;
        }
        Ok(null)
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
