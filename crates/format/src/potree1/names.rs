//! What attributes are called: by words up to version 1.7, by objects in 1.8, and in [`crate::NodePoints`].

use crate::{Attribute, AttributeType};

/// What a part of a record is, whatever a file calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[non_exhaustive]
#[allow(missing_docs)] // the page has the table
pub enum Field {
    Position,
    /// Red, green, blue, and a byte that clients ignore.
    Rgba,
    /// Red, green, blue.
    Rgb,
    Intensity,
    Classification,
    ReturnNumber,
    NumberOfReturns,
    SourceId,
    GpsTime,
    /// Two bytes of a Lambert azimuthal projection.
    NormalSpheremapped,
    /// Two bytes of an unfolded octahedron.
    NormalOct16,
    /// Three floats.
    Normal,
    /// A byte that is skipped.
    Filler,
    /// Anything else, under its own name and with its own type: version 1.8 only.
    Other,
}

/// The facts about one field.
struct Row {
    field: Field,
    /// The words of version 1.7 and older; the first is the one to write.
    words: &'static [&'static str],
    /// The names of version 1.8; the first is the one to write.
    objects: &'static [&'static str],
    ty: AttributeType,
    elements: usize,
    columns: &'static [(&'static str, AttributeType, usize)],
}

const NORMALS: &[(&str, AttributeType, usize)] = &[
    ("NormalX", AttributeType::Float32, 1),
    ("NormalY", AttributeType::Float32, 1),
    ("NormalZ", AttributeType::Float32, 1),
];
const RGB: &[(&str, AttributeType, usize)] = &[("rgb", AttributeType::UInt16, 3)];

#[rustfmt::skip]
const ROWS: &[Row] = {
    use AttributeType::{Float32, Float64, Int32, UInt8, UInt16};
    &[
        Row { field: Field::Position, words: &["POSITION_CARTESIAN"], objects: &["POSITION_CARTESIAN"], ty: Int32, elements: 3, columns: &[] },
        Row { field: Field::Rgba, words: &["COLOR_PACKED", "RGBA_PACKED"], objects: &["RGBA", "rgba"], ty: UInt8, elements: 4, columns: RGB },
        Row { field: Field::Rgb, words: &["RGB_PACKED"], objects: &[], ty: UInt8, elements: 3, columns: RGB },
        Row { field: Field::Intensity, words: &["INTENSITY"], objects: &["intensity"], ty: UInt16, elements: 1, columns: &[("intensity", UInt16, 1)] },
        Row { field: Field::Classification, words: &["CLASSIFICATION"], objects: &["classification"], ty: UInt8, elements: 1, columns: &[("classification", UInt8, 1)] },
        Row { field: Field::ReturnNumber, words: &["RETURN_NUMBER"], objects: &["return number"], ty: UInt8, elements: 1, columns: &[("return number", UInt8, 1)] },
        Row { field: Field::NumberOfReturns, words: &["NUMBER_OF_RETURNS"], objects: &["number of returns"], ty: UInt8, elements: 1, columns: &[("number of returns", UInt8, 1)] },
        Row { field: Field::SourceId, words: &["SOURCE_ID"], objects: &["source id"], ty: UInt16, elements: 1, columns: &[("point source id", UInt16, 1)] },
        Row { field: Field::GpsTime, words: &["GPS_TIME"], objects: &["gps-time"], ty: Float64, elements: 1, columns: &[("gps-time", Float64, 1)] },
        Row { field: Field::NormalSpheremapped, words: &["NORMAL_SPHEREMAPPED"], objects: &["NORMAL_SPHEREMAPPED"], ty: UInt8, elements: 2, columns: NORMALS },
        Row { field: Field::NormalOct16, words: &["NORMAL_OCT16"], objects: &["NORMAL_OCT16"], ty: UInt8, elements: 2, columns: NORMALS },
        Row { field: Field::Normal, words: &["NORMAL", "NORMAL_FLOATS"], objects: &["NORMAL"], ty: Float32, elements: 3, columns: NORMALS },
        Row { field: Field::Filler, words: &["FILLER_1B"], objects: &[], ty: UInt8, elements: 1, columns: &[] },
    ]
};

impl Field {
    fn row(self) -> Option<&'static Row> {
        ROWS.iter().find(|row| row.field == self)
    }

    /// The word that version 1.7 writes: "COLOR_PACKED". `None` of [`Self::Other`].
    pub fn word(self) -> Option<&'static str> {
        self.row()?.words.first().copied()
    }

    /// The `name` that version 1.8 writes: "RGBA". `None` of what that version does not have, and of [`Self::Other`].
    pub fn object_name(self) -> Option<&'static str> {
        self.row()?.objects.first().copied()
    }

    /// The field that a word of version 1.7 and older means.
    pub fn from_word(word: &str) -> Option<Self> {
        ROWS.iter().find(|row| row.words.contains(&word)).map(|row| row.field)
    }

    /// The field that a `name` of version 1.8 means; [`Self::Other`] for a name of no special meaning.
    pub fn from_object_name(name: &str) -> Self {
        ROWS.iter().find(|row| row.objects.contains(&name)).map_or(Self::Other, |row| row.field)
    }

    /// The field whose values are those of the column `name` of [`crate::NodePoints`], unchanged: "intensity",
    /// "point source id", …; of "rgb" [`Self::Rgba`], whose values are the upper bytes.
    pub fn from_column(name: &str) -> Option<Self> {
        let single = |row: &&Row| matches!(row.columns, [(column, ..)] if *column == name);
        ROWS.iter().find(single).map(|row| row.field)
    }
}

/// A part of the records of a dataset.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct PointAttribute {
    /// What it is.
    pub field: Field,
    /// The word, or the `name` of the object.
    pub name: String,
    /// Type of one element, as stored.
    pub ty: AttributeType,
    /// Elements of a point, at least 1.
    pub elements: usize,
    /// Free text; version 1.8 only.
    pub description: String,
}

impl PointAttribute {
    /// The attribute of version 1.7 for `field`, which has a word.
    #[must_use]
    pub fn of_words(field: Field) -> Option<Self> {
        Some(Self::new(field, field.word()?))
    }

    /// The attribute of version 1.8 for `field`, which has a name there.
    #[must_use]
    pub fn of_objects(field: Field) -> Option<Self> {
        Some(Self::new(field, field.object_name()?))
    }

    /// An attribute of version 1.8 that the format gives no meaning.
    #[must_use]
    pub fn other(name: impl Into<String>, ty: AttributeType, elements: usize) -> Self {
        Self { field: Field::Other, name: name.into(), ty, elements, description: String::new() }
    }

    /// A field under one of its names.
    pub(super) fn new(field: Field, name: &str) -> Self {
        let (ty, elements) = field.row().map_or((AttributeType::UInt8, 1), |row| (row.ty, row.elements));
        Self { field, name: name.to_owned(), ty, elements, description: String::new() }
    }

    /// Bytes of a point.
    pub fn size(&self) -> usize {
        self.elements * self.ty.size()
    }

    /// True if the type is one that the field can have.
    pub(super) fn is_sound(&self) -> bool {
        self.field.row().is_none_or(|row| {
            // the reference calls bytes of normals signed, and reads them as unsigned
            let same_bytes = self.ty == row.ty || (self.ty, row.ty) == (AttributeType::Int8, AttributeType::UInt8);
            same_bytes && self.elements == row.elements
        })
    }

    /// The columns that it becomes: none of positions and fillers, three of normals, else one.
    pub(super) fn columns(&self) -> Vec<Attribute> {
        match self.field.row() {
            Some(row) => row.columns.iter().map(|(name, ty, elements)| Attribute::new(*name, *ty, *elements)).collect(),
            None => {
                let mut attribute = Attribute::new(&self.name, self.ty, self.elements);
                attribute.description.clone_from(&self.description);
                vec![attribute]
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_leads_to_its_field_and_back() {
        for row in ROWS {
            assert!(row.words.iter().all(|word| Field::from_word(word) == Some(row.field)));
            assert!(row.objects.iter().all(|name| Field::from_object_name(name) == row.field));
            let attribute = PointAttribute::of_words(row.field).unwrap();
            assert!(attribute.is_sound());
            assert_eq!(PointAttribute::of_objects(row.field).is_some(), !row.objects.is_empty());
        }
        assert_eq!(Field::from_word("intensity"), None);
        assert_eq!(Field::from_object_name("Amplitude"), Field::Other);
    }

    #[test]
    fn columns_have_the_names_of_potree_2() {
        for (name, word) in [
            ("rgb", "COLOR_PACKED"),
            ("intensity", "INTENSITY"),
            ("classification", "CLASSIFICATION"),
            ("point source id", "SOURCE_ID"),
            ("gps-time", "GPS_TIME"),
        ] {
            assert_eq!(Field::from_column(name).and_then(Field::word), Some(word));
        }
        assert_eq!(["NormalX", "position", "user data"].map(Field::from_column), [None; 3]);
    }

    #[test]
    fn sizes_are_those_of_the_page() {
        let size = |word| PointAttribute::new(Field::from_word(word).unwrap(), word).size();
        let words = ["POSITION_CARTESIAN", "RGBA_PACKED", "RGB_PACKED", "GPS_TIME", "NORMAL_OCT16", "NORMAL_FLOATS"];
        assert_eq!(words.map(size), [12, 4, 3, 8, 2, 12]);
    }
}
