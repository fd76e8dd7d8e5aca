//! PLY, binary, little-endian: world coordinates as doubles, attributes as properties.

use pointmill_format::scan::las::write::Tally;
use pointmill_format::{AttributeType, Changes};

use super::encoder::{Encoder, Place};
use super::fields::{Depth, Field, Value, fields, with_number};
use super::rows::Block;
use crate::error::ConvertError;
use crate::runtime::DiskFile;
use crate::sources::Schema;

/// Bytes of a position.
const POSITION: usize = 24;

/// A PLY file.
pub(super) struct PlyFile {
    fields: Vec<Field>,
    record_len: usize,
    crs: String,
}

impl PlyFile {
    /// `crs`: for people.
    pub(super) fn new(schema: &Schema, depth: Depth, crs: &str) -> Self {
        let fields = fields(schema, depth, name_of);
        let record_len = POSITION + fields.iter().map(|field| size(&Property::of(field))).sum::<usize>();
        Self { fields, record_len, crs: crs.replace(['\n', '\r'], " ") }
    }

    fn header(&self, points: u64) -> Vec<u8> {
        let mut text = String::from("ply\nformat binary_little_endian 1.0\n");
        text += concat!("comment written by pointmill ", env!("CARGO_PKG_VERSION"), "\n");
        if !self.crs.is_empty() {
            text += &format!("comment coordinate reference system: {}\n", self.crs);
        }
        text += &format!("element vertex {points}\n");
        for axis in ["x", "y", "z"] {
            text += &format!("property double {axis}\n");
        }
        for field in &self.fields {
            text += &format!("property {} {}\n", Property::of(field).name(), field.name);
        }
        text += "end_header\n";
        text.into_bytes()
    }

    /// The header, as long whatever the number of points is.
    fn padded(&self, points: u64) -> Vec<u8> {
        let mut header = self.header(points);
        let missing = self.header(u64::MAX).len() - header.len();
        // behind the first line of comment
        let at = header.windows(8).position(|w| w == b"comment ").unwrap_or(0) + 7;
        header.splice(at..at, std::iter::repeat_n(b' ', missing));
        header
    }
}

/// The types of PLY.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Property {
    Of(AttributeType),
    /// Integers of 64 bits, which PLY does not have, and what stored values mean.
    Double,
    Byte,
}

impl Property {
    fn of(field: &Field) -> Self {
        match (field.value, field.ty) {
            (Value::Byte(_), _) => Self::Byte,
            (Value::Linear { .. }, _) | (_, AttributeType::Int64 | AttributeType::UInt64) => Self::Double,
            (Value::Stored, ty) => Self::Of(ty),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Byte | Self::Of(AttributeType::UInt8) => "uchar",
            Self::Of(AttributeType::Int8) => "char",
            Self::Of(AttributeType::Int16) => "short",
            Self::Of(AttributeType::UInt16) => "ushort",
            Self::Of(AttributeType::Int32) => "int",
            Self::Of(AttributeType::UInt32) => "uint",
            Self::Of(AttributeType::Float32) => "float",
            Self::Double | Self::Of(_) => "double",
        }
    }
}

fn size(property: &Property) -> usize {
    match property {
        Property::Of(ty) => ty.size(),
        Property::Double => 8,
        Property::Byte => 1,
    }
}

/// The usual name in PLY: one word.
fn name_of(name: &str) -> String {
    match name {
        "NormalX" => "nx".to_owned(),
        "NormalY" => "ny".to_owned(),
        "NormalZ" => "nz".to_owned(),
        _ => name.chars().map(|c| if c.is_whitespace() || c.is_control() { '_' } else { c }).collect(),
    }
}

impl Encoder for PlyFile {
    fn describe(&self) -> String {
        "PLY, binary little-endian, positions as doubles".to_owned()
    }

    fn places(&self) -> Vec<Place> {
        self.fields
            .iter()
            .map(|field| Place {
                attribute: field.attribute,
                place: format!("property {} {}", Property::of(field).name(), field.name),
            })
            .collect()
    }

    fn start(&self) -> Result<u64, ConvertError> {
        Ok(self.padded(0).len() as u64)
    }

    fn encode(
        &self,
        block: &Block,
        _: &Schema,
        tally: &mut Tally,
        changes: &mut [Changes],
    ) -> Result<Option<Vec<u8>>, ConvertError> {
        let len = self.record_len;
        let mut out = vec![0; block.len() * len];
        for (a, axis) in block.world().into_iter().enumerate() {
            for (record, v) in out.chunks_exact_mut(len).zip(axis) {
                record[8 * a..8 * a + 8].copy_from_slice(&v.to_le_bytes());
            }
        }
        let mut at = POSITION;
        for field in &self.fields {
            let size = size(&Property::of(field));
            for (i, record) in out.chunks_exact_mut(len).enumerate() {
                let to = &mut record[at..at + size];
                let from = &block.row(i)[field.at..];
                match (field.value, field.ty) {
                    (Value::Byte(depth), _) => {
                        let colour = with_number!(from, AttributeType::UInt16, v => v as u16);
                        let Some(byte) = depth.byte(colour) else { return Ok(None) };
                        to[0] = byte;
                    }
                    (Value::Linear { scale, offset }, ty) => {
                        let value = with_number!(from, ty, v => v as f64) * scale + offset;
                        to.copy_from_slice(&value.to_le_bytes());
                    }
                    (Value::Stored, ty @ (AttributeType::Int64 | AttributeType::UInt64)) => {
                        let (value, is_same) = with_number!(from, ty, v => (v as f64, v as f64 as i128 == v as i128));
                        if !is_same {
                            changes[field.attribute].round(value);
                        }
                        to.copy_from_slice(&value.to_le_bytes());
                    }
                    (Value::Stored, _) => to.copy_from_slice(&from[..size]),
                }
            }
            at += size;
        }
        tally.count(block.len() as u64);
        Ok(Some(out))
    }

    fn finish(&self, file: &DiskFile, tally: &Tally, _: &[(u32, u32)], end: u64) -> Result<u64, ConvertError> {
        file.write_at(&self.padded(tally.points()), 0, "writing the header")?;
        Ok(end)
    }
}
