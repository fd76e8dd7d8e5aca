//! Attributes that a dataset does not store because the scene does not require them: what it says of them gives them back.

use std::collections::HashMap;

use serde_json::Value;

use crate::{Attribute, AttributeType, Changes, Column, with_column};

use super::own_key::OwnKey;

/// The key of the list, in the key `pointmill`.
const KEY: &str = "attributesOmitted";

/// More elements than any attribute has: a list that claims more is not believed.
const MOST_ELEMENTS: u64 = 1024;

/// An attribute that is not stored, and what its values follow from.
#[derive(Debug, Clone)]
pub(super) struct Restored {
    pub(super) attribute: Attribute,
    rule: Rule,
}

/// What values follow from.
#[derive(Debug, Clone)]
enum Rule {
    /// All points have these, one per element.
    Constant(Vec<f64>),
    /// Those of another attribute of the same type.
    SameAs(String),
    /// From each value of another attribute follows one, by the bits of both as doubles.
    FollowsFrom { name: String, table: HashMap<u64, f64> },
}

impl Restored {
    /// What a dataset says. What makes no sense is passed over: attributes that are not there are no fault.
    pub(super) fn list(own: OwnKey<'_>) -> Vec<Self> {
        own.get(KEY).and_then(Value::as_array).into_iter().flatten().filter_map(Self::of).collect()
    }

    fn of(entry: &Value) -> Option<Self> {
        let ty: AttributeType = entry.get("type")?.as_str()?.parse().ok()?;
        let elements = entry.get("elements")?.as_u64().filter(|n| (1..=MOST_ELEMENTS).contains(n))? as usize;
        let attribute = Attribute::new(entry.get("name")?.as_str()?, ty, elements);
        let name = |key: &str| Some(entry.get(key)?.as_str()?.to_owned());
        let rule = match (entry.get("constant"), name("sameAs"), name("followsFrom")) {
            (Some(values), ..) => Rule::Constant(numbers(values).filter(|values| values.len() == elements)?),
            (None, Some(other), _) => Rule::SameAs(other),
            (None, None, Some(name)) if elements == 1 => {
                let row = |row: &Value| match numbers(row)?.as_slice() {
                    [key, value] => Some((bits(*key), *value)),
                    _ => None,
                };
                let table: Option<HashMap<_, _>> = entry.get("table")?.as_array()?.iter().map(row).collect();
                Rule::FollowsFrom { name, table: table? }
            }
            _ => return None,
        };
        Some(Self { attribute, rule })
    }

    /// The attribute that values follow from; `None`: all are the same.
    pub(super) fn source(&self) -> Option<&str> {
        match &self.rule {
            Rule::Constant(_) => None,
            Rule::SameAs(name) | Rule::FollowsFrom { name, .. } => Some(name),
        }
    }

    /// True if values can follow from an attribute.
    pub(super) fn can_follow(&self, from: &Attribute) -> bool {
        match self.rule {
            Rule::Constant(_) => true,
            Rule::SameAs(_) => (from.ty, from.elements) == (self.attribute.ty, self.attribute.elements),
            Rule::FollowsFrom { .. } => from.elements == 1,
        }
    }

    /// Puts the values of `points` points into a column of the attribute's type. `from`: the values of [`Self::source`] of
    /// exactly these points; a value of which nothing follows gives 0, and is counted.
    pub(super) fn put(&self, from: Option<&Column>, points: usize, to: &mut Column) -> Changes {
        let mut changes = Changes::default();
        match (&self.rule, from) {
            (Rule::Constant(values), _) => {
                let values: Vec<f64> = values.iter().copied().cycle().take(points * values.len()).collect();
                set(to, &values);
            }
            (Rule::SameAs(_), Some(from)) => {
                with_column!(to, to => {
                    to.clear();
                    to.extend_from_slice(from.values().unwrap_or_default());
                });
            }
            (Rule::FollowsFrom { table, .. }, Some(from)) => {
                let mut follows = |key: f64| {
                    table.get(&bits(key)).copied().unwrap_or_else(|| {
                        changes.leave_out(key);
                        0.0
                    })
                };
                #[allow(clippy::unnecessary_cast)] // one body for every type of column
                let values: Vec<f64> =
                    with_column!(from, from => from.iter().map(|key| follows(*key as f64)).collect());
                set(to, &values);
            }
            (Rule::SameAs(_) | Rule::FollowsFrom { .. }, None) => to.clear(),
        }
        changes
    }
}

/// Puts numbers into a column, as its type holds them.
fn set(to: &mut Column, values: &[f64]) {
    macro_rules! set {
        ($($kind:ident = $number:ty),*) => {
            match to {
                $(Column::$kind(to) => {
                    to.clear();
                    to.extend(values.iter().map(|v| *v as $number));
                })*
            }
        };
    }
    set!(
        Int8 = i8,
        UInt8 = u8,
        Int16 = i16,
        UInt16 = u16,
        Int32 = i32,
        UInt32 = u32,
        Int64 = i64,
        UInt64 = u64,
        Float32 = f32,
        Float64 = f64
    );
}

/// The bits of a number; both zeros are one.
fn bits(number: f64) -> u64 {
    (number + 0.0).to_bits()
}

fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::{Map, json};

    use super::*;

    fn restored(list: Value) -> Vec<Restored> {
        let own = Map::from_iter([(KEY.to_owned(), list)]);
        Restored::list(OwnKey::of_map(&own))
    }

    #[test]
    fn values_come_back_in_their_types() {
        let list = restored(json!([
            { "name": "user data", "type": "uint8", "elements": 1, "constant": [7.0] },
            { "name": "n", "type": "float", "elements": 3, "constant": [0.5, -1.0, 0.1f32] },
            { "name": "b", "type": "int16", "elements": 1, "sameAs": "a" },
            { "name": "t", "type": "double", "elements": 1, "followsFrom": "a", "table": [[-2.0, 0.1], [0.0, -0.5]] },
        ]));
        let put = |i: usize, from: Option<&Column>, points| {
            let mut to = Column::new(list[i].attribute.ty);
            let changes = list[i].put(from, points, &mut to);
            (to, changes.values())
        };
        assert_eq!(put(0, None, 3), (Column::UInt8(vec![7; 3]), 0));
        assert_eq!(put(1, None, 2), (Column::Float32(vec![0.5, -1.0, 0.1, 0.5, -1.0, 0.1]), 0));
        let a = Column::Int16(vec![0, -2, 3]);
        assert_eq!(put(2, Some(&a), 3), (a.clone(), 0));
        assert_eq!(put(3, Some(&a), 3), (Column::Float64(vec![-0.5, 0.1, 0.0]), 1), "nothing follows from 3");
        assert_eq!([list[0].source(), list[3].source()], [None, Some("a")]);
        assert!(list[2].can_follow(&Attribute::new("a", AttributeType::Int16, 1)));
        assert!(!list[2].can_follow(&Attribute::new("a", AttributeType::UInt16, 1)));
    }

    #[test]
    fn what_makes_no_sense_is_passed_over() {
        let base = || json!({ "name": "a", "type": "uint8", "elements": 1, "constant": [1.0] });
        assert_eq!(restored(json!([base()])).len(), 1);
        for (key, value) in [
            ("name", json!(1)),
            ("type", json!("uint9")),
            ("elements", json!(0)),
            ("elements", json!(1e9)),
            ("elements", json!(2)),
            ("constant", json!(["x"])),
            ("constant", json!(null)),
        ] {
            let mut entry = base();
            entry[key] = value;
            assert!(restored(json!([entry])).is_empty(), "{entry}");
        }
        assert!(restored(json!({ "a": 1 })).is_empty());
        let table = json!({ "name": "a", "type": "uint8", "elements": 1, "followsFrom": "b", "table": [[1, 2, 3]] });
        assert!(restored(json!([table])).is_empty());
    }
}
