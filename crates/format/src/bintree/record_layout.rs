//! Where the columns of a leaf record are.

use crate::{Attribute, AttributeType, WriteError};

/// Bytes of the columns that every dataset has: x, y, z and classification as floats.
pub const CORE_BYTES: usize = 16;

const CORE: [&str; 4] = ["x", "y", "z", "classification"];

/// More elements per point than any attribute has; keeps a bad count from requesting memory.
const MAX_ELEMENTS: usize = 256;

/// A column and its place in the record.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct PlacedAttribute {
    /// Name, type, elements; scale and offset of its values. The index keeps neither descriptions nor no-data values.
    pub attribute: Attribute,
    /// Byte of the record at which its elements start.
    pub offset: usize,
}

/// The columns of a leaf record and its length.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordLayout {
    extras: Vec<PlacedAttribute>,
    stride: usize,
}

impl RecordLayout {
    /// The core alone: 16 bytes.
    #[must_use]
    pub const fn core() -> Self {
        Self { extras: Vec::new(), stride: CORE_BYTES }
    }

    /// The core and then `extras` in that order, each aligned to its element size (section 4 of the format's page).
    ///
    /// # Errors
    /// [`WriteError::Input`]: a name that is empty, taken twice or one of the core's; no elements, or more than 256.
    pub fn new(extras: impl IntoIterator<Item = Attribute>) -> Result<Self, WriteError> {
        let (mut placed, mut end, mut widest) = (Vec::new(), CORE_BYTES, 4);
        for attribute in extras {
            // What is wrong with it is found below; the sum must not overflow before.
            if attribute.elements > MAX_ELEMENTS {
                let what = format!("the attribute \"{}\" has {} elements", attribute.name, attribute.elements);
                return Err(WriteError::input(what));
            }
            let offset = end.next_multiple_of(attribute.ty.size());
            end = offset + attribute.size();
            widest = widest.max(attribute.ty.size());
            placed.push(PlacedAttribute { attribute, offset });
        }
        Self::from_places(placed, end.next_multiple_of(widest)).map_err(WriteError::Input)
    }

    /// Columns behind the core at the places that an index gives.
    pub(super) fn from_places(extras: Vec<PlacedAttribute>, stride: usize) -> Result<Self, String> {
        let mut end = CORE_BYTES;
        let mut names = std::collections::HashSet::from(CORE);
        for PlacedAttribute { attribute, offset } in &extras {
            let Attribute { name, ty, elements, .. } = attribute;
            if name.is_empty() || !names.insert(name) {
                return Err(format!("two attributes are named \"{name}\", or one has no name"));
            }
            if !(1..=MAX_ELEMENTS).contains(elements) {
                return Err(format!("the attribute \"{name}\" has {elements} elements"));
            }
            if !offset.is_multiple_of(ty.size()) || *offset < end {
                let size = ty.size();
                return Err(format!(
                    "the attribute \"{name}\" is at byte {offset}: it has to be at {end} or behind, at a multiple of {size}"
                ));
            }
            end =
                offset.checked_add(attribute.size()).ok_or_else(|| format!("the attribute \"{name}\" has no place"))?;
        }
        let widest = extras.iter().map(|e| e.attribute.ty.size()).fold(4, usize::max);
        if stride < end || !stride.is_multiple_of(widest) {
            return Err(format!("the stride {stride} has to be a multiple of {widest}, at least {end}"));
        }
        Ok(Self { extras, stride })
    }

    /// The columns behind the core, in the order of their bytes.
    pub fn extras(&self) -> &[PlacedAttribute] {
        &self.extras
    }

    /// Bytes of a record.
    pub const fn stride(&self) -> usize {
        self.stride
    }

    /// All columns in the order of their bytes, the four of the core first.
    pub fn columns(&self) -> impl Iterator<Item = PlacedAttribute> + '_ {
        let core = CORE.into_iter().enumerate().map(|(i, name)| PlacedAttribute {
            attribute: Attribute::new(name, AttributeType::Float32, 1),
            offset: 4 * i,
        });
        core.chain(self.extras.iter().cloned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use AttributeType as T;

    fn placed(columns: &[(&str, T, usize)]) -> Result<(Vec<usize>, usize), String> {
        let layout =
            RecordLayout::new(columns.iter().map(|(n, t, e)| Attribute::new(*n, *t, *e))).map_err(|e| e.to_string())?;
        Ok((layout.extras().iter().map(|e| e.offset).collect(), layout.stride()))
    }

    #[test]
    fn columns_are_aligned_to_their_elements_and_records_to_the_widest() {
        assert_eq!(placed(&[]), Ok((vec![], 16)));
        assert_eq!(placed(&[("rgba", T::UInt8, 4)]), Ok((vec![16], 20)));
        let mixed = [("rgb", T::UInt16, 3), ("a", T::UInt8, 1), ("gps-time", T::Float64, 1), ("b", T::Int8, 1)];
        assert_eq!(placed(&mixed), Ok((vec![16, 22, 24, 32], 40)));
        assert_eq!(placed(&[("a", T::UInt8, 1), ("b", T::Int32, 1)]), Ok((vec![16, 20], 24)));
    }

    #[test]
    fn names_of_the_core_or_taken_twice_are_refused() {
        for bad in [&[("x", T::Float32, 1)][..], &[("", T::Int8, 1)], &[("a", T::Int8, 1), ("a", T::Int16, 1)]] {
            assert!(placed(bad).unwrap_err().contains("named"));
        }
        assert!(placed(&[("a", T::Int8, 0)]).unwrap_err().contains("0 elements"));
        assert!(placed(&[("a", T::Int8, 257)]).is_err());
    }

    #[test]
    fn places_that_an_index_gives_are_checked() {
        let at = |places: &[(usize, T)], stride| {
            let column = |(i, (offset, ty)): (usize, &(usize, T))| PlacedAttribute {
                attribute: Attribute::new(format!("a{i}"), *ty, 1),
                offset: *offset,
            };
            RecordLayout::from_places(places.iter().enumerate().map(column).collect(), stride)
        };
        assert!(at(&[(16, T::UInt8), (20, T::UInt32)], 24).is_ok());
        for (places, stride) in [
            (&[(18, T::UInt32)][..], 24),              // not aligned
            (&[(12, T::UInt32)], 24),                  // in the core
            (&[(16, T::UInt32), (16, T::UInt32)], 24), // on one another
            (&[(16, T::UInt32)], 16),                  // behind the record
            (&[(16, T::UInt32)], 22),                  // records that are not aligned
        ] {
            assert!(at(places, stride).is_err(), "{places:?} {stride}");
        }
        let offsets: Vec<usize> = at(&[(16, T::UInt8)], 20).unwrap().columns().map(|c| c.offset).collect();
        assert_eq!(offsets, [0, 4, 8, 12, 16]);
    }
}
