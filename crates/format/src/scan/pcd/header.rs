//! The header: lines of a word and its values, up to DATA. Words and values count in any case.

use crate::scan::source::Source;
use crate::scan::tabular::header_lines::{BOM, HeaderLine, LineEnd, data_start, header_lines};
use crate::scan::tabular::lines;
use crate::{Advice, AttributeType, Fault, ReadError, ScanWarning};

/// No header is longer; most have 200 bytes.
const MAX_HEADER: u64 = 1 << 20;
/// Lines of unknown words that are named in warnings.
const MAX_IGNORED: usize = 8;

/// How the points are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary,
    Compressed,
}

/// A field of a point.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) ty: AttributeType,
    /// At least 1.
    pub(super) count: usize,
}

/// Everything before the points.
#[derive(Debug)]
pub(super) struct Header {
    /// Empty if it is not given.
    pub(super) version: String,
    pub(super) encoding: Encoding,
    /// Those that hold anything.
    pub(super) fields: Vec<Field>,
    /// Where the names of the fields stand.
    pub(super) fields_at: u64,
    /// POINTS, else WIDTH times HEIGHT.
    pub(super) points: u64,
    /// WIDTH and HEIGHT, if POINTS is another number than their product.
    pub(super) grid: Option<(u64, u64)>,
    /// First byte of the data.
    pub(super) end: u64,
    pub(super) warnings: Vec<ScanWarning>,
}

/// The values of the lines, as they are found.
#[derive(Default)]
struct Lines {
    version: String,
    names: Vec<String>,
    names_at: u64,
    sizes: Vec<String>,
    types: Vec<String>,
    counts: Vec<String>,
    width: Option<u64>,
    height: Option<u64>,
    points: Option<u64>,
    ignored: usize,
    warnings: Vec<ScanWarning>,
}

/// True if the first bytes of a file say that it is PCD: a line of its header, behind comments. Words in lower case say so
/// only if others follow: texts may begin with them, too.
pub fn is_pcd(first_bytes: &[u8]) -> bool {
    if starts_with(first_bytes.strip_prefix(BOM).unwrap_or(first_bytes), b"# .PCD") {
        return true;
    }
    let is_of = |line: &[u8], words: &[&[u8]]| {
        words.iter().any(|word| starts_with(line, word) && matches!(line.get(word.len()), Some(b' ' | b'\t')))
    };
    let lines = || header_lines(first_bytes).map(|line| line.text.trim_ascii_start());
    let first = lines().find(|l| lines::is_filled(l) && !l.starts_with(b"#")).unwrap_or_default();
    let in_capitals =
        first.first().is_some_and(u8::is_ascii_uppercase) && first.get(1).is_some_and(u8::is_ascii_uppercase);
    is_of(first, &[b"VERSION", b"FIELDS", b"COLUMNS"])
        && (in_capitals || lines().any(|l| is_of(l, &[b"SIZE", b"TYPE", b"POINTS", b"DATA"])))
}

/// In any case.
fn starts_with(line: &[u8], word: &[u8]) -> bool {
    line.get(..word.len()).is_some_and(|w| w.eq_ignore_ascii_case(word))
}

impl Header {
    pub(super) fn read(source: &Source) -> Result<Self, ReadError> {
        let bytes = source.vec_at(0, MAX_HEADER)?;
        if !is_pcd(&bytes) {
            let what =
                if bytes.is_empty() { "the file is empty" } else { "not a PCD file (no VERSION or FIELDS line)" };
            return Err(ReadError::broken(source.path(), 0, Fault::Header(what.to_owned()))
                .advise("if it holds lines of numbers, name it .xyz or .txt"));
        }
        let mut found = Lines::default();
        let mut all_cr = true;
        for line in header_lines(&bytes) {
            let text = String::from_utf8_lossy(line.text);
            let broken = |what: String| {
                ReadError::broken(source.path(), line.at as u64, Fault::Header(what)).advise(Advice::ExportAgain)
            };
            let mut words = text.split_whitespace();
            let word = words.next().unwrap_or_default();
            let values: Vec<String> = words.map(str::to_owned).collect();
            if word.eq_ignore_ascii_case("DATA") {
                let encoding = match values.first().map(|v| v.to_ascii_lowercase()).as_deref() {
                    Some("ascii") => Encoding::Ascii,
                    Some("binary") => Encoding::Binary,
                    Some("binary_compressed") => Encoding::Compressed,
                    other => return Err(broken(format!("the encoding \"{}\" is not known", other.unwrap_or("")))),
                };
                let mut header = found.header(encoding).map_err(broken)?;
                header.end = header.data_start(source, &line, all_cr);
                return Ok(header);
            }
            all_cr &= line.end == LineEnd::Cr;
            found.line(word, values, line.at as u64).map_err(broken)?;
        }
        let what = format!("the header has no DATA line in its {} bytes", bytes.len());
        Err(ReadError::broken(source.path(), bytes.len() as u64, Fault::Header(what)).advise(Advice::CutShort))
    }

    /// Bytes of a point.
    pub(super) fn stride(&self) -> usize {
        self.fields.iter().map(|f| f.ty.size() * f.count).sum()
    }

    fn data_start(&self, source: &Source, last: &HeaderLine<'_>, all_cr: bool) -> u64 {
        let bytes = self.points.checked_mul(self.stride() as u64);
        data_start(last, all_cr, |start| match self.encoding {
            Encoding::Ascii => false,
            Encoding::Binary => bytes.and_then(|n| n.checked_add(start)) == Some(source.len()),
            Encoding::Compressed => {
                let decompressed = source.array_at::<4>(start.saturating_add(4)).map(u32::from_le_bytes);
                decompressed.is_ok_and(|n| bytes == Some(u64::from(n)))
            }
        })
    }
}

impl Lines {
    fn line(&mut self, word: &str, values: Vec<String>, at: u64) -> Result<(), String> {
        let number = || {
            let value = values.first().map(String::as_str).unwrap_or_default();
            value.parse().map(Some).map_err(|_| format!("{word} {value:?} is not a number"))
        };
        match word.to_ascii_uppercase().as_str() {
            "VERSION" => self.version = values.concat(),
            "FIELDS" | "COLUMNS" => (self.names, self.names_at) = (values, at),
            "SIZE" => self.sizes = values,
            "TYPE" => self.types = values,
            "COUNT" => self.counts = values,
            "WIDTH" => self.width = number()?,
            "HEIGHT" => self.height = number()?,
            "POINTS" => self.points = number()?,
            "VIEWPOINT" => {
                let numbers: Vec<_> = values.iter().filter_map(|v| v.parse::<f64>().ok()).collect();
                if numbers != [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0] {
                    self.warnings.push(ScanWarning::ViewpointIgnored { viewpoint: values.join(" ") });
                }
            }
            comment if comment.is_empty() || comment.starts_with('#') => {}
            _ if !word.starts_with(char::is_alphabetic) || self.ignored == MAX_IGNORED => {
                return Err(format!("the header line {:?} is not understood", shown(word)));
            }
            _ => {
                self.ignored += 1;
                self.warnings.push(ScanWarning::HeaderLineIgnored { word: shown(word) });
            }
        }
        Ok(())
    }

    /// The header, but for where its data start.
    fn header(mut self, encoding: Encoding) -> Result<Header, String> {
        let points = match (self.points, self.width, self.height) {
            (Some(points), ..) => points,
            (None, Some(width), height) => {
                width.checked_mul(height.unwrap_or(1)).ok_or("WIDTH times HEIGHT is beyond any file")?
            }
            _ => return Err("there is neither POINTS nor WIDTH".to_owned()),
        };
        let grid = self.width.zip(self.height).filter(|(w, h)| w.checked_mul(*h) != Some(points));
        let fields = self.fields()?;
        let Self { version, names_at: fields_at, warnings, .. } = self;
        Ok(Header { version, encoding, fields, fields_at, points, grid, end: 0, warnings })
    }

    fn fields(&mut self) -> Result<Vec<Field>, String> {
        let count = self.names.len();
        if self.sizes.is_empty() && self.types.is_empty() && count > 0 {
            // the first versions had no other type
            self.sizes = vec!["4".to_owned(); count];
            self.types = vec!["F".to_owned(); count];
            self.warnings.push(ScanWarning::FieldTypesMissing);
        }
        for (word, list) in [("SIZE", &self.sizes), ("TYPE", &self.types)] {
            if list.len() != count {
                return Err(format!("there are {count} FIELDS but {} values of {word}", list.len()));
            }
        }
        if !self.counts.is_empty() && self.counts.len() != count {
            return Err(format!("there are {count} FIELDS but {} values of COUNT", self.counts.len()));
        }
        let mut fields = Vec::with_capacity(count);
        for (i, name) in self.names.iter().enumerate() {
            let (size, ty) = (&self.sizes[i], &self.types[i]);
            let ty = field_type(size, ty)
                .ok_or_else(|| format!("field {name} has TYPE {ty} and SIZE {size}, which is no number"))?;
            let declared = self.counts.get(i).map_or("1", String::as_str);
            match declared.parse::<u32>().map_err(|_| format!("field {name} has COUNT {declared:?}"))? {
                0 if name == "_" => {}
                0 => self.warnings.push(ScanWarning::FieldEmpty { name: name.clone() }),
                n => fields.push(Field { name: name.clone(), ty, count: n as usize }),
            }
        }
        Ok(fields)
    }
}

fn shown(word: &str) -> String {
    word.chars().take(40).collect()
}

/// A field's type from its SIZE and TYPE.
fn field_type(size: &str, ty: &str) -> Option<AttributeType> {
    Some(match (ty.to_ascii_uppercase().as_str(), size) {
        ("I", "1") => AttributeType::Int8,
        ("I", "2") => AttributeType::Int16,
        ("I", "4") => AttributeType::Int32,
        ("I", "8") => AttributeType::Int64,
        // B: a truth value
        ("U" | "B", "1") => AttributeType::UInt8,
        ("U", "2") => AttributeType::UInt16,
        ("U", "4") => AttributeType::UInt32,
        ("U", "8") => AttributeType::UInt64,
        ("F", "4") => AttributeType::Float32,
        ("F", "8") => AttributeType::Float64,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_that_begins_with_a_word_of_the_header_is_no_pcd() {
        assert!(is_pcd(b"# .pcd v.7\n") && is_pcd(b"# made\nVERSION .7\n") && is_pcd(b"FIELDS\tx y z\n"));
        assert!(is_pcd(b"version .7\rfields x y z\rsize 4 4 4\r"));
        assert!(!is_pcd(b"Version 2 of this folder\nhas new scans\n") && !is_pcd(b"VERSIONS\n") && !is_pcd(b""));
    }
}
