//! What the columns of a text hold: by name, by number, by value.

use super::column::Column;
use super::head::Head;
use crate::scan::source::Source;
use crate::scan::tabular::lines::Index;
use crate::scan::tabular::{
    ColumnRange, Field, LineRule, MAX_FIELDS, Property, Role, RowScan, Rule, Schema, Storage, Target, las_type,
    probe_rows,
};
use crate::{Advice, AttributeType, Piece, ReadError, ScanWarning};

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
    /// The first column numbers the rows.
    pub(super) row_numbers: bool,
    /// −2048…2047 is shifted to 0–4095.
    pub(super) pts_intensity: bool,
    /// Colours are of 0–1 by their titles.
    pub(super) unit_colours: bool,
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
    /// The rows behind `head`; `index` has them.
    pub(super) fn new(source: Source, format: String, head: Head, index: Index, is_row: fn(&[u8]) -> bool) -> Self {
        Self {
            source,
            format,
            declared: index.rows,
            pieces: index.pieces,
            rule: head.dialect.rule(is_row),
            row_numbers: head.row_numbers,
            pts_intensity: false,
            unit_colours: head.have_unit_colours(),
            first_row: head.start,
            numeric: head.numeric,
            warnings: head.warnings,
        }
    }

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
        let mut columns = columns.unwrap_or_else(|| sample.by_number(&self.numeric));
        for (i, column) in columns.iter_mut().enumerate().filter(|(i, _)| self.numeric.get(*i) == Some(&false)) {
            if column.role != Role::Padding && !(self.row_numbers && i == 0) {
                self.warnings.push(ScanWarning::ColumnIgnored { number: i + 1, name: column.name.clone() });
            }
            *column = Column::padding();
        }
        doubt(&mut columns, &sample.ranges, &mut self.warnings);
        // without a negative value nothing speaks for Leica's range: other scanners write reflectances from 0 on
        let is_leica = |r: &ColumnRange| r.is_integer_in(-2048.0, 2047.0) && r.min < 0.0;
        let shift = |i: usize| self.pts_intensity && columns[i].ty.is_none() && is_leica(&sample.ranges[i]);
        let intensity = columns.iter().position(|c| c.role == Role::Intensity).filter(|i| shift(*i));
        let unit = has_unit_colours(&columns, &sample.ranges, self.unit_colours);
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

/// Columns whose values are not what their names or places say become attributes of their own.
fn doubt(columns: &mut [Column], ranges: &[ColumnRange], warnings: &mut Vec<ScanWarning>) {
    let is_none = |i: usize| ranges[i] == ColumnRange::EMPTY;
    let colours = of_role(columns, |role| matches!(role, Role::Colour(_)));
    let no_colours = colours.iter().any(|i| !is_none(*i) && !ranges[*i].is_in(0.0, 65535.0));
    let doubtful = colours.into_iter().filter(|_| no_colours);
    for i in doubtful.filter(|i| columns[*i].ty.is_none()).collect::<Vec<_>>() {
        let column = &mut columns[i];
        warnings.push(ScanWarning::ColumnUnusual { number: i + 1, name: column.name.clone() });
        column.role = Role::Other(column.name.clone());
    }
}

fn of_role(columns: &[Column], is_it: impl Fn(&Role) -> bool) -> Vec<usize> {
    columns.iter().enumerate().filter(|(_, c)| is_it(&c.role)).map(|(i, _)| i).collect()
}

/// Colours of 0–1: none is above, and one is between, or `named` so.
fn has_unit_colours(columns: &[Column], ranges: &[ColumnRange], named: bool) -> bool {
    let of_colours = || columns.iter().zip(ranges).filter(|(c, _)| matches!(c.role, Role::Colour(_))).map(|(_, r)| r);
    of_colours().all(|r| r.is_in(0.0, 1.001)) && (named || of_colours().any(|r| !r.integers))
}

fn value_type(column: &Column, range: &ColumnRange, unit_colours: bool) -> AttributeType {
    match &column.role {
        Role::Colour(_) if !unit_colours => AttributeType::UInt16,
        Role::Colour(_) | Role::Normal(_) => AttributeType::Float32,
        Role::Intensity if range.is_integer_in(0.0, 65535.0) => AttributeType::UInt16,
        Role::Intensity => AttributeType::Float32,
        Role::Classification => class_type(range),
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

/// The least type of LAS or else of whole numbers that holds the sampled classes.
fn class_type(range: &ColumnRange) -> AttributeType {
    match range {
        r if r.is_integer_in(0.0, 255.0) => AttributeType::UInt8,
        r if r.is_integer_in(-32_768.0, 32_767.0) => AttributeType::Int16,
        r if r.is_integer_in(-2_147_483_648.0, 2_147_483_647.0) => AttributeType::Int32,
        _ => AttributeType::Float64,
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

impl Sample {
    /// The columns without titles, by the number of those that hold numbers; the others are skipped.
    fn by_number(&self, numeric: &[bool]) -> Vec<Column> {
        let places: Vec<usize> = (0..numeric.len()).filter(|i| numeric[*i]).collect();
        let ranges = places.iter().map(|i| self.ranges[*i]).collect();
        let starts =
            |i: &usize| places.get(*i..i + 3).is_some_and(|p| self.unit_vectors.contains(&p[0]) && p[2] == p[0] + 2);
        let unit_vectors = (0..places.len()).filter(starts).collect();
        let mut columns = vec![Column::padding(); numeric.len()];
        for (place, column) in places.into_iter().zip(by_number(&Self { ranges, unit_vectors })) {
            columns[place] = column;
        }
        columns
    }
}

/// The usual orders, by the number of columns and, where that leaves two, by values.
fn by_number(sample: &Sample) -> Vec<Column> {
    let byte = |i: usize| sample.ranges[i].is_integer_in(0.0, 255.0);
    let normal = |i: usize| sample.unit_vectors.contains(&i);
    let rgb_first = || byte(3) && byte(4) && byte(5) && !byte(6);
    let colour = |i: usize| sample.ranges[i..i + 3].iter().all(|r| *r == ColumnRange::EMPTY || r.is_in(0.0, 65535.0));
    match sample.ranges.len() {
        2 => Column::all(&["x", "y"]),
        3 => Column::all(&["x", "y", "z"]),
        4 => Column::all(&["x", "y", "z", "i"]),
        6 if normal(3) => Column::all(&["x", "y", "z", "nx", "ny", "nz"]),
        6 if colour(3) => Column::all(&["x", "y", "z", "r", "g", "b"]),
        7 if rgb_first() => Column::all(&["x", "y", "z", "r", "g", "b", "i"]),
        7 if colour(4) => Column::all(&["x", "y", "z", "i", "r", "g", "b"]),
        9 if normal(6) && colour(3) => Column::all(&["x", "y", "z", "r", "g", "b", "nx", "ny", "nz"]),
        10 if normal(7) && colour(4) => Column::all(&["x", "y", "z", "i", "r", "g", "b", "nx", "ny", "nz"]),
        n => {
            let mut columns = Column::all(&["x", "y", "z"]);
            columns.extend((4..=n).map(|i| Column::other(&format!("column {i}"))));
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
}
