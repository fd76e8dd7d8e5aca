//! Points of which each property is stored together: all values of the first, then all of the second.

use super::binary::{self, Misfit, Rows};
use super::number::Endian;
use super::schema::{Field, Target};
use crate::scan::decode::resize;
use crate::scan::source::Source;
use crate::{PointBatch, ReadError, Wanted};

/// A file of planes.
pub(crate) trait Planes: std::fmt::Debug + Send + Sync {
    /// A reader of the values from point `first_point` on, of the properties that are `needed`.
    fn reader<'a>(
        &'a self,
        source: &'a Source,
        first_point: u64,
        needed: &[bool],
    ) -> Result<Box<dyn PlaneReader + 'a>, ReadError>;

    /// Bytes of memory that [`Self::reader`] takes, what all readers share included.
    fn reader_bytes(&self, needed: &[bool]) -> u64;
}

/// Reads planes side by side.
pub(crate) trait PlaneReader {
    /// The next `points` values of property `property`, to `out`.
    fn read(&mut self, property: usize, out: &mut [u8]) -> Result<(), ReadError>;
}

/// A property: its place in a point and its bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Plane {
    /// Bytes of a point before it.
    pub(crate) at: usize,
    pub(crate) width: usize,
}

/// How the properties of a file of planes become columns.
#[derive(Debug)]
pub(crate) struct PlaneRule {
    pub(crate) planes: Box<dyn Planes>,
    /// By property.
    pub(crate) properties: Vec<Plane>,
    /// The property of each field.
    pub(crate) of_field: Vec<usize>,
}

impl PlaneRule {
    /// Whether a field of each property is wanted.
    pub(crate) fn needed(&self, fields: &[Field], wanted: &Wanted) -> Vec<bool> {
        let mut needed = vec![false; self.properties.len()];
        for (field, property) in fields.iter().zip(&self.of_field) {
            needed[*property] |= match field.target {
                Target::Skip | Target::List => false,
                Target::Axis(_) => true,
                Target::Value { column, .. } => wanted.is_wanted(column),
                Target::Harmonic { value, colour, .. } => wanted.is_wanted(value) || wanted.is_wanted(colour),
                Target::Packed { column, alpha } => {
                    wanted.is_wanted(column) || alpha.is_some_and(|alpha| wanted.is_wanted(alpha))
                }
            };
        }
        needed
    }

    /// Bytes of the widest property that is needed: the values of one are held at once.
    pub(crate) fn widest(&self, needed: &[bool]) -> usize {
        let widths = self.properties.iter().zip(needed).filter(|(_, needed)| **needed).map(|(plane, _)| plane.width);
        widths.max().unwrap_or(0)
    }

    /// Fills `batch`, which has room for `points` points, from the reader of the properties that are `needed`. `bytes`
    /// is memory to use.
    pub(crate) fn fill(
        &self,
        reader: &mut dyn PlaneReader,
        (fields, wanted, needed): (&[Field], &Wanted, &[bool]),
        points: usize,
        bytes: &mut Vec<u8>,
        batch: &mut PointBatch,
    ) -> Result<(), Failure> {
        let mut fields = fields.iter().zip(&self.of_field).peekable();
        for (property, plane) in self.properties.iter().enumerate() {
            let is_its = |(_, of): &(&Field, &usize)| **of == property;
            let len = points * plane.width;
            if needed[property] {
                if bytes.len() < len {
                    resize(bytes, len);
                }
                reader.read(property, &mut bytes[..len])?;
            }
            while let Some((field, _)) = fields.next_if(is_its) {
                if needed[property] {
                    let in_plane = Field { at: field.at - plane.at, ..*field };
                    let rows = Rows { bytes: &bytes[..len], stride: plane.width, endian: Endian::Little };
                    binary::field_to_column(rows, &in_plane, wanted, 0, batch)?;
                }
            }
        }
        Ok(())
    }
}

/// Why planes do not become columns.
pub(crate) enum Failure {
    Misfit(Misfit),
    Read(ReadError),
}

impl From<Misfit> for Failure {
    fn from(misfit: Misfit) -> Self {
        Self::Misfit(misfit)
    }
}

impl From<ReadError> for Failure {
    fn from(error: ReadError) -> Self {
        Self::Read(error)
    }
}
