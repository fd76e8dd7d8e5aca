//! Fields of a JSON object, each taken out with a fault that names it.

use std::path::Path;

use serde_json::{Map, Value};

use crate::ReadError;
use crate::error::json_reason;

/// What is wrong; whoever knows the path adds it once ([`Fault::of`]).
pub(crate) enum Fault {
    /// See [`ReadError::broken`].
    Broken(String),
    /// See [`ReadError::unsupported`].
    Unsupported(String),
}

/// A description that breaks a promise of its format.
pub(crate) fn broken<T>(what: impl Into<String>) -> Result<T, Fault> {
    Err(Fault::Broken(what.into()))
}

/// A description of something that is not read here.
pub(crate) fn unsupported<T>(what: impl Into<String>) -> Result<T, Fault> {
    Err(Fault::Unsupported(what.into()))
}

impl Fault {
    /// The error about the file `path`.
    pub(crate) fn of(self, path: &Path) -> ReadError {
        match self {
            Self::Broken(what) => ReadError::broken(path, None, what),
            Self::Unsupported(what) => ReadError::unsupported(path, what),
        }
    }
}

/// An object whose fields are taken out one by one; `place` stands before their names in messages.
pub(crate) struct Fields<'a> {
    pub(crate) map: &'a mut Map<String, Value>,
    pub(crate) place: &'a str,
}

impl Fields<'_> {
    /// The value of `key`, out of the object.
    pub(crate) fn take(&mut self, key: &str) -> Option<Value> {
        self.map.remove(key)
    }

    /// A string; empty if there is none.
    pub(crate) fn text(&mut self, key: &str) -> Result<String, Fault> {
        match self.take(key) {
            None => Ok(String::new()),
            Some(Value::String(text)) => Ok(text),
            Some(other) => self.wrong(key, "a string", &other),
        }
    }

    /// An object that has to be there.
    pub(crate) fn object(&mut self, key: &str) -> Result<Map<String, Value>, Fault> {
        match self.take(key) {
            Some(Value::Object(map)) => Ok(map),
            Some(other) => self.wrong(key, "an object", &other),
            None => broken(format!("{key} is missing")),
        }
    }

    /// A whole number that has to be there.
    pub(crate) fn integer(&mut self, key: &str) -> Result<u64, Fault> {
        match self.take(key) {
            None => broken(format!("{}{key} is missing", self.place)),
            Some(value) => value.as_u64().map_or_else(|| self.wrong(key, "a whole number, at least 0", &value), Ok),
        }
    }

    /// An integer that readers take as a hint; 0 if there is none.
    pub(crate) fn small(&mut self, key: &str) -> Result<u32, Fault> {
        let Some(value) = self.take(key) else { return Ok(0) };
        let small = value.as_u64().and_then(|v| u32::try_from(v).ok());
        small.map_or_else(|| self.wrong(key, "a whole number below 2^32", &value), Ok)
    }

    /// A number that has to be there.
    pub(crate) fn number(&mut self, key: &str) -> Result<f64, Fault> {
        match self.take(key) {
            None => broken(format!("{}{key} is missing", self.place)),
            Some(value) => value.as_f64().map_or_else(|| self.wrong(key, "a number", &value), Ok),
        }
    }

    /// A whole number, if there is one.
    pub(crate) fn optional_integer(&mut self, key: &str) -> Result<Option<u64>, Fault> {
        if self.map.contains_key(key) { self.integer(key).map(Some) } else { Ok(None) }
    }

    /// A number, if there is one.
    pub(crate) fn optional_number(&mut self, key: &str) -> Result<Option<f64>, Fault> {
        if self.map.contains_key(key) { self.number(key).map(Some) } else { Ok(None) }
    }

    /// An array of numbers, if there is one.
    pub(crate) fn numbers(&mut self, key: &str) -> Result<Option<Vec<f64>>, Fault> {
        let Some(value) = self.take(key) else { return Ok(None) };
        let numbers = value.as_array().and_then(|list| list.iter().map(Value::as_f64).collect());
        numbers.map_or_else(|| self.wrong(key, "an array of numbers", &value), |n| Ok(Some(n)))
    }

    /// Three numbers that have to be there.
    pub(crate) fn vector(&mut self, key: &str) -> Result<[f64; 3], Fault> {
        match self.numbers(key)?.as_deref() {
            Some(&[x, y, z]) => Ok([x, y, z]),
            Some(other) => broken(format!("{}{key} has {} numbers, not 3", self.place, other.len())),
            None => broken(format!("{}{key} is missing", self.place)),
        }
    }

    /// The fault of a value that is not as `expected`.
    pub(crate) fn wrong<T>(&self, key: &str, expected: &str, found: &Value) -> Result<T, Fault> {
        let mut found = found.to_string();
        if let Some((end, _)) = found.char_indices().nth(40) {
            found.truncate(end);
            found.push('…');
        }
        broken(format!("{}{key} is {found}, not {expected}", self.place))
    }
}

/// Says where JSON ends to be JSON, and names the one fault that the reference converter is known for.
pub(crate) fn syntax_error(bytes: &[u8], path: &Path, error: &serde_json::Error) -> ReadError {
    let line_start: usize =
        bytes.split_inclusive(|b| *b == b'\n').take(error.line().saturating_sub(1)).map(<[u8]>::len).sum();
    let offset = (line_start + error.column().saturating_sub(1)).min(bytes.len());
    let word = bytes[offset..].trim_ascii_start();
    let word = word.strip_prefix(b"-").unwrap_or(word);
    if word.get(..3).is_some_and(|word| word.eq_ignore_ascii_case(b"inf") || word.eq_ignore_ascii_case(b"nan")) {
        let what = "is not valid JSON: a number is written as inf or nan";
        return ReadError::broken(path, offset as u64, what)
            .advise("PotreeConverter does so for attributes that it leaves empty; replace the word by 0");
    }
    ReadError::broken(path, offset as u64, format!("is not valid JSON: {}", json_reason(error)))
}
