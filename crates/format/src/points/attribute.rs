//! The columns of a cloud: names, types and meaning.

use std::fmt;
use std::str::FromStr;

use crate::UnknownName;

/// The type of one element of an attribute: all that the formats have. All are stored little-endian.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[allow(missing_docs)] // the names say it
pub enum AttributeType {
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Float32,
    Float64,
}

impl AttributeType {
    /// Every type, in the order of declaration.
    pub const ALL: [Self; 10] = [
        Self::Int8,
        Self::UInt8,
        Self::Int16,
        Self::UInt16,
        Self::Int32,
        Self::UInt32,
        Self::Int64,
        Self::UInt64,
        Self::Float32,
        Self::Float64,
    ];

    /// Bytes of one element: 1, 2, 4 or 8.
    pub const fn size(self) -> usize {
        match self {
            Self::Int8 | Self::UInt8 => 1,
            Self::Int16 | Self::UInt16 => 2,
            Self::Int32 | Self::UInt32 | Self::Float32 => 4,
            Self::Int64 | Self::UInt64 | Self::Float64 => 8,
        }
    }

    /// The word that Potree 2.0 metadata uses ("uint16", "float", "double", …).
    pub const fn potree_name(self) -> &'static str {
        match self {
            Self::Int8 => "int8",
            Self::UInt8 => "uint8",
            Self::Int16 => "int16",
            Self::UInt16 => "uint16",
            Self::Int32 => "int32",
            Self::UInt32 => "uint32",
            Self::Int64 => "int64",
            Self::UInt64 => "uint64",
            Self::Float32 => "float",
            Self::Float64 => "double",
        }
    }

    /// The type with that Potree 2.0 name, if there is one.
    pub fn from_potree_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|t| t.potree_name() == name)
    }
}

impl fmt::Display for AttributeType {
    /// [`Self::potree_name`].
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.potree_name())
    }
}

impl FromStr for AttributeType {
    type Err = UnknownName;

    /// [`Self::from_potree_name`].
    fn from_str(name: &str) -> Result<Self, UnknownName> {
        let known = || Self::ALL.map(Self::potree_name);
        Self::from_potree_name(name).ok_or_else(|| UnknownName::new(name, "attribute type", &known()))
    }
}

/// One attribute of a cloud: what its column holds.
///
/// ```
/// use pointmill_format::{Attribute, AttributeType};
///
/// let rgb = Attribute::new("rgb", AttributeType::UInt16, 3);
/// assert_eq!((rgb.size(), rgb.ty.to_string()), (6, "uint16".to_owned()));
/// ```
///
/// Stored values are raw; the meant value of element `e` is `raw · scale[e] + offset[e]` (LAS extra bytes), 1 and 0
/// for everything else.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Attribute {
    /// Unique in its cloud; the field's usual names ("intensity", "gps-time", "rgb"; `docs/formats/potree2.md`).
    pub name: String,
    /// Free text.
    pub description: String,
    /// Type of one element.
    pub ty: AttributeType,
    /// Elements per point, ≥ 1.
    pub elements: usize,
    /// Factor for each element, `elements` long.
    pub scale: Vec<f64>,
    /// Summand for each element, `elements` long.
    pub offset: Vec<f64>,
    /// The raw value that means "unknown", for each element, if the file declares one.
    pub no_data: Option<Vec<f64>>,
}

impl Attribute {
    /// An attribute whose raw values are the meant ones.
    #[must_use]
    pub fn new(name: impl Into<String>, ty: AttributeType, elements: usize) -> Self {
        Self {
            name: name.into(),
            description: String::new(),
            ty,
            elements,
            scale: vec![1.0; elements],
            offset: vec![0.0; elements],
            no_data: None,
        }
    }

    /// Bytes per point: elements × element size.
    pub fn size(&self) -> usize {
        self.elements * self.ty.size()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_type_is_found_by_its_potree_name() {
        for t in AttributeType::ALL {
            assert_eq!(t.to_string().parse(), Ok(t));
        }
        assert!("undefined".parse::<AttributeType>().is_err());
    }
}
