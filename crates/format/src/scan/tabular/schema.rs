//! Which number of a row goes to which column.

use super::names::{self, Role, role};
use crate::scan::quantities::{NORMALS, is_normal};
use crate::{Attribute, AttributeType, ScanWarning};

/// More numbers in a row than any scan has; a header that says more is refused.
pub(crate) const MAX_FIELDS: usize = 4096;

/// A column as the file declares it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Property {
    pub(crate) role: Role,
    pub(crate) name: String,
    pub(crate) ty: AttributeType,
    /// Numbers a row, side by side.
    pub(crate) elements: usize,
    /// Bytes from the start of the record to the first one; unused in text.
    pub(crate) at: usize,
    /// A list: `ty` is the type of its length; `elements` is 1. It is skipped.
    pub(crate) list: bool,
}

impl Property {
    /// One number, with the role that its name has.
    pub(crate) fn new(name: &str, ty: AttributeType) -> Self {
        Self { role: role(name), name: name.to_owned(), ty, elements: 1, at: 0, list: false }
    }
}

/// One number of a row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Field {
    pub(crate) at: usize,
    pub(crate) ty: AttributeType,
    pub(crate) target: Target,
}

/// Where a number goes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Target {
    /// Nowhere.
    Skip,
    /// Nowhere, and it says how many numbers of the row follow it there (text only).
    List,
    /// A position.
    Axis(usize),
    /// Element of a column.
    Value { column: usize, element: usize, rule: Rule },
    /// The constant part of a splat's spherical harmonics: to its own column, and as element `element` of a colour.
    Harmonic { value: usize, colour: usize, element: usize },
    /// The bits of one number to three elements of a column, and to an alpha column.
    Packed { column: usize, alpha: Option<usize> },
}

/// How a number becomes an element of its column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rule {
    /// Type and value stay.
    Keep,
    /// The column's type is another one: rounded if it is an integer's; an error if out of range.
    Convert,
    /// 0–1 becomes 0–65535; an error if out of range.
    Unit,
    /// A splat's harmonic becomes a colour of 0–255.
    Harmonic,
    /// −2048…2047 becomes 0–4095 (PTS intensity).
    Shift,
}

/// All columns, and the numbers of a row in file order.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Schema {
    pub(crate) attributes: Vec<Attribute>,
    pub(crate) fields: Vec<Field>,
    /// True without a z: all z are 0.
    pub(crate) flat: bool,
}

impl Schema {
    /// Colour comes first, then intensity, classification, normals and the rest in file order.
    ///
    /// `Err` says what is missing. A missing z alone is no error.
    pub(crate) fn new(properties: &[Property], warnings: &mut Vec<ScanWarning>) -> Result<Self, String> {
        let count = properties.iter().try_fold(0usize, |sum, p| sum.checked_add(p.elements));
        if count.is_none_or(|n| n > MAX_FIELDS) {
            return Err(format!("a row has more than {MAX_FIELDS} numbers"));
        }
        let targets = vec![Vec::new(); properties.len()];
        let mut builder = Builder { properties, schema: Self::default(), targets, harmonics: None };
        builder.axes(warnings)?;
        builder.colours();
        if builder.harmonics.is_some() {
            warnings.push(ScanWarning::ColourOfHarmonics);
        }
        builder.singles();
        builder.normals();
        builder.rest();
        Ok(builder.finish())
    }
}

struct Builder<'a> {
    properties: &'a [Property],
    schema: Schema,
    /// Of each property, one for each element; empty until it is assigned.
    targets: Vec<Vec<Target>>,
    /// The column of colours that are made of harmonics, and the properties of these.
    harmonics: Option<(usize, [usize; 3])>,
}

impl Builder<'_> {
    /// The first unassigned scalar of that role; a scalar field of CloudCompare only if there is no other.
    fn find(&self, role: &Role) -> Option<usize> {
        let is_it = |i: &usize| {
            let p = &self.properties[*i];
            p.role == *role && p.elements == 1 && !p.list && self.targets[*i].is_empty()
        };
        let is_scalar_field = |i: &usize| self.properties[*i].name.to_ascii_lowercase().starts_with("scalar_");
        (0..self.properties.len()).filter(is_it).min_by_key(|i| (is_scalar_field(i), *i))
    }

    fn find_three(&self, role: fn(usize) -> Role) -> Option<[usize; 3]> {
        Some([self.find(&role(0))?, self.find(&role(1))?, self.find(&role(2))?])
    }

    fn axes(&mut self, warnings: &mut Vec<ScanWarning>) -> Result<(), String> {
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            match self.find(&Role::Axis(axis)) {
                Some(i) => self.targets[i] = vec![Target::Axis(axis)],
                None if axis == 2 => {
                    self.schema.flat = true;
                    warnings.push(ScanWarning::NoZ);
                }
                None => return Err(format!("there is no {name}")),
            }
        }
        Ok(())
    }

    fn colours(&mut self) {
        if let Some(found) = self.find_three(Role::Colour) {
            let column = self.add("rgb", AttributeType::UInt16, 3);
            for (element, i) in found.into_iter().enumerate() {
                let float = matches!(self.properties[i].ty, AttributeType::Float32 | AttributeType::Float64);
                let rule = if float { Rule::Unit } else { Rule::Convert };
                self.targets[i] = vec![Target::Value { column, element, rule }];
            }
        } else if let Some(i) = self.find(&Role::PackedColour)
            && self.properties[i].ty.size() == 4
        {
            let column = self.add("rgb", AttributeType::UInt16, 3);
            let with_alpha = self.properties[i].name.eq_ignore_ascii_case("rgba");
            let alpha = with_alpha.then(|| self.add("alpha", AttributeType::UInt8, 1));
            self.targets[i] = vec![Target::Packed { column, alpha }];
        } else if let Some(i) = self.colour_array() {
            let column = self.add("rgb", AttributeType::UInt16, 3);
            let value = |element| Target::Value { column, element, rule: Rule::Convert };
            self.targets[i] = (0..3).map(value).collect();
        } else if let Some(found) = self.find_three(Role::Harmonic).filter(|found| self.are_floats(found)) {
            self.harmonics = Some((self.add("rgb", AttributeType::UInt16, 3), found));
        }
    }

    fn are_floats(&self, properties: &[usize]) -> bool {
        let is_float = |ty| matches!(ty, AttributeType::Float32 | AttributeType::Float64);
        properties.iter().all(|i| is_float(self.properties[*i].ty))
    }

    /// Three small integers side by side that are called "rgb".
    fn colour_array(&self) -> Option<usize> {
        let is_small = |ty| matches!(ty, AttributeType::UInt8 | AttributeType::UInt16);
        self.properties.iter().position(|p| p.role == Role::PackedColour && p.elements == 3 && is_small(p.ty))
    }

    fn singles(&mut self) {
        // a type of LAS or a float that holds every value; 64 bits have none
        if let Some(i) = self.find(&Role::Intensity) {
            let ty = match self.properties[i].ty {
                AttributeType::UInt8 | AttributeType::UInt16 => AttributeType::UInt16,
                AttributeType::Int8 | AttributeType::Int16 | AttributeType::Float32 => AttributeType::Float32,
                wide @ (AttributeType::Int64 | AttributeType::UInt64) => wide,
                _ => AttributeType::Float64,
            };
            self.single(i, "intensity", ty);
        }
        if let Some(i) = self.find(&Role::Classification) {
            self.single(i, "classification", self.properties[i].ty);
        }
    }

    fn normals(&mut self) {
        if let Some(found) = self.find_three(Role::Normal) {
            for (i, name) in found.into_iter().zip(NORMALS) {
                self.single(i, name, AttributeType::Float32);
            }
        } else if let Some(i) = self.whole_normal() {
            let ty = self.properties[i].ty;
            let rule = if ty == AttributeType::Float32 { Rule::Keep } else { Rule::Convert };
            let mut component = |name| {
                let column = self.add(name, AttributeType::Float32, 1);
                Target::Value { column, element: 0, rule }
            };
            self.targets[i] = NORMALS.map(&mut component).into();
        }
    }

    /// Three numbers side by side that are called a normal.
    fn whole_normal(&self) -> Option<usize> {
        let is_free = |i: &usize| self.targets[*i].is_empty();
        (0..self.properties.len()).filter(is_free).find(|i| {
            let Property { name, elements, list, .. } = &self.properties[*i];
            *elements == 3 && !list && is_normal(name)
        })
    }

    fn rest(&mut self) {
        for i in 0..self.properties.len() {
            let Property { role, name, ty, elements, list, .. } = &self.properties[i];
            if !self.targets[i].is_empty() {
                continue;
            }
            if *list || *role == Role::Padding {
                self.targets[i] = vec![if *list { Target::List } else { Target::Skip }; *elements];
                continue;
            }
            // a quantity that is there twice keeps the second name that the file has for it
            let usual = Some(names::other_name(name, *ty)).filter(|_| *elements == 1);
            let usual = usual.filter(|usual| self.schema.attributes.iter().all(|a| a.name != **usual));
            let column = self.add(usual.unwrap_or(name), *ty, *elements);
            if let Some((colour, harmonics)) = self.harmonics
                && let Some(element) = harmonics.iter().position(|h| *h == i)
            {
                self.targets[i] = vec![Target::Harmonic { value: column, colour, element }];
                continue;
            }
            let value = |element| Target::Value { column, element, rule: Rule::Keep };
            self.targets[i] = (0..*elements).map(value).collect();
        }
    }

    fn single(&mut self, i: usize, name: &str, ty: AttributeType) {
        let column = self.add(name, ty, 1);
        let rule = if self.properties[i].ty == ty { Rule::Keep } else { Rule::Convert };
        self.targets[i] = vec![Target::Value { column, element: 0, rule }];
    }

    /// Adds an attribute, with a number behind its name if that is taken; returns its index.
    fn add(&mut self, name: &str, ty: AttributeType, elements: usize) -> usize {
        let base = if name.is_empty() { "unnamed" } else { name };
        let taken = |name: &str, s: &Schema| name == "position" || s.attributes.iter().any(|a| a.name == name);
        let mut free = base.to_owned();
        for n in 2.. {
            if !taken(&free, &self.schema) {
                break;
            }
            free = format!("{base} {n}");
        }
        self.schema.attributes.push(Attribute::new(free, ty, elements));
        self.schema.attributes.len() - 1
    }

    fn finish(mut self) -> Schema {
        for (property, targets) in self.properties.iter().zip(&self.targets) {
            for (element, target) in targets.iter().enumerate() {
                let at = property.at + element * property.ty.size();
                self.schema.fields.push(Field { at, ty: property.ty, target: *target });
            }
        }
        self.schema
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use AttributeType::{Float32, Float64, Int32, UInt8};

    fn schema(list: &[(&str, AttributeType)]) -> Result<Schema, String> {
        let properties: Vec<_> = list.iter().map(|(name, ty)| Property::new(name, *ty)).collect();
        Schema::new(&properties, &mut Vec::new())
    }

    fn names(s: &Schema) -> Vec<String> {
        s.attributes.iter().map(|a| format!("{} {}x{}", a.name, a.ty.potree_name(), a.elements)).collect()
    }

    #[test]
    fn colour_comes_first_and_the_rest_keeps_its_order() {
        let s = schema(&[
            ("b", UInt8),
            ("scalar_Intensity", Float32),
            ("z", Float32),
            ("y", Float32),
            ("x", Float64),
            ("nx", Float64),
            ("ny", Float64),
            ("nz", Float64),
            ("g", UInt8),
            ("r", UInt8),
            ("intensity", Int32),
            ("quality", Int32),
        ])
        .unwrap();
        assert_eq!(
            names(&s).join(", "),
            "rgb uint16x3, intensity doublex1, NormalX floatx1, NormalY floatx1, NormalZ floatx1, \
             scalar_Intensity floatx1, quality int32x1"
        );
        assert_eq!(s.fields[0].target, Target::Value { column: 0, element: 2, rule: Rule::Convert });
    }

    #[test]
    fn incomplete_colours_and_taken_names_stay_attributes_of_their_own() {
        let s = schema(&[("x", Float32), ("y", Float32), ("z", Float32), ("red", UInt8), ("a", UInt8), ("a", UInt8)]);
        assert_eq!(names(&s.unwrap()), ["red uint8x1", "a uint8x1", "a 2 uint8x1"]);
    }

    #[test]
    fn classes_and_wide_intensities_keep_their_type_and_normals_of_three_numbers_become_three() {
        let list = [("x", Float32), ("y", Float32), ("class", Int32), ("intensity", AttributeType::UInt64)];
        let mut properties: Vec<_> = list.iter().map(|(name, ty)| Property::new(name, *ty)).collect();
        properties.push(Property { elements: 3, ..Property::new("normals", Float64) });
        let s = Schema::new(&properties, &mut Vec::new()).unwrap();
        assert_eq!(
            names(&s).join(", "),
            "intensity uint64x1, classification int32x1, NormalX floatx1, NormalY floatx1, NormalZ floatx1"
        );
        assert_eq!(s.fields[6].target, Target::Value { column: 4, element: 0, rule: Rule::Convert });
    }

    #[test]
    fn a_quantity_that_is_there_twice_keeps_its_second_name() {
        let list = [("x", Float32), ("y", Float32), ("z", Float32), ("ReturnNumber", UInt8), ("return_number", UInt8)];
        assert_eq!(names(&schema(&list).unwrap()), ["return number uint8x1", "return_number uint8x1"]);
    }

    #[test]
    fn without_z_it_is_flat_and_without_x_it_is_nothing() {
        assert!(schema(&[("x", Float32), ("y", Float32)]).unwrap().flat);
        assert_eq!(schema(&[("y", Float32), ("z", Float32)]), Err("there is no x".to_owned()));
    }

    #[test]
    fn a_row_of_very_many_numbers_is_refused() {
        let huge = Property { elements: usize::MAX, ..Property::new("h", Float32) };
        let list = [Property::new("x", Float32), Property::new("y", Float32), huge];
        assert!(Schema::new(&list, &mut Vec::new()).is_err());
    }
}
