//! The header: elements and their properties.

use crate::scan::source::Source;
use crate::scan::tabular::header_lines::{BOM, HeaderLine, LineEnd, data_start, header_lines};
use crate::{Advice, AttributeType, Fault, ReadError, ScanWarning};

/// No header is longer; most have some hundred bytes.
const MAX_HEADER: u64 = 1 << 20;

/// How the elements are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    BinaryLittle,
    BinaryBig,
}

/// What a property holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Scalar(AttributeType),
    List { count: AttributeType, item: AttributeType },
}

/// A property of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// A table of rows of properties.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Element {
    pub(super) name: String,
    /// As declared.
    pub(super) count: u64,
    /// Where in the file its line stands.
    pub(super) at: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// Bytes of a row, if all have as many.
    pub(super) fn stride(&self) -> Option<u64> {
        self.properties.iter().try_fold(0u64, |sum, p| match p.kind {
            Kind::Scalar(ty) => Some(sum + ty.size() as u64),
            Kind::List { .. } => None,
        })
    }
}

/// Everything before the data.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
    /// First byte of the data.
    pub(super) end: u64,
    pub(super) warnings: Vec<ScanWarning>,
}

/// True if the first bytes of a file say that it is PLY; a BOM may stand before. In capitals the word says so only if
/// lines of a header follow: texts may begin with it, too.
pub fn is_ply(first_bytes: &[u8]) -> bool {
    let text = first_bytes.strip_prefix(BOM).unwrap_or(first_bytes);
    let (word, rest) = text.split_at(text.len().min(3));
    let goes_on = || {
        let next = header_lines(text).nth(1).map_or(b"".as_slice(), |line| line.text.trim_ascii());
        [b"format ".as_slice(), b"comment"]
            .iter()
            .any(|w| next.get(..w.len()).is_some_and(|n| n.eq_ignore_ascii_case(w)))
    };
    rest.first().is_none_or(|b| *b <= b' ') && (word == b"ply" || word.eq_ignore_ascii_case(b"ply") && goes_on())
}

impl Header {
    pub(super) fn read(source: &Source) -> Result<Self, ReadError> {
        let bytes = source.vec_at(0, MAX_HEADER)?;
        if !is_ply(&bytes) {
            let what =
                if bytes.is_empty() { "the file is empty" } else { "not a PLY file (it does not start with ply)" };
            return Err(ReadError::broken(source.path(), 0, Fault::Header(what.to_owned())).advise(Advice::WrongFile));
        }
        let mut parser = Parser { encoding: None, elements: Vec::new(), warnings: Vec::new() };
        let mut all_cr = true;
        for line in header_lines(&bytes).skip(1) {
            let text = String::from_utf8_lossy(line.text);
            let at = line.at as u64;
            let broken =
                |what: String| ReadError::broken(source.path(), at, Fault::Header(what)).advise(Advice::ExportAgain);
            if text.trim().eq_ignore_ascii_case("end_header") {
                return parser.header(&line, all_cr, source.len()).map_err(broken);
            }
            all_cr &= line.end == LineEnd::Cr;
            parser.line(&text, at).map_err(broken)?;
        }
        let what = format!("the header has no end_header in its {} bytes", bytes.len());
        Err(ReadError::broken(source.path(), bytes.len() as u64, Fault::Header(what)).advise(Advice::CutShort))
    }

    /// Index of the element that holds the points.
    pub(super) fn vertices(&self, source: &Source) -> Result<usize, ReadError> {
        let found = ["vertex", "vertices", "point", "points"]
            .iter()
            .find_map(|name| self.elements.iter().position(|e| e.name.eq_ignore_ascii_case(name)));
        found.ok_or_else(|| {
            let names: Vec<_> = self.elements.iter().map(|e| e.name.as_str()).collect();
            let there =
                if names.is_empty() { "it has none".to_owned() } else { format!("it has {}", names.join(", ")) };
            ReadError::broken(source.path(), self.end, format!("there is no element vertex ({there})"))
                .advise("export it with vertices")
        })
    }
}

struct Parser {
    encoding: Option<Encoding>,
    elements: Vec<Element>,
    warnings: Vec<ScanWarning>,
}

impl Parser {
    /// The header that ends with `last`; `all_cr`: the lines before end with CR alone.
    fn header(self, last: &HeaderLine<'_>, all_cr: bool, file_bytes: u64) -> Result<Header, String> {
        let Self { encoding, elements, warnings } = self;
        let encoding = encoding.ok_or("the header has no format line")?;
        let bytes = elements.iter().try_fold(0u64, |sum, e| sum.checked_add(e.count.checked_mul(e.stride()?)?));
        let end = data_start(last, all_cr, |start| bytes.and_then(|n| n.checked_add(start)) == Some(file_bytes));
        Ok(Header { encoding, elements, end, warnings })
    }

    /// Keywords, encodings and types count in any case.
    fn line(&mut self, line: &str, at: u64) -> Result<(), String> {
        let words: Vec<&str> = line.split_whitespace().collect();
        let keyword = words.first().map(|w| w.to_ascii_lowercase()).unwrap_or_default();
        match (keyword.as_str(), words.get(1..).unwrap_or_default()) {
            ("" | "comment" | "obj_info", _) => {}
            ("format", [kind, rest @ ..]) => {
                self.encoding = Some(match kind.to_ascii_lowercase().as_str() {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::BinaryLittle,
                    "binary_big_endian" => Encoding::BinaryBig,
                    _ => return Err(format!("the encoding {kind:?} is not known")),
                });
                if rest != ["1.0"] {
                    self.warnings.push(ScanWarning::PlyVersion { version: rest.join(" ") });
                }
            }
            ("element", [name, count]) => {
                let count = count.parse().map_err(|_| format!("the count {count:?} of element {name} is no number"))?;
                self.elements.push(Element { name: (*name).to_owned(), count, at, properties: Vec::new() });
            }
            ("property", [list, count, item, name]) if list.eq_ignore_ascii_case("list") => {
                let kind = Kind::List { count: count_type(count)?, item: scalar_type(item)? };
                self.property(name, kind)?;
            }
            // names with blanks exist
            ("property", [ty, name @ ..]) if !name.is_empty() => {
                self.property(&name.join(" "), Kind::Scalar(scalar_type(ty)?))?;
            }
            _ => return Err(format!("the header line {:?} is not understood", line.trim())),
        }
        Ok(())
    }

    fn property(&mut self, name: &str, kind: Kind) -> Result<(), String> {
        let element = self.elements.last_mut().ok_or_else(|| format!("property {name} belongs to no element"))?;
        element.properties.push(Property { name: name.to_owned(), kind });
        Ok(())
    }
}

fn count_type(name: &str) -> Result<AttributeType, String> {
    match scalar_type(name)? {
        AttributeType::Float32 | AttributeType::Float64 => Err(format!("a list cannot have {name} items")),
        ty => Ok(ty),
    }
}

fn scalar_type(name: &str) -> Result<AttributeType, String> {
    Ok(match name.to_ascii_lowercase().as_str() {
        "char" | "int8" => AttributeType::Int8,
        "uchar" | "uint8" => AttributeType::UInt8,
        "short" | "int16" => AttributeType::Int16,
        "ushort" | "uint16" => AttributeType::UInt16,
        "int" | "int32" => AttributeType::Int32,
        "uint" | "uint32" => AttributeType::UInt32,
        "long" | "int64" => AttributeType::Int64,
        "ulong" | "uint64" => AttributeType::UInt64,
        "float" | "float32" => AttributeType::Float32,
        "double" | "float64" => AttributeType::Float64,
        _ => return Err(format!("the type {name:?} is not known")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_that_begins_with_the_word_in_capitals_is_no_ply() {
        assert!(is_ply(b"ply\n") && is_ply(b"\xef\xbb\xbfply\rformat ascii 1.0\r") && is_ply(b"ply"));
        assert!(is_ply(b"PLY\r\nFORMAT ascii 1.0\r\n"));
        assert!(!is_ply(b"Ply and plywood\nin this folder\n") && !is_ply(b"plywood") && !is_ply(b"pl"));
    }
}
