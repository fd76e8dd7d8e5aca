//! The attributes of a run as fixed-size records.

use pointmill_format::{Attribute, AttributeType};

/// The layout of stored records: three `i32` of position, then every attribute, packed, little-endian.
#[derive(Debug, Clone)]
pub(crate) struct Schema {
    /// All but the position.
    pub(crate) attributes: Vec<Attribute>,
    /// Byte offset in a record of each attribute.
    pub(crate) offsets: Vec<usize>,
    /// Bytes of a record.
    pub(crate) stride: usize,
}

/// Bytes of the position at the start of a record.
pub(crate) const POSITION_BYTES: usize = 12;

/// Bytes of what tells apart points that the lattice of the run makes equal.
pub(crate) const MARK_BYTES: usize = 8;

impl Schema {
    pub(crate) fn new(attributes: Vec<Attribute>) -> Self {
        let mut stride = POSITION_BYTES;
        let offsets = attributes
            .iter()
            .map(|a| {
                let offset = stride;
                stride += a.size();
                offset
            })
            .collect();
        Self { attributes, offsets, stride }
    }

    /// The schema without what is not needed, and for each attribute of the present one its place there.
    pub(crate) fn reduce(&self, needed: &[bool]) -> (Self, Vec<Option<usize>>) {
        let mut kept = Vec::new();
        let places = self.attributes.iter().zip(needed).map(|(attribute, needed)| {
            needed.then(|| {
                kept.push(attribute.clone());
                kept.len() - 1
            })
        });
        let places = places.collect();
        (Self::new(kept), places)
    }

    /// Makes room behind the attributes of a record for a mark of [`MARK_BYTES`], and returns where it is.
    pub(crate) fn add_mark(&mut self) -> usize {
        let at = self.stride;
        self.stride += MARK_BYTES;
        at
    }

    pub(crate) fn find(&self, name: &str) -> Option<usize> {
        self.attributes.iter().position(|a| a.name == name)
    }

    /// The colour: `rgb`, three `u16`.
    pub(crate) fn rgb(&self) -> Option<usize> {
        self.find("rgb").filter(|&i| self.attributes[i].ty == AttributeType::UInt16 && self.attributes[i].elements == 3)
    }
}
