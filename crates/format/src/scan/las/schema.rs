//! Which columns a point format has, and where their bits lie in a record (LAS 1.4 R15 §2.6).

use super::compatible::{Compatible, Recovered};
use super::extra_bytes::ExtraBytes;
use super::header::Header;
use super::records::Records;
use crate::scan::quantities::{NORMALS, is_normal, normal_axis};
use crate::{Attribute, AttributeType, ScanWarning};

/// Where the values of a column lie in a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Field {
    /// Bytes from the start of the record.
    pub(super) at: usize,
    /// Values a point, side by side.
    pub(super) elements: usize,
    /// How the bytes become values.
    pub(super) kind: FieldKind,
    /// What must be decompressed for it (formats 6–10).
    pub(super) layer: Layer,
}

/// How the bytes of a field become the values of its column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum FieldKind {
    /// `byte >> shift & mask`, a `uint8`.
    Bits { shift: u8, mask: u8 },
    /// Little-endian values of the attribute's type, `elements` of them side by side.
    Plain,
    /// Compatibility mode: the sum of an old field and the extra byte or bytes at [`Field::at`].
    Recovered(Recovered),
}

/// The part of a layered LAZ chunk that a field comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Layer {
    /// Comes with x and y.
    Base,
    Classification,
    Flags,
    Intensity,
    ScanAngle,
    UserData,
    PointSource,
    GpsTime,
    Rgb,
    Nir,
    ExtraBytes,
}

/// The columns beside the position, in order, each with its place in the record.
#[derive(Debug, Default)]
pub(super) struct Schema {
    pub(super) attributes: Vec<Attribute>,
    pub(super) fields: Vec<Field>,
    /// The points are those of a format 6–10 in LASzip's compatibility mode.
    pub(super) compatible: Option<Compatible>,
}

/// Names that an extra-bytes attribute may not take, whatever the point format: what is joined to a cloud later may
/// have the standard one.
const STANDARD_NAMES: [&str; 17] = [
    "position",
    "rgb",
    "rgba",
    "nir",
    "intensity",
    "return number",
    "number of returns",
    "classification flags",
    "classification",
    "scan angle rank",
    "user data",
    "scan angle",
    "point source id",
    "gps-time",
    "scanner channel",
    "scan direction flag",
    "edge of flight line",
];

impl Schema {
    /// Standard columns first (colour before the rest), then the documented extra bytes.
    pub(super) fn new(header: &Header, records: &Records, warnings: &mut Vec<ScanWarning>) -> Self {
        let mut extra = ExtraBytes::read_all(header, records, warnings);
        let compatible = Compatible::take(header, records, &mut extra, warnings);
        let mut schema = Self { compatible, ..Self::default() };
        schema.colours(header.point_format);
        match compatible {
            Some(places) => schema.compatible(&places),
            None if header.point_format < 6 => schema.legacy(header.point_format),
            None => schema.extended(),
        }
        if matches!(header.point_format, 4 | 5 | 9 | 10) {
            warnings.push(ScanWarning::Waveforms { point_format: header.point_format });
        }
        schema.extra_bytes(extra);
        schema
    }

    /// The standard columns of a point format, for writers.
    pub(super) fn of_format(point_format: u8) -> Self {
        let mut schema = Self::default();
        schema.colours(point_format);
        match point_format < 6 {
            true => schema.legacy(point_format),
            false => schema.extended(),
        }
        schema
    }

    fn colours(&mut self, point_format: u8) {
        let at = match point_format {
            2 => 20,
            3 | 5 => 28,
            7 | 8 | 10 => 30,
            _ => return,
        };
        self.plain("rgb", AttributeType::UInt16, 3, at, Layer::Rgb);
        if matches!(point_format, 8 | 10) {
            self.plain("nir", AttributeType::UInt16, 1, at + 6, Layer::Nir);
        }
    }

    /// Formats 0–5.
    fn legacy(&mut self, point_format: u8) {
        self.plain("intensity", AttributeType::UInt16, 1, 12, Layer::Base);
        self.bits("return number", 14, 0, 0b111, Layer::Base);
        self.bits("number of returns", 14, 3, 0b111, Layer::Base);
        // synthetic, key-point, withheld: the order that LAS 1.4 gives them
        self.bits("classification flags", 15, 5, 0b111, Layer::Base);
        self.bits("classification", 15, 0, 0b1_1111, Layer::Base);
        self.plain("scan angle rank", AttributeType::Int8, 1, 16, Layer::Base);
        self.bits("user data", 17, 0, 0xff, Layer::Base);
        self.plain("point source id", AttributeType::UInt16, 1, 18, Layer::Base);
        if matches!(point_format, 1 | 3 | 4 | 5) {
            self.plain("gps-time", AttributeType::Float64, 1, 20, Layer::Base);
        }
        self.bits("scan direction flag", 14, 6, 1, Layer::Base);
        self.bits("edge of flight line", 14, 7, 1, Layer::Base);
    }

    /// Formats 6–10.
    fn extended(&mut self) {
        self.plain("intensity", AttributeType::UInt16, 1, 12, Layer::Intensity);
        self.bits("return number", 14, 0, 0b1111, Layer::Base);
        self.bits("number of returns", 14, 4, 0b1111, Layer::Base);
        self.bits("classification flags", 15, 0, 0b1111, Layer::Flags);
        self.bits("classification", 16, 0, 0xff, Layer::Classification);
        self.bits("user data", 17, 0, 0xff, Layer::UserData);
        self.plain("scan angle", AttributeType::Int16, 1, 18, Layer::ScanAngle);
        self.plain("point source id", AttributeType::UInt16, 1, 20, Layer::PointSource);
        self.plain("gps-time", AttributeType::Float64, 1, 22, Layer::GpsTime);
        self.bits("scanner channel", 15, 4, 0b11, Layer::Base);
        self.bits("scan direction flag", 15, 6, 1, Layer::Flags);
        self.bits("edge of flight line", 15, 7, 1, Layer::Flags);
    }

    /// Formats 6–10 in records of format 1, 3, 4 or 5: the columns of [`Self::extended`].
    fn compatible(&mut self, places: &Compatible) {
        use AttributeType::{Float64, Int16, UInt16};
        if let Some(nir) = places.nir {
            self.plain("nir", UInt16, 1, nir, Layer::Base);
        }
        self.plain("intensity", UInt16, 1, 12, Layer::Base);
        self.recovered("return number", AttributeType::UInt8, places.returns, Recovered::ReturnNumber);
        self.recovered("number of returns", AttributeType::UInt8, places.returns, Recovered::NumberOfReturns);
        self.recovered("classification flags", AttributeType::UInt8, places.flags, Recovered::ClassificationFlags);
        self.recovered("classification", AttributeType::UInt8, places.class, Recovered::Classification);
        self.bits("user data", 17, 0, 0xff, Layer::Base);
        self.recovered("scan angle", Int16, places.scan_angle, Recovered::ScanAngle);
        self.plain("point source id", UInt16, 1, 18, Layer::Base);
        self.plain("gps-time", Float64, 1, 20, Layer::Base);
        self.bits("scanner channel", places.flags, 1, 0b11, Layer::Base);
        self.bits("scan direction flag", 14, 6, 1, Layer::Base);
        self.bits("edge of flight line", 14, 7, 1, Layer::Base);
    }

    fn extra_bytes(&mut self, mut extra: Vec<ExtraBytes>) {
        name_normals(&mut extra);
        for ExtraBytes { mut attribute, at } in extra {
            attribute.name = self.free_name(&attribute.name);
            let (elements, kind) = (attribute.elements, FieldKind::Plain);
            self.push(attribute, Field { at, elements, kind, layer: Layer::ExtraBytes });
        }
    }

    /// `wanted`, or with a suffix if it is empty or taken.
    fn free_name(&self, wanted: &str) -> String {
        let base = if wanted.is_empty() { "extra bytes" } else { wanted };
        let taken =
            |name: &str| STANDARD_NAMES.contains(&name) || self.attributes.iter().any(|a| a.name.as_str() == name);
        if !taken(base) {
            return base.to_owned();
        }
        (2..).map(|i| format!("{base} {i}")).find(|name| !taken(name)).unwrap_or_default()
    }

    fn bits(&mut self, name: &str, at: usize, shift: u8, mask: u8, layer: Layer) {
        let kind = FieldKind::Bits { shift, mask };
        self.push(Attribute::new(name, AttributeType::UInt8, 1), Field { at, elements: 1, kind, layer });
    }

    fn recovered(&mut self, name: &str, ty: AttributeType, at: usize, from: Recovered) {
        let kind = FieldKind::Recovered(from);
        self.push(Attribute::new(name, ty, 1), Field { at, elements: 1, kind, layer: Layer::Base });
    }

    fn plain(&mut self, name: &str, ty: AttributeType, elements: usize, at: usize, layer: Layer) {
        self.push(Attribute::new(name, ty, elements), Field { at, elements, kind: FieldKind::Plain, layer });
    }

    fn push(&mut self, attribute: Attribute, field: Field) {
        self.attributes.push(attribute);
        self.fields.push(field);
    }
}

/// Normals get their usual names, whatever the file calls them: three scalars, or the first triple of that name, which
/// becomes three scalars. Values, scale and offset stay.
fn name_normals(found: &mut Vec<ExtraBytes>) {
    let place = |axis: usize| {
        let is_it = |e: &ExtraBytes| e.attribute.elements == 1 && normal_axis(&e.attribute.name) == Some(axis);
        found.iter().position(is_it)
    };
    if let (Some(x), Some(y), Some(z)) = (place(0), place(1), place(2)) {
        for (i, name) in [x, y, z].into_iter().zip(NORMALS) {
            found[i].attribute.name = name.to_owned();
        }
        return;
    }
    let is_triple = |e: &ExtraBytes| e.attribute.elements == 3 && is_normal(&e.attribute.name);
    let Some(i) = found.iter().position(is_triple) else { return };
    let ExtraBytes { attribute: triple, at } = found.remove(i);
    for (axis, name) in NORMALS.into_iter().enumerate().rev() {
        let mut attribute = Attribute::new(name, triple.ty, 1);
        attribute.description.clone_from(&triple.description);
        attribute.scale = vec![triple.scale[axis]];
        attribute.offset = vec![triple.offset[axis]];
        attribute.no_data = triple.no_data.as_ref().map(|values| vec![values[axis]]);
        found.insert(i, ExtraBytes { attribute, at: at + axis * triple.ty.size() });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extra(name: &str, elements: usize, at: usize) -> ExtraBytes {
        ExtraBytes { attribute: Attribute::new(name, AttributeType::Int16, elements), at }
    }

    fn places(found: &[ExtraBytes]) -> Vec<(&str, usize)> {
        found.iter().map(|e| (e.attribute.name.as_str(), e.at)).collect()
    }

    #[test]
    fn normals_have_one_set_of_names_and_a_part_of_one_is_none() {
        let mut found =
            vec![extra("confidence", 1, 36), extra("normal z", 1, 42), extra("Nx", 1, 38), extra("Ny", 1, 40)];
        name_normals(&mut found);
        assert_eq!(places(&found), [("confidence", 36), ("NormalZ", 42), ("NormalX", 38), ("NormalY", 40)]);
        let mut triple = vec![extra("Normals", 3, 36)];
        name_normals(&mut triple);
        assert_eq!(places(&triple), [("NormalX", 36), ("NormalY", 38), ("NormalZ", 40)]);
        let mut part = vec![extra("nx", 1, 36), extra("ny", 1, 38)];
        name_normals(&mut part);
        assert_eq!(places(&part), [("nx", 36), ("ny", 38)]);
    }

    #[test]
    fn a_taken_or_empty_name_gets_a_number() {
        let mut schema = Schema::default();
        for expected in ["echo", "echo 2", "echo 3"] {
            let name = schema.free_name("echo");
            assert_eq!(name, expected);
            schema.bits(&name, 0, 0, 1, Layer::Base);
        }
        assert_eq!(schema.free_name("intensity"), "intensity 2");
        assert_eq!(schema.free_name(""), "extra bytes");
    }
}
