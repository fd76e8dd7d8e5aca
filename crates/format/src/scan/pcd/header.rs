//! The header: lines of a word and its values, up to DATA.

use crate::scan::source::Source;
use crate::scan::tabular::lines;
use crate::{Advice, AttributeType, Fault, ReadError, ScanWarning};

/// No header is longer; most have 200 bytes.
const MAX_HEADER: u64 = 1 << 20;

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
    pub(super) count: usize,
}

/// Everything before the points.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) version: String,
    pub(super) encoding: Encoding,
    pub(super) fields: Vec<Field>,
    /// Where the names of the fields stand.
    pub(super) fields_at: u64,
    /// As declared.
    pub(super) points: u64,
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
    warnings: Vec<ScanWarning>,
}

/// True if the first bytes of a file say that it is PCD: a line of its header, behind comments.
pub fn is_pcd(first_bytes: &[u8]) -> bool {
    if first_bytes.starts_with(b"# .PCD") {
        return true;
    }
    let mut lines = lines::lines(first_bytes).map(|(_, line)| line);
    let first = lines.find(|l| lines::is_filled(l) && !l.starts_with(b"#")).unwrap_or_default();
    [b"VERSION ".as_slice(), b"FIELDS ", b"COLUMNS "].iter().any(|word| first.starts_with(word))
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
        for (at, line) in lines::lines(&bytes) {
            let text = String::from_utf8_lossy(line);
            let broken = |what: String| {
                ReadError::broken(source.path(), at as u64, Fault::Header(what)).advise(Advice::ExportAgain)
            };
            let mut words = text.split_whitespace();
            let word = words.next().unwrap_or_default();
            let values: Vec<String> = words.map(str::to_owned).collect();
            if word == "DATA" {
                let encoding = match values.first().map(String::as_str) {
                    Some("ascii") => Encoding::Ascii,
                    Some("binary") => Encoding::Binary,
                    Some("binary_compressed") => Encoding::Compressed,
                    other => return Err(broken(format!("the encoding {:?} is not known", other.unwrap_or("")))),
                };
                let newline = bytes[at..].iter().position(|b| *b == b'\n').map_or(bytes.len(), |n| at + n + 1);
                return found.header(encoding, newline as u64).map_err(broken);
            }
            found.line(word, values, at as u64).map_err(broken)?;
        }
        let what = format!("the header has no DATA line in its {} bytes", bytes.len());
        Err(ReadError::broken(source.path(), bytes.len() as u64, Fault::Header(what)).advise(Advice::CutShort))
    }
}

impl Lines {
    fn line(&mut self, word: &str, values: Vec<String>, at: u64) -> Result<(), String> {
        let number = || {
            let value = values.first().map(String::as_str).unwrap_or_default();
            value.parse().map(Some).map_err(|_| format!("{word} {value:?} is not a number"))
        };
        match word {
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
            _ => return Err(format!("the header line {:?} is not understood", shown(word))),
        }
        Ok(())
    }

    fn header(mut self, encoding: Encoding, end: u64) -> Result<Header, String> {
        let points = match (self.points, self.width, self.height) {
            (Some(points), ..) => points,
            (None, Some(width), height) => {
                width.checked_mul(height.unwrap_or(1)).ok_or("WIDTH times HEIGHT is beyond any file")?
            }
            _ => return Err("there is neither POINTS nor WIDTH".to_owned()),
        };
        if let (Some(width), Some(height)) = (self.width, self.height)
            && width.checked_mul(height) != Some(points)
        {
            self.warnings.push(ScanWarning::GridSize { width, height, points });
        }
        let fields = self.fields()?;
        let Self { version, names_at: fields_at, warnings, .. } = self;
        Ok(Header { version, encoding, fields, fields_at, points, end, warnings })
    }

    fn fields(&self) -> Result<Vec<Field>, String> {
        let count = self.names.len();
        for (word, list) in [("SIZE", &self.sizes), ("TYPE", &self.types)] {
            if list.len() != count {
                return Err(format!("there are {count} FIELDS but {} values of {word}", list.len()));
            }
        }
        if !self.counts.is_empty() && self.counts.len() != count {
            return Err(format!("there are {count} FIELDS but {} values of COUNT", self.counts.len()));
        }
        let field = |(i, name): (usize, &String)| {
            let (size, ty) = (&self.sizes[i], &self.types[i]);
            let ty = field_type(size, ty)
                .ok_or_else(|| format!("field {name} has TYPE {ty:?} and SIZE {size:?}, which is no number"))?;
            let declared = self.counts.get(i).map_or("1", String::as_str);
            let count = declared.parse::<u32>().ok().filter(|n| *n > 0);
            let count = count.ok_or_else(|| format!("field {name} has COUNT {declared:?}"))? as usize;
            Ok(Field { name: name.clone(), ty, count })
        };
        self.names.iter().enumerate().map(field).collect()
    }
}

fn shown(word: &str) -> String {
    word.chars().take(40).collect()
}

/// A field's type from its SIZE and TYPE.
fn field_type(size: &str, ty: &str) -> Option<AttributeType> {
    Some(match (ty, size) {
        ("I", "1") => AttributeType::Int8,
        ("I", "2") => AttributeType::Int16,
        ("I", "4") => AttributeType::Int32,
        ("I", "8") => AttributeType::Int64,
        ("U", "1") => AttributeType::UInt8,
        ("U", "2") => AttributeType::UInt16,
        ("U", "4") => AttributeType::UInt32,
        ("U", "8") => AttributeType::UInt64,
        ("F", "4") => AttributeType::Float32,
        ("F", "8") => AttributeType::Float64,
        _ => return None,
    })
}
