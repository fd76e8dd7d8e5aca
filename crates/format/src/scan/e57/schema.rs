//! From the prototypes of all scans to one set of columns, and where each scan finds their values.

use super::fields::{Encoding, Field, Name};
use super::notes::Notes;
use super::options::E57Options;
use super::scaling::Scaling;
use crate::scan::quantities::{NORMALS, quantity};
use crate::{Attribute, AttributeType, AxisGrid, Resolution, ScanWarning};

/// Columns that a file may have: more is not a scan.
const MAX_ATTRIBUTES: usize = 1000;
/// Columns times scans: so much is held in memory for them.
const MAX_FILLS: usize = 1_000_000;

/// The fields of a coordinate triple; a missing one is 0.
pub(super) type Triple = [Option<usize>; 3];

/// Where a scan's positions are.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct PositionFields {
    /// x, y, z.
    pub(super) cartesian: Option<Triple>,
    pub(super) cartesian_invalid: Option<usize>,
    /// Range, azimuth, elevation.
    pub(super) spherical: Option<Triple>,
    pub(super) spherical_invalid: Option<usize>,
}

/// Where a scan's values of a column come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Fill {
    /// The scan has none: zeros.
    Zero,
    /// The same for all.
    ScanIndex(u16),
    /// Three fields, side by side; 0 where the `invalid` field is not.
    Colour { fields: [usize; 3], scaling: [Scaling; 3], invalid: Option<usize> },
    /// A field scaled to 16 bits; 0 where the `invalid` field is not.
    Intensity { field: usize, scaling: Scaling, invalid: Option<usize> },
    /// One component of a direction that turns with the scan.
    Normal { fields: [usize; 3], axis: usize },
    /// As it is, plus `add`; NaN (integers: 0) where the `invalid` field is not 0.
    Plain { field: usize, invalid: Option<usize>, add: i64 },
}

/// The fields of a scan by role.
#[derive(Debug, Default)]
pub(super) struct Roles {
    pub(super) positions: PositionFields,
    pub(super) colour: Option<[usize; 3]>,
    pub(super) intensity: Option<usize>,
    normal: Option<[usize; 3]>,
    /// Extra columns, with the field that says where they are invalid.
    extras: Vec<(usize, Option<usize>)>,
    colour_invalid: Option<usize>,
    intensity_invalid: Option<usize>,
}

impl Roles {
    /// Sorts the fields of a scan.
    ///
    /// # Errors
    /// Why the scan has no positions, as text.
    pub(super) fn new(
        fields: &[Field],
        scan: usize,
        options: &E57Options,
        notes: &mut Notes,
    ) -> Result<Self, &'static str> {
        use Name as N;
        let is_text = |i: usize| fields[i].encoding == Encoding::Text;
        let find = |name: N| fields.iter().position(|f| f.name == name).filter(|i| !is_text(*i));
        let triple = |names: [N; 3]| {
            let [a, b, c] = names.map(find);
            Some([a?, b?, c?])
        };
        let [x, y, z] = [N::CartesianX, N::CartesianY, N::CartesianZ].map(find);
        let [range, azimuth, elevation] = [N::SphericalRange, N::SphericalAzimuth, N::SphericalElevation].map(find);
        let cartesian = (x.is_some() && y.is_some()).then_some([x, y, z]);
        let spherical = (range.is_some() && azimuth.is_some()).then_some([range, azimuth, elevation]);
        let positions = PositionFields {
            // half a triple counts only if there is no whole one
            cartesian: cartesian.filter(|_| z.is_some() || spherical.is_none() || elevation.is_none()),
            cartesian_invalid: find(N::CartesianInvalidState),
            spherical: spherical.filter(|_| elevation.is_some() || cartesian.is_none()),
            spherical_invalid: find(N::SphericalInvalidState),
        };
        match (positions.cartesian, positions.spherical) {
            (None, None) => return Err("its points have neither x and y nor range and azimuth"),
            (Some([.., None]), _) => notes.add(scan, ScanWarning::NoZ),
            (None, Some([.., None])) => notes.add(scan, ScanWarning::NoElevation),
            _ => {}
        }
        let normal = {
            let component = |tag: &str| fields.iter().position(|f| f.tag() == tag).filter(|i| !is_text(*i));
            let [x, y, z] = ["normalX", "normalY", "normalZ"].map(component);
            x.zip(y).zip(z).map(|((x, y), z)| [x, y, z])
        };
        let mut roles = Self {
            positions,
            colour: triple([N::ColorRed, N::ColorGreen, N::ColorBlue]),
            intensity: find(N::Intensity),
            normal,
            extras: Vec::new(),
            colour_invalid: find(N::IsColorInvalid),
            intensity_invalid: find(N::IsIntensityInvalid),
        };
        for (i, field) in fields.iter().enumerate() {
            if is_text(i) {
                notes.add(scan, ScanWarning::TextField { name: field.tag().to_owned() });
                continue;
            }
            match field.name {
                N::TimeStamp => roles.extras.push((i, find(N::IsTimeStampInvalid))),
                N::ReturnCount | N::ReturnIndex => roles.extras.push((i, None)),
                N::RowIndex | N::ColumnIndex if options.keep_row_column => roles.extras.push((i, None)),
                N::Other { .. } if roles.normal.is_none_or(|n| !n.contains(&i)) => roles.extras.push((i, None)),
                N::ColorRed | N::ColorGreen | N::ColorBlue if roles.colour.is_none() => {
                    notes.add(scan, ScanWarning::ColourIncomplete);
                }
                _ => {}
            }
        }
        Ok(roles)
    }

    /// Which fields must be read for the column.
    pub(super) fn mark(fill: Fill, needed: &mut [bool]) {
        let mut mark = |field: usize| needed[field] = true;
        match fill {
            Fill::Zero | Fill::ScanIndex(_) => {}
            Fill::Colour { fields, invalid, .. } => fields.into_iter().chain(invalid).for_each(mark),
            Fill::Normal { fields, .. } => fields.into_iter().for_each(mark),
            Fill::Intensity { field, invalid, .. } | Fill::Plain { field, invalid, .. } => {
                mark(field);
                invalid.into_iter().for_each(mark);
            }
        }
    }
}

impl PositionFields {
    /// The first field of positions whose scale and offset place no point: what is wrong with it.
    pub(super) fn misplaced(&self, fields: &[Field]) -> Option<String> {
        let [x, y, z] = self.cartesian.unwrap_or_default();
        let [range, azimuth, elevation] = self.spherical.unwrap_or_default();
        let lengths = [x, y, z, range].into_iter().flatten().find_map(|i| fields[i].misplaced(true));
        lengths.or_else(|| [azimuth, elevation].into_iter().flatten().find_map(|i| fields[i].misplaced(false)))
    }

    /// How finely the coordinates are stored, per axis, before the pose. `farthest`: the largest value of a field, of a
    /// sample: what the file declares may be wrong by orders of magnitude.
    pub(super) fn resolution(&self, fields: &[Field], farthest: impl Fn(usize) -> f64) -> [Resolution; 3] {
        let of_field = |i: usize| match fields[i].encoding {
            Encoding::Scaled { scale, offset, .. } if scale.is_normal() && offset.is_finite() => {
                Resolution::Grid(AxisGrid { step: scale.abs(), offset })
            }
            Encoding::Integer { .. } => Resolution::Grid(AxisGrid { step: 1.0, offset: 0.0 }),
            // 24 bits of the largest coordinate
            Encoding::Single => match Some(farthest(i)).filter(|f| *f > 0.0 && *f < 1e30) {
                Some(far) => Resolution::Step(2f64.powi(far.log2().floor() as i32 - 23)),
                None => Resolution::Double,
            },
            Encoding::Scaled { .. } | Encoding::Double | Encoding::Text => Resolution::Double,
        };
        match self.cartesian {
            // an axis that the file lacks is zero
            Some(fields) => fields.map(|f| f.map_or(Resolution::Grid(AxisGrid { step: 1.0, offset: 0.0 }), of_field)),
            None => [Resolution::Double; 3],
        }
    }

    /// Marks the fields that positions need.
    pub(super) fn mark(&self, needed: &mut [bool]) {
        let triples = self.cartesian.into_iter().chain(self.spherical).flatten().flatten();
        triples.chain(self.cartesian_invalid).chain(self.spherical_invalid).for_each(|field| needed[field] = true);
    }
}

/// One scan as the schema sees it: its index, fields, their roles, the scaling of colour and intensity.
pub(super) struct ScanFields<'a> {
    pub(super) index: usize,
    pub(super) fields: &'a [Field],
    pub(super) roles: &'a Roles,
    pub(super) colour: Option<[Scaling; 3]>,
    pub(super) intensity: Option<Scaling>,
}

/// The columns of a file, and for each scan where their values come from.
#[derive(Debug, Default)]
pub(super) struct Schema {
    pub(super) attributes: Vec<Attribute>,
    /// By scan as given, by attribute.
    pub(super) fills: Vec<Vec<Fill>>,
}

/// What an extra column holds, over all scans.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    Integer { min: i64, max: i64, scale: f64, offset: f64 },
    Single,
    Double,
}

impl Kind {
    fn of(encoding: Encoding) -> Self {
        match encoding {
            Encoding::Integer { min, max } => Self::Integer { min, max, scale: 1.0, offset: 0.0 },
            Encoding::Scaled { min, max, scale, offset } if scale.is_normal() && offset.is_finite() => {
                Self::Integer { min, max, scale, offset }
            }
            Encoding::Single => Self::Single,
            Encoding::Double | Encoding::Scaled { .. } | Encoding::Text => Self::Double,
        }
    }

    /// What holds the values of both without loss, or as doubles.
    fn with(self, other: Self) -> Self {
        match (self, other) {
            (Self::Integer { min, max, scale, offset }, Self::Integer { min: a, max: b, scale: s, offset: o })
                if scale == s && offset == o =>
            {
                Self::Integer { min: min.min(a), max: max.max(b), scale, offset }
            }
            (a, b) if a == b => a,
            _ => Self::Double,
        }
    }

    /// What holds the values plus a small whole number.
    fn plus(self, add: i64) -> Self {
        match self {
            Self::Integer { min, max, scale, offset } => {
                Self::Integer { min: min.saturating_add(add), max: max.saturating_add(add), scale, offset }
            }
            float => float,
        }
    }

    fn attribute(self, name: String) -> Attribute {
        let ty = match self {
            Self::Integer { min, max, .. } => smallest(min, max),
            Self::Single => AttributeType::Float32,
            Self::Double => AttributeType::Float64,
        };
        let mut attribute = Attribute::new(name, ty, 1);
        if let Self::Integer { scale, offset, .. } = self {
            (attribute.scale, attribute.offset) = (vec![scale], vec![offset]);
        }
        attribute
    }
}

/// The name of an extra column: that of its quantity, where others have it, too.
fn usual_name<'a>(name: &Name, tag: &'a str, ty: AttributeType) -> &'a str {
    // what the standard has itself, or a part of a normal, is not the quantity if an extension has it
    let is_usual = |n: &&str| !matches!(*n, "intensity" | "point source id") && !NORMALS.contains(n);
    match name {
        Name::ReturnIndex => "return number",
        Name::ReturnCount => "number of returns",
        Name::TimeStamp => "timestamp",
        Name::Other { .. } => quantity(tag, ty).filter(is_usual).unwrap_or(tag),
        _ => tag,
    }
}

/// The smallest type that holds both.
fn smallest(min: i64, max: i64) -> AttributeType {
    use AttributeType as T;
    let unsigned = [(u8::MAX.into(), T::UInt8), (u16::MAX.into(), T::UInt16), (u32::MAX.into(), T::UInt32)];
    let signed = [(i8::MAX.into(), T::Int8), (i16::MAX.into(), T::Int16), (i32::MAX.into(), T::Int32)];
    let fits = |(top, _): &&(i64, T)| max <= *top && (min >= 0 || -1 - *top <= min);
    let types = if min >= 0 { &unsigned } else { &signed };
    types.iter().find(fits).map_or(T::Int64, |(_, ty)| *ty)
}

impl Schema {
    /// Colour, intensity, scan index, normals, then the other fields in the order of their first appearance.
    ///
    /// # Errors
    /// Too many columns.
    pub(super) fn new(scans: &[ScanFields<'_>]) -> Result<Self, String> {
        let mut schema = Self { attributes: Vec::new(), fills: vec![Vec::new(); scans.len()] };
        let has = |f: fn(&Roles) -> bool| scans.iter().any(|s| f(s.roles));
        if has(|r| r.colour.is_some()) {
            schema.push(Attribute::new("rgb", AttributeType::UInt16, 3), scans, |s| {
                let (fields, scaling) = s.roles.colour.zip(s.colour)?;
                Some(Fill::Colour { fields, scaling, invalid: s.roles.colour_invalid })
            });
        }
        if has(|r| r.intensity.is_some()) {
            schema.push(Attribute::new("intensity", AttributeType::UInt16, 1), scans, |s| {
                let (field, scaling) = s.roles.intensity.zip(s.intensity)?;
                Some(Fill::Intensity { field, scaling, invalid: s.roles.intensity_invalid })
            });
        }
        schema.push(Attribute::new("point source id", AttributeType::UInt16, 1), scans, |s| {
            Some(Fill::ScanIndex(u16::try_from(s.index).unwrap_or(u16::MAX)))
        });
        if has(|r| r.normal.is_some()) {
            for (axis, name) in ["NormalX", "NormalY", "NormalZ"].into_iter().enumerate() {
                schema.push(Attribute::new(name, AttributeType::Float32, 1), scans, |s| {
                    s.roles.normal.map(|fields| Fill::Normal { fields, axis })
                });
            }
        }
        schema.extras(scans)?;
        Ok(schema)
    }

    fn extras(&mut self, scans: &[ScanFields<'_>]) -> Result<(), String> {
        let mut columns: Vec<(&Name, &str, Kind)> = Vec::new();
        for scan in scans {
            for (i, _) in &scan.roles.extras {
                let field = &scan.fields[*i];
                let kind = Kind::of(field.encoding);
                match columns.iter_mut().find(|(name, ..)| **name == field.name) {
                    Some((.., known)) => *known = known.with(kind),
                    None => columns.push((&field.name, field.tag(), kind)),
                }
                if columns.len() > MAX_ATTRIBUTES {
                    return Err(format!("its points have more than {MAX_ATTRIBUTES} fields"));
                }
                if columns.len() * scans.len() > MAX_FILLS {
                    return Err(format!("{} scans with {} fields or more", scans.len(), columns.len()));
                }
            }
        }
        for (name, tag, kind) in columns {
            // the index of a return counts from 0, the number of a return from 1
            let add = i64::from(*name == Name::ReturnIndex);
            let mut attribute = kind.plus(add).attribute(String::new());
            let usual = usual_name(name, tag, attribute.ty);
            let is_free = self.attributes.iter().all(|a| a.name != usual);
            attribute.name = self.free_name(if is_free { usual } else { tag });
            self.push(attribute, scans, |s| {
                let extra = s.roles.extras.iter().find(|(i, _)| s.fields[*i].name == *name);
                extra.map(|(field, invalid)| Fill::Plain { field: *field, invalid: *invalid, add })
            });
        }
        Ok(())
    }

    fn push(&mut self, attribute: Attribute, scans: &[ScanFields<'_>], fill: impl Fn(&ScanFields<'_>) -> Option<Fill>) {
        self.attributes.push(attribute);
        for (fills, scan) in self.fills.iter_mut().zip(scans) {
            fills.push(fill(scan).unwrap_or(Fill::Zero));
        }
    }

    /// `wanted`, or with a number if it is taken (two extensions may use one name).
    fn free_name(&self, wanted: &str) -> String {
        let taken = |name: &str| self.attributes.iter().any(|a| a.name == name);
        if !taken(wanted) {
            return wanted.to_owned();
        }
        (2..).map(|i| format!("{wanted} {i}")).find(|name| !taken(name)).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_gets_the_smallest_type_that_holds_it() {
        use AttributeType as T;
        let cases = [(0, 255, T::UInt8), (0, 256, T::UInt16), (-1, 127, T::Int8), (-129, 0, T::Int16)];
        assert!(cases.iter().all(|(min, max, ty)| smallest(*min, *max) == *ty));
        assert_eq!((smallest(0, i64::MAX), smallest(i64::MIN, 0)), (T::Int64, T::Int64));
        assert_eq!((smallest(-1, 1 << 31), smallest(0, 1 << 31)), (T::Int64, T::UInt32));
    }

    #[test]
    fn fields_that_differ_between_scans_share_a_column_that_holds_both() {
        let int = |min, max| Kind::of(Encoding::Integer { min, max });
        assert_eq!(int(0, 5).with(int(-3, 2)), int(-3, 5));
        let scaled = Kind::of(Encoding::Scaled { min: 0, max: 9, scale: 0.5, offset: 0.0 });
        assert_eq!(scaled.with(int(0, 5)), Kind::Double);
        assert_eq!(Kind::Single.with(Kind::Single), Kind::Single);
    }
}
