//! The attributes of a run: the union of what the inputs have, in one order, as fixed-size records.

use pointmill_format::{Attribute, AttributeType, Column, ScanInfo};

/// Attribute order: `rgb` right after the position (a Unity loader finds it only there), then the order of LAS.
const USUAL_ORDER: [&str; 15] = [
    "rgb",
    "intensity",
    "return number",
    "number of returns",
    "classification flags",
    "scanner channel",
    "scan direction flag",
    "edge of flight line",
    "classification",
    "scan angle rank",
    "user data",
    "scan angle",
    "point source id",
    "gps-time",
    "nir",
];

/// The layout of stored records: three `i32` of position, then every attribute, packed, little-endian.
#[derive(Debug, Clone)]
pub(crate) struct Schema {
    /// All but the position.
    pub(crate) attributes: Vec<Attribute>,
    /// Byte offset in a record of each attribute.
    pub(crate) offsets: Vec<usize>,
    /// Bytes of a record.
    pub(crate) stride: usize,
}

/// Bytes of the position at the start of a record.
pub(crate) const POSITION_BYTES: usize = 12;

/// Bytes of what tells apart points that the lattice of the run makes equal.
pub(crate) const MARK_BYTES: usize = 8;

impl Schema {
    pub(crate) fn new(attributes: Vec<Attribute>) -> Self {
        let mut stride = POSITION_BYTES;
        let offsets = attributes
            .iter()
            .map(|a| {
                let offset = stride;
                stride += a.size();
                offset
            })
            .collect();
        Self { attributes, offsets, stride }
    }

    /// The union of the attributes of `scans`, and for each scan where each of its columns goes.
    ///
    /// Attributes are the same if name, type, elements, scale and offset agree; a second meaning of a name gets a
    /// suffix. The result depends on the order of `scans` alone.
    pub(crate) fn union(scans: &[&ScanInfo]) -> (Self, Vec<Vec<usize>>) {
        let mut all: Vec<Attribute> = Vec::new();
        let mut maps: Vec<Vec<usize>> = Vec::new();
        for scan in scans {
            let map = scan.attributes.iter().map(|attribute| place(&mut all, attribute)).collect();
            maps.push(map);
        }
        let rank = |a: &Attribute| USUAL_ORDER.iter().position(|n| *n == a.name).unwrap_or(USUAL_ORDER.len());
        let mut order: Vec<usize> = (0..all.len()).collect();
        order.sort_by_key(|&i| (rank(&all[i]), i));
        let mut new_place = vec![0; all.len()];
        for (new, &old) in order.iter().enumerate() {
            new_place[old] = new;
        }
        for place in maps.iter_mut().flatten() {
            *place = new_place[*place];
        }
        (Self::new(order.iter().map(|&i| all[i].clone()).collect()), maps)
    }

    /// The schema without what is not needed, and for each attribute of the present one its place there.
    pub(crate) fn reduce(&self, needed: &[bool]) -> (Self, Vec<Option<usize>>) {
        let mut kept = Vec::new();
        let places = self.attributes.iter().zip(needed).map(|(attribute, needed)| {
            needed.then(|| {
                kept.push(attribute.clone());
                kept.len() - 1
            })
        });
        let places = places.collect();
        (Self::new(kept), places)
    }

    /// Makes room behind the attributes of a record for a mark of [`MARK_BYTES`], and returns where it is.
    pub(crate) fn add_mark(&mut self) -> usize {
        let at = self.stride;
        self.stride += MARK_BYTES;
        at
    }

    pub(crate) fn find(&self, name: &str) -> Option<usize> {
        self.attributes.iter().position(|a| a.name == name)
    }

    /// The colour: `rgb`, three `u16`.
    pub(crate) fn rgb(&self) -> Option<usize> {
        self.find("rgb").filter(|&i| self.attributes[i].ty == AttributeType::UInt16 && self.attributes[i].elements == 3)
    }
}

/// The type that is stored for a type that was read. Potree viewers fail on every node that has a 64-bit integer, so
/// these become doubles (exact up to 2^53; what is not is counted, see [`as_doubles`]).
fn stored_type(ty: AttributeType) -> AttributeType {
    match ty {
        AttributeType::Int64 | AttributeType::UInt64 => AttributeType::Float64,
        other => other,
    }
}

/// The column as it is stored, if that is another one than was read; and how many of its values were rounded.
pub(crate) fn as_doubles(column: &Column) -> Option<(Column, u64)> {
    let (values, rounded): (Vec<f64>, usize) = match column {
        Column::Int64(v) => (
            v.iter().map(|v| *v as f64).collect(),
            v.iter().filter(|v| (**v as f64) as i128 != i128::from(**v)).count(),
        ),
        Column::UInt64(v) => (
            v.iter().map(|v| *v as f64).collect(),
            v.iter().filter(|v| (**v as f64) as i128 != i128::from(**v)).count(),
        ),
        _ => return None,
    };
    Some((Column::Float64(values), rounded as u64))
}

/// Index in `all` of the attribute with the same meaning, added if there is none.
fn place(all: &mut Vec<Attribute>, attribute: &Attribute) -> usize {
    let mut attribute = attribute.clone();
    attribute.ty = stored_type(attribute.ty);
    let same = |a: &Attribute| {
        a.ty == attribute.ty
            && a.elements == attribute.elements
            && a.scale == attribute.scale
            && a.offset == attribute.offset
    };
    let mut name = attribute.name.clone();
    // The name of the colour is taken, for three `u16`.
    if name == "rgb" && !(attribute.ty == AttributeType::UInt16 && attribute.elements == 3) {
        name = "rgb (2)".to_owned();
    }
    for suffix in 2.. {
        match all.iter().position(|a| a.name == name) {
            Some(i) if same(&all[i]) => return i,
            Some(_) => name = format!("{} ({suffix})", attribute.name),
            None => break,
        }
    }
    attribute.name = name;
    all.push(attribute);
    all.len() - 1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(attributes: Vec<Attribute>) -> ScanInfo {
        let mut info = ScanInfo::new("x", "", 0);
        info.attributes = attributes.into();
        info
    }

    #[test]
    fn wide_integers_become_doubles_and_what_is_rounded_is_counted() {
        let (column, rounded) = as_doubles(&Column::Int64(vec![-3, 1 << 53, (1 << 53) + 1, i64::MAX])).unwrap();
        assert_eq!((column.ty(), rounded), (AttributeType::Float64, 2));
        assert_eq!(as_doubles(&Column::UInt64(vec![u64::MAX, 7])).unwrap().1, 1);
        assert!(as_doubles(&Column::UInt32(vec![7])).is_none());
        let (schema, _) = Schema::union(&[&scan(vec![Attribute::new("id", AttributeType::UInt64, 1)])]);
        assert_eq!(schema.attributes[0].ty, AttributeType::Float64);
    }

    #[test]
    fn union_keeps_each_meaning_once_and_puts_rgb_first() {
        let a = scan(vec![
            Attribute::new("intensity", AttributeType::UInt16, 1),
            Attribute::new("height", AttributeType::Float32, 1),
        ]);
        let b = scan(vec![
            Attribute::new("height", AttributeType::Float64, 1),
            Attribute::new("rgb", AttributeType::UInt16, 3),
            Attribute::new("intensity", AttributeType::UInt16, 1),
        ]);
        let (schema, maps) = Schema::union(&[&a, &b]);
        let names: Vec<&str> = schema.attributes.iter().map(|a| a.name.as_str()).collect();
        assert_eq!(names, ["rgb", "intensity", "height", "height (2)"]);
        assert_eq!(maps, [vec![1, 2], vec![3, 0, 1]]);
        assert_eq!(schema.offsets, [12, 18, 20, 24]);
        assert_eq!(schema.stride, 32);
    }
}
