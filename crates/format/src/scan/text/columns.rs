//! What the columns of a text hold: by name, by number, by value.

use crate::scan::source::Source;
use crate::scan::tabular::{
    ColumnRange, Field, LineRule, MAX_FIELDS, Property, Role, RowScan, Rule, Schema, Storage, Target, las_type,
    probe_rows, role,
};
use crate::{Advice, AttributeType, Piece, ReadError, ScanWarning};

/// Advice for types.
const TYPES: &str = "types are int8, uint8, int16, uint16, int32, uint32, int64, uint64, float, double";

/// A column before its type is known.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Column {
    pub(super) role: Role,
    pub(super) name: String,
    /// If it is requested.
    pub(super) ty: Option<AttributeType>,
}

impl Column {
    /// A column of that name, with a type behind a colon if there is one.
    pub(super) fn named(name: &str) -> Result<Self, String> {
        let (name, ty) = match name.rsplit_once(':') {
            None => (name, None),
            Some((name, ty)) => {
                let found = AttributeType::from_potree_name(ty.trim());
                (name, Some(found.ok_or_else(|| format!("the type {ty:?} of column {name} is not known; {TYPES}"))?))
            }
        };
        Ok(Self { role: text_role(name), name: name.trim().to_owned(), ty })
    }

    fn all(names: &[&str]) -> Vec<Self> {
        let column = |name: &&str| Self { role: text_role(name), name: (*name).to_owned(), ty: None };
        names.iter().map(column).collect()
    }

    fn padding() -> Self {
        Self { role: Role::Padding, name: String::new(), ty: None }
    }
}

/// [`super::check_columns`].
pub(super) fn check(names: &[String]) -> Result<(), String> {
    let columns: Vec<Column> = names.iter().map(|n| Column::named(n)).collect::<Result<_, _>>()?;
    let count = |role: &Role| columns.iter().filter(|c| c.role == *role).count();
    for (axis, name) in ["x", "y"].into_iter().enumerate() {
        if count(&Role::Axis(axis)) == 0 {
            return Err(format!("there is no {name}; name every column in order, as in x,y,z,r,g,b,i"));
        }
    }
    let mut seen: Vec<&Column> = Vec::new();
    for column in columns.iter().filter(|c| c.role != Role::Padding) {
        if seen.iter().any(|c| c.role == column.role) {
            return Err(format!("{} stands twice; write - for columns to leave out", column.name));
        }
        seen.push(column);
    }
    Ok(())
}

/// Text has shorter and longer names than the other formats; a unit in brackets does not count.
fn text_role(name: &str) -> Role {
    let bare = name.split(['[', '(']).next().unwrap_or(name).trim();
    match bare.to_ascii_lowercase().as_str() {
        "-" | "_" | "skip" => Role::Padding,
        "i" => Role::Intensity,
        "c" | "class" => Role::Classification,
        "easting" => Role::Axis(0),
        "northing" => Role::Axis(1),
        "elevation" | "height" => Role::Axis(2),
        // packed colours are PCL's
        "rgb" | "rgba" => Role::Other(name.trim().to_owned()),
        _ => match role(bare) {
            Role::Other(_) => Role::Other(name.trim().to_owned()),
            role => role,
        },
    }
}

/// Lines of a text whose columns are not yet determined.
pub(super) struct Table {
    pub(super) source: Source,
    pub(super) format: String,
    pub(super) declared: u64,
    pub(super) pieces: Vec<Piece>,
    pub(super) rule: LineRule,
    pub(super) warnings: Vec<ScanWarning>,
    /// For each column, whether its first value is a number.
    pub(super) numeric: Vec<bool>,
    /// −2048…2047 is shifted to 0–4095.
    pub(super) pts_intensity: bool,
    /// Where the first row stands.
    pub(super) first_row: u64,
}

/// A sample of each column.
struct Sample {
    ranges: Vec<ColumnRange>,
    /// Columns from which on all rows have three values that are a unit vector.
    unit_vectors: Vec<usize>,
}

impl Table {
    /// The scan: `columns` by name, or (`None`) by number and values.
    pub(super) fn scan(mut self, columns: Option<Vec<Column>>) -> Result<RowScan, ReadError> {
        if self.numeric.len() > MAX_FIELDS {
            let what = format!("a row has {} columns, more than {MAX_FIELDS}", self.numeric.len());
            return Err(ReadError::broken(self.source.path(), self.first_row, what).advise(Advice::ExportAgain));
        }
        let fields = vec![Field { at: 0, ty: AttributeType::Float64, target: Target::Skip }; self.numeric.len()];
        let raw = Schema { attributes: Vec::new(), fields, flat: false };
        let mut scan = RowScan::new(self.source, self.format, self.declared, raw, Storage::Lines(self.rule));
        scan.pieces = self.pieces;
        let sample = sample(&scan, &self.numeric);
        let mut columns = columns.unwrap_or_else(|| by_number(&sample));
        for (i, column) in columns.iter_mut().enumerate().filter(|(i, _)| self.numeric.get(*i) == Some(&false)) {
            if column.role != Role::Padding {
                self.warnings.push(ScanWarning::ColumnIgnored { number: i + 1, name: column.name.clone() });
            }
            *column = Column::padding();
        }
        let shift =
            |i: usize| self.pts_intensity && columns[i].ty.is_none() && sample.ranges[i].is_integer_in(-2048.0, 2047.0);
        let intensity = columns.iter().position(|c| c.role == Role::Intensity).filter(|i| shift(*i));
        let unit = has_unit_colours(&columns, &sample.ranges);
        let property = |(column, range): (&Column, &ColumnRange)| {
            let ty = column.ty.unwrap_or_else(|| value_type(column, range, unit));
            Property { role: column.role.clone(), ..Property::new(&column.name, ty) }
        };
        let mut properties: Vec<_> = columns.iter().zip(&sample.ranges).map(property).collect();
        if let Some(i) = intensity {
            properties[i].ty = AttributeType::UInt16;
        }
        let mut schema = Schema::new(&properties, &mut self.warnings).map_err(|what| {
            ReadError::broken(scan.source.path(), self.first_row, format!("the columns cannot be determined: {what}"))
                .advise("name them all in order, for example x,y,z,r,g,b,i")
        })?;
        if let Some(i) = intensity {
            shift_intensity(&mut schema, i);
        }
        scan.info.attributes = schema.attributes.clone().into();
        scan.info.warnings = self.warnings;
        scan.schema = schema;
        Ok(scan)
    }
}

/// Colours of 0–1: none is above, and one is between.
fn has_unit_colours(columns: &[Column], ranges: &[ColumnRange]) -> bool {
    let of_colours = || columns.iter().zip(ranges).filter(|(c, _)| matches!(c.role, Role::Colour(_))).map(|(_, r)| r);
    of_colours().all(|r| r.is_in(0.0, 1.001)) && of_colours().any(|r| !r.integers)
}

fn value_type(column: &Column, range: &ColumnRange, unit_colours: bool) -> AttributeType {
    match &column.role {
        Role::Colour(_) if !unit_colours => AttributeType::UInt16,
        Role::Colour(_) | Role::Normal(_) => AttributeType::Float32,
        Role::Intensity if range.is_integer_in(0.0, 65535.0) => AttributeType::UInt16,
        Role::Intensity => AttributeType::Float32,
        Role::Classification => AttributeType::UInt8,
        Role::Other(name) => {
            let fits = |ty: &AttributeType| match ty {
                AttributeType::UInt8 => range.is_integer_in(0.0, 255.0),
                AttributeType::UInt16 => range.is_integer_in(0.0, 65535.0),
                _ => true,
            };
            las_type(name).filter(fits).unwrap_or(AttributeType::Float64)
        }
        Role::Axis(_) | Role::Harmonic(_) | Role::PackedColour | Role::Padding => AttributeType::Float64,
    }
}

fn shift_intensity(schema: &mut Schema, field: usize) {
    if let Some(Field { target: Target::Value { column, rule, .. }, .. }) = schema.fields.get_mut(field) {
        *rule = Rule::Shift;
        schema.attributes[*column].description = "intensity of the PTS file + 2048".to_owned();
    }
}

fn sample(scan: &RowScan, numeric: &[bool]) -> Sample {
    let picks: Vec<usize> = (0..numeric.len()).filter(|i| numeric[*i]).collect();
    let mut ranges = vec![ColumnRange::EMPTY; numeric.len()];
    let mut unit_vectors: Vec<usize> = (3..=7).filter(|i| picks.contains(i) && picks.contains(&(i + 2))).collect();
    probe_rows(scan, &picks, |row| {
        picks.iter().zip(row).for_each(|(i, v)| ranges[*i].add(*v));
        // a row without a normal has zeros or NaN there
        let at = |i: usize| picks.iter().position(|p| *p == i).and_then(|p| row.get(p)).copied().unwrap_or(0.0);
        unit_vectors.retain(|i| {
            let square: f64 = (*i..i + 3).map(|k| at(k) * at(k)).sum();
            (0.98..1.02).contains(&square) || square == 0.0 || square.is_nan()
        });
    });
    // zeros alone are no normals
    unit_vectors.retain(|i| (*i..i + 3).any(|k| ranges[k].min < 0.0 || !ranges[k].integers));
    Sample { ranges, unit_vectors }
}

/// The usual orders, by the number of columns and, where that leaves two, by values.
fn by_number(sample: &Sample) -> Vec<Column> {
    let byte = |i: usize| sample.ranges[i].is_integer_in(0.0, 255.0);
    let normal = |i: usize| sample.unit_vectors.contains(&i);
    let rgb_first = || byte(3) && byte(4) && byte(5) && !byte(6);
    match sample.ranges.len() {
        2 => Column::all(&["x", "y"]),
        3 => Column::all(&["x", "y", "z"]),
        4 => Column::all(&["x", "y", "z", "i"]),
        6 if normal(3) => Column::all(&["x", "y", "z", "nx", "ny", "nz"]),
        6 => Column::all(&["x", "y", "z", "r", "g", "b"]),
        7 if rgb_first() => Column::all(&["x", "y", "z", "r", "g", "b", "i"]),
        7 => Column::all(&["x", "y", "z", "i", "r", "g", "b"]),
        9 if normal(6) => Column::all(&["x", "y", "z", "r", "g", "b", "nx", "ny", "nz"]),
        10 if normal(7) => Column::all(&["x", "y", "z", "i", "r", "g", "b", "nx", "ny", "nz"]),
        n => {
            let mut columns = Column::all(&["x", "y", "z"]);
            let name = |i: usize| format!("column {i}");
            columns.extend((4..=n).map(|i| Column { role: Role::Other(name(i)), name: name(i), ty: None }));
            columns.truncate(n);
            columns
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn roles(ranges: Vec<ColumnRange>) -> String {
        let sample = Sample { ranges, unit_vectors: Vec::new() };
        by_number(&sample).iter().map(|c| c.name.clone()).collect::<Vec<_>>().join(" ")
    }

    fn range(min: f64, max: f64, integers: bool) -> ColumnRange {
        ColumnRange { min, max, integers }
    }

    #[test]
    fn seven_columns_are_ordered_by_their_ranges() {
        let xyz = [range(0.0, 1e5, false); 3];
        let byte = range(0.0, 255.0, true);
        let with = |rest: [ColumnRange; 4]| roles(xyz.iter().copied().chain(rest).collect());
        assert_eq!(with([range(0.0, 4000.0, true), byte, byte, byte]), "x y z i r g b");
        assert_eq!(with([byte, byte, byte, range(0.0, 4000.0, true)]), "x y z r g b i");
        assert_eq!(with([byte, byte, byte, byte]), "x y z i r g b");
        assert_eq!(with([byte, byte, byte, range(0.0, 1.0, false)]), "x y z r g b i");
    }

    #[test]
    fn names_may_have_units_and_types() {
        assert_eq!(text_role("X [m]"), Role::Axis(0));
        assert_eq!(text_role("Easting"), Role::Axis(0));
        let column = Column::named("quality:uint8").unwrap();
        assert_eq!((column.name.as_str(), column.ty), ("quality", Some(AttributeType::UInt8)));
        assert_eq!(Column::named("i:float").unwrap().role, Role::Intensity);
        assert!(Column::named("q:byte").is_err());
    }

    #[test]
    fn columns_that_cannot_be_are_told() {
        let check = |list: &str| check(&list.split(',').map(str::to_owned).collect::<Vec<_>>());
        assert_eq!(check("x,y,z,-,-,r,g,b,i"), Ok(()));
        assert!(check("x,z").unwrap_err().contains("there is no y"));
        assert!(check("x,y,z,i,intensity").unwrap_err().contains("intensity stands twice"));
        assert!(check("x,y,q:byte").unwrap_err().contains("\"byte\" of column q"));
    }
}
