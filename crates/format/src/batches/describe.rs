//! The description: a JSON object at the end of the file (`docs/formats/batches.md`, §6.5).

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::error::json_reason;
use crate::names::named;
use crate::{Attribute, AttributeType, Lattice, ReadError};

use super::Precision;

/// The description of the cloud. Keys are written in this order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
#[non_exhaustive]
pub struct Description {
    /// Version of the program that wrote the file.
    #[serde(default)]
    pub version: String,
    /// For people.
    #[serde(default)]
    pub name: String,
    /// A proj4 definition, `EPSG:4326` or nothing.
    #[serde(default)]
    pub projection: String,
    /// The lattice of the source.
    pub lattice: LatticeEntry,
    /// Extra attributes, in the order of their sections.
    #[serde(default)]
    pub attributes: Vec<AttributeEntry>,
    /// Where colours come from.
    #[serde(default)]
    pub colour: ColourSource,
    /// Errors of positions, for the planes that are there.
    #[serde(default)]
    pub errors: PlaneErrors,
    /// Least step of the sources' own coordinates, world units.
    #[serde(default)]
    pub source_step: [f64; 3],
    /// Other keys: `intensityRange`, `filter`, `duplicates`, `rgbDepth`, `wkt`, and what this version does not know.
    #[serde(flatten)]
    pub extra: serde_json::Map<String, serde_json::Value>,
}

/// `world = X · scale + offset`, per axis: [`Lattice`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[allow(missing_docs)] // as in Lattice
pub struct LatticeEntry {
    pub scale: [f64; 3],
    pub offset: [f64; 3],
}

impl From<Lattice> for LatticeEntry {
    fn from(Lattice { scale, offset }: Lattice) -> Self {
        Self { scale, offset }
    }
}

impl From<LatticeEntry> for Lattice {
    fn from(LatticeEntry { scale, offset }: LatticeEntry) -> Self {
        Self { scale, offset }
    }
}

/// One extra attribute and where its values are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
#[non_exhaustive]
pub struct AttributeEntry {
    /// Unique in the file.
    pub name: String,
    /// Element type, by its Potree name ([`AttributeType::potree_name`]).
    #[serde(rename = "type")]
    pub type_name: String,
    /// Elements per point, 1 … 256.
    pub elements: u64,
    /// Where the section begins, in bytes from the start of the file.
    pub offset: u64,
    /// Bytes of the section.
    pub bytes: u64,
    /// Factor from raw to meant values, one per element, if it is not 1.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub value_scale: Vec<f64>,
    /// Summand from raw to meant values, one per element, if it is not 0.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub value_offset: Vec<f64>,
    /// Least raw value of each element, if known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub min: Vec<f64>,
    /// Greatest raw value of each element, if known.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub max: Vec<f64>,
}

impl AttributeEntry {
    /// More elements per point than any attribute has.
    pub(crate) const MAX_ELEMENTS: u64 = 256;

    /// More attributes than any file has.
    pub(crate) const MAX_ATTRIBUTES: usize = 256;

    /// The entry of an attribute whose values will be at `offset`; `min` and `max` are left empty.
    #[must_use]
    pub fn new(attribute: &Attribute, offset: u64, bytes: u64) -> Self {
        let unless = |values: &[f64], usual: f64| match values.iter().all(|v| *v == usual) {
            true => Vec::new(),
            false => values.to_vec(),
        };
        Self {
            name: attribute.name.clone(),
            type_name: attribute.ty.potree_name().to_owned(),
            elements: attribute.elements as u64,
            offset,
            bytes,
            value_scale: unless(&attribute.scale, 1.0),
            value_offset: unless(&attribute.offset, 0.0),
            min: Vec::new(),
            max: Vec::new(),
        }
    }

    /// Name, type and scaling; `None` if the type is unknown or elements are not 1 … 256.
    #[must_use]
    pub fn attribute(&self) -> Option<Attribute> {
        let ty = AttributeType::from_potree_name(&self.type_name)?;
        let elements =
            usize::try_from(self.elements).ok().filter(|_| (1..=Self::MAX_ELEMENTS).contains(&self.elements))?;
        let mut attribute = Attribute::new(self.name.as_str(), ty, elements);
        for (given, usual) in [(&self.value_scale, &mut attribute.scale), (&self.value_offset, &mut attribute.offset)] {
            if given.len() == elements {
                usual.clone_from(given);
            }
        }
        Some(attribute)
    }
}

/// Where colours come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ColourSource {
    /// From the colours of the source.
    Rgb,
    /// Grey, from the intensity: the source has no colours.
    Intensity,
    /// White: the source has neither.
    #[default]
    None,
}

impl ColourSource {
    /// Every source.
    pub const ALL: &[Self] = &[Self::Rgb, Self::Intensity, Self::None];

    /// The word in the description.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rgb => "rgb",
            Self::Intensity => "intensity",
            Self::None => "none",
        }
    }
}

named!(ColourSource, "source of colours");

/// Errors of decoded positions over all points, world units: x, y, z.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ErrorFigures {
    /// The largest.
    pub max: [f64; 3],
    /// Root of the mean square.
    pub rms: [f64; 3],
}

/// Errors by precision; `None` for planes that are not in the file.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[allow(missing_docs)] // the names say it
#[non_exhaustive]
pub struct PlaneErrors {
    #[serde(rename = "10", default, skip_serializing_if = "Option::is_none")]
    pub ten: Option<ErrorFigures>,
    #[serde(rename = "20", default, skip_serializing_if = "Option::is_none")]
    pub twenty: Option<ErrorFigures>,
    #[serde(rename = "30", default, skip_serializing_if = "Option::is_none")]
    pub thirty: Option<ErrorFigures>,
}

impl PlaneErrors {
    /// The figures of one precision.
    pub fn get(&self, precision: Precision) -> Option<&ErrorFigures> {
        match precision {
            Precision::Ten => self.ten.as_ref(),
            Precision::Twenty => self.twenty.as_ref(),
            Precision::Thirty => self.thirty.as_ref(),
        }
    }

    /// Without those that need more planes than `precision` has.
    #[must_use]
    pub fn up_to(self, precision: Precision) -> Self {
        Self {
            ten: self.ten,
            twenty: self.twenty.filter(|_| precision >= Precision::Twenty),
            thirty: self.thirty.filter(|_| precision >= Precision::Thirty),
        }
    }
}

impl Description {
    /// A description with nothing but a lattice, whose scale is the source step, and this version of pointmill.
    #[must_use]
    pub fn new(lattice: Lattice) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            name: String::new(),
            projection: String::new(),
            lattice: lattice.into(),
            attributes: Vec::new(),
            colour: ColourSource::None,
            errors: PlaneErrors::default(),
            source_step: lattice.scale,
            extra: serde_json::Map::new(),
        }
    }

    /// The text: one line, keys in order. JSON has neither NaN nor infinities: they become `null`, which
    /// [`Self::from_json`] refuses.
    #[must_use]
    pub fn to_json(&self) -> String {
        // strings, numbers and string keys: there is nothing in it that could fail
        serde_json::to_string(self).unwrap_or_default()
    }

    /// Reads the text; `path`, and `offset` of the text in the file, are for messages.
    ///
    /// # Errors
    /// What is no JSON, of the wrong type, or missing.
    pub fn from_json(bytes: &[u8], path: &Path, offset: u64) -> Result<Self, ReadError> {
        let description: Self = serde_json::from_slice(bytes).map_err(|e| {
            let what = format!("the description, JSON from byte {offset}: {}", json_reason(&e));
            ReadError::broken(path, offset, what).advise(super::header::CORRUPT)
        })?;
        if !Lattice::from(description.lattice).is_valid() {
            let Lattice { scale, offset: origin } = description.lattice.into();
            let what = format!(
                "the description has the lattice of scales {scale:?} and offsets {origin:?}; scales have to be > 0"
            );
            return Err(ReadError::broken(path, offset, what).advise(super::header::CORRUPT));
        }
        Ok(description)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn described() -> Description {
        let lattice = Lattice { scale: [0.001, 0.1, 1e-7], offset: [500_000.1, -4e6, 1.0 / 3.0] };
        let mut d = Description::new(lattice);
        d.colour = ColourSource::Intensity;
        let mut amplitude = Attribute::new("Amplitude", AttributeType::UInt16, 1);
        amplitude.scale = vec![0.01];
        d.attributes.push(AttributeEntry::new(&amplitude, 1024, 20));
        d.errors.ten = Some(ErrorFigures { max: [0.1, 2e-17, 0.0], rms: [0.3; 3] });
        d.extra.insert("duplicates".into(), "keep".into());
        d
    }

    #[test]
    fn reading_undoes_writing_to_the_last_bit() {
        let text = described().to_json();
        assert_eq!(Description::from_json(text.as_bytes(), Path::new("a"), 0).unwrap(), described());
        assert!(text.contains(r#""valueScale":[0.01]},"#) || text.contains(r#""valueScale":[0.01]}]"#), "{text}");
        let order = ["version", "lattice", "attributes", "colour", "errors", "sourceStep", "duplicates"];
        assert!(order.map(|k| text.find(k)).is_sorted(), "{text}");
    }

    #[test]
    fn what_is_not_known_is_kept_and_what_can_be_missing_may() {
        let text = r#"{"lattice":{"scale":[1,1,1],"offset":[0,0,0]},"later":{"a":[1]}}"#;
        let d = Description::from_json(text.as_bytes(), Path::new("a"), 0).unwrap();
        assert_eq!((d.extra["later"]["a"][0].as_i64(), d.colour), (Some(1), ColourSource::None));
    }

    #[test]
    fn nonsense_is_refused_with_the_place() {
        let deep = "[".repeat(100_000);
        for text in ["", "{", "[]", "{}", r#"{"lattice":{"scale":[0,1,1],"offset":[0,0,0]}}"#, deep.as_str()] {
            let error = Description::from_json(text.as_bytes(), Path::new("a"), 512).unwrap_err().to_string();
            assert!(error.contains("(byte 512); the file is damaged"), "{error}");
        }
    }
}
