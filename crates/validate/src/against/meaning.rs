//! Which column of a scan an attribute of a dataset was filled from, and what its values mean there (docs/inputs.md,
//! "One quantity, one attribute").

use pointmill_format::{Attribute, AttributeType, Column, with_column};

/// A column of a scan that fills an attribute of the dataset.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Feed {
    /// Index among the columns of the scan.
    pub(super) column: usize,
    /// Elements of the column.
    pub(super) elements: usize,
    /// `None`: stored values are the same on both sides.
    pub(super) meaning: Option<Meaning>,
    /// Values that the type of the attribute does not hold exactly are no values of it.
    pub(super) exact: bool,
}

/// Degrees of a step of angles in LAS formats 6 to 10.
const FINE: f64 = 0.006;

/// Angles in degrees as the nearest steps of 0.006.
pub(super) fn fine_angles(degrees: &Column) -> Column {
    let degrees = degrees.values::<f64>().unwrap_or_default();
    Column::Int16(degrees.iter().map(|d| (d / FINE).round() as i16).collect())
}

/// What stored values mean: (stored · scale + offset) · unit.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Meaning {
    scale: Vec<f64>,
    offset: Vec<f64>,
    unit: f64,
}

impl Meaning {
    /// Of the values of an attribute.
    pub(super) fn of(attribute: &Attribute) -> Self {
        // LAS formats 6 to 10 count angles in steps of 0.006 degrees
        let is_fine = attribute.name == "scan angle" && attribute.ty == AttributeType::Int16;
        let is_plain = attribute.scale.iter().all(|s| *s == 1.0) && attribute.offset.iter().all(|o| *o == 0.0);
        let unit = if is_fine && is_plain { FINE } else { 1.0 };
        Self { scale: attribute.scale.clone(), offset: attribute.offset.clone(), unit }
    }

    /// The meant values of some points.
    #[allow(clippy::unnecessary_cast)] // one body for every type of column
    pub(super) fn values(&self, column: &Column, start: usize, points: usize) -> Column {
        let elements = self.scale.len().max(1);
        let meant = |(i, v): (usize, f64)| (v * self.scale[i % elements] + self.offset[i % elements]) * self.unit;
        let range = start * elements..(start + points) * elements;
        with_column!(column, values => {
            let values = values.get(range).unwrap_or_default();
            Column::Float64(values.iter().enumerate().map(|(i, v)| meant((i, *v as f64))).collect())
        })
    }

    /// The meant value of an attribute of one element.
    pub(super) fn one(&self, stored: f64) -> f64 {
        let (scale, offset) = (self.scale.first().unwrap_or(&1.0), self.offset.first().unwrap_or(&0.0));
        (stored * scale + offset) * self.unit
    }

    /// True if `stored` or what it means is `value`.
    pub(super) fn is(&self, stored: f64, element: usize, value: f64) -> bool {
        let (scale, offset) = (self.scale.get(element).unwrap_or(&1.0), self.offset.get(element).unwrap_or(&0.0));
        stored == value || (stored * scale + offset) * self.unit == value
    }
}

/// The quantity of an attribute by its name.
fn quantity(attribute: &Attribute) -> &str {
    let is_float = matches!(attribute.ty, AttributeType::Float32 | AttributeType::Float64);
    match attribute.name.as_str() {
        "scan angle rank" => "scan angle",
        "time" if is_float => "timestamp",
        name => name,
    }
}

fn is_colour(attribute: &Attribute) -> bool {
    attribute.name == "rgb" && attribute.ty == AttributeType::UInt16 && attribute.elements == 3
}

/// The column of a scan that the attribute `stored` of a dataset with `all` attributes was filled from.
///
/// Equal quantities with equal elements are one attribute, whatever their types; of other elements the later one is called
/// "name (2)", "name (3)", …. `any_type`: other converters do as they like with types and elements.
pub(super) fn feed(stored: &Attribute, all: &[Attribute], columns: &[Attribute], any_type: bool) -> Option<Feed> {
    let fits = |c: &Attribute| any_type || c.elements == stored.elements && is_colour(c) == is_colour(stored);
    let is_numbered = |c: &Attribute| {
        let number = stored.name.strip_prefix(&*c.name).and_then(|s| s.strip_prefix(" (")?.strip_suffix(')'));
        number.is_some_and(|n| n.parse::<u32>().is_ok_and(|n| n >= 2))
    };
    let has_its_own = |c: &Attribute| all.iter().any(|a| a.name == c.name && a.elements == c.elements);
    let find = |is_it: &dyn Fn(&Attribute) -> bool| columns.iter().position(|c| fits(c) && is_it(c));
    let column = find(&|c| c.name == stored.name)
        .or_else(|| find(&|c| quantity(c) == quantity(stored) && !has_its_own(c)))
        .or_else(|| find(&|c| is_numbered(c)))?;
    let (from, to) = (Meaning::of(&columns[column]), Meaning::of(stored));
    let meaning = (!any_type && from != to).then_some(from);
    let is_normal = stored.name.strip_prefix("Normal").is_some_and(|axis| matches!(axis, "X" | "Y" | "Z"));
    let exact = !any_type && !is_normal && meaning.is_none();
    Some(Feed { column, elements: columns[column].elements, meaning, exact })
}

#[cfg(test)]
mod tests {
    use super::*;
    use AttributeType as T;

    fn column(stored: &Attribute, columns: &[Attribute]) -> Option<usize> {
        feed(stored, std::slice::from_ref(stored), columns, false).map(|f| f.column)
    }

    #[test]
    fn attributes_are_found_by_quantity_and_elements() {
        let columns = [
            Attribute::new("h", T::UInt8, 1),
            Attribute::new("scan angle rank", T::Int8, 1),
            Attribute::new("rgb", T::UInt16, 3),
        ];
        assert_eq!(column(&Attribute::new("h", T::Float64, 1), &columns), Some(0));
        assert_eq!(column(&Attribute::new("h", T::UInt8, 3), &columns), None);
        assert_eq!(column(&Attribute::new("h (2)", T::UInt8, 1), &columns), Some(0));
        assert_eq!(column(&Attribute::new("h (2)", T::UInt8, 3), &columns), None);
        assert_eq!(column(&Attribute::new("scan angle", T::Float64, 1), &columns), Some(1));
        assert_eq!(column(&Attribute::new("rgb", T::UInt16, 3), &columns), Some(2));
        assert_eq!(column(&Attribute::new("rgb (2)", T::Float32, 3), &columns), None);
    }

    #[test]
    fn angles_become_fine_from_whole_degrees_and_stay_so() {
        let rank = Meaning::of(&Attribute::new("scan angle rank", T::Int8, 1));
        let meant = rank.values(&Column::Int8(vec![-10, 4, 0, 127]), 0, 4);
        assert_eq!(fine_angles(&meant), Column::Int16(vec![-1667, 667, 0, 21_167]));
        let fine = Meaning::of(&Attribute::new("scan angle", T::Int16, 1));
        let all: Vec<i16> = (-30_000..=30_000).collect();
        let meant = fine.values(&Column::Int16(all.clone()), 0, all.len());
        assert_eq!(fine_angles(&meant), Column::Int16(all));
    }

    #[test]
    fn fine_angles_become_degrees_only_among_others() {
        let fine = [Attribute::new("scan angle", T::Int16, 1)];
        let same = feed(&fine[0], &fine, &fine, false).unwrap();
        assert!(same.meaning.is_none() && same.exact);
        let degrees = Attribute::new("scan angle", T::Float64, 1);
        let meaning = feed(&degrees, std::slice::from_ref(&degrees), &fine, false).unwrap().meaning.unwrap();
        assert_eq!(meaning.values(&Column::Int16(vec![7, 2500, -30_000]), 1, 2), Column::Float64(vec![15.0, -180.0]));
        assert!(meaning.is(2500.0, 0, 15.0) && meaning.is(2500.0, 0, 2500.0) && !meaning.is(2500.0, 0, 16.0));
    }
}
