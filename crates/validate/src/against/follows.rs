//! Attributes that were left out because they follow from another one: do all points of the scans agree?

use std::collections::HashMap;

use pointmill_format::{Attribute, Column, with_column};
use serde_json::Value;

use super::meaning::Meaning;

/// What the metadata say of an attribute that is not stored.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Follows {
    pub(super) name: String,
    /// The attribute that its values follow from.
    from: String,
    /// Pairs of values of both; `None`: they are the same.
    table: Option<Vec<[f64; 2]>>,
}

impl Follows {
    /// Those of the list `attributesOmitted` that are not constant.
    pub(super) fn list(omitted: &Value) -> Vec<Self> {
        omitted.as_array().into_iter().flatten().filter_map(Self::of).collect()
    }

    fn of(entry: &Value) -> Option<Self> {
        let text = |key: &str| Some(entry[key].as_str()?.to_owned());
        let name = text("name")?;
        if let Some(from) = text("sameAs") {
            return Some(Self { name, from, table: None });
        }
        let row = |row: &Value| Some([row.get(0)?.as_f64()?, row.get(1)?.as_f64()?]);
        let table = entry["table"].as_array()?.iter().map(row).collect::<Option<_>>()?;
        Some(Self { name, from: text("followsFrom")?, table: Some(table) })
    }
}

/// The columns of a scan that a rule is about.
#[derive(Debug)]
pub(super) struct Followed {
    pub(super) column: usize,
    pub(super) from: usize,
    meanings: [Meaning; 2],
    table: Option<Vec<[f64; 2]>>,
    /// Its place among the rules.
    pub(super) rule: usize,
}

impl Followed {
    /// `None` for a scan that lacks one of the attributes.
    pub(super) fn of((rule, follows): (usize, &Follows), attributes: &[Attribute]) -> Option<Self> {
        let find = |name: &str| attributes.iter().position(|a| a.name == name && a.elements == 1);
        let (column, from) = (find(&follows.name)?, find(&follows.from)?);
        let meanings = [column, from].map(|i| Meaning::of(&attributes[i]));
        Some(Self { column, from, meanings, table: follows.table.clone(), rule })
    }

    /// Points that are kept and have another value.
    pub(super) fn count_deviating(&self, columns: &[Column], start: usize, keep: &[bool]) -> u64 {
        let [values, from] = [self.column, self.from].map(|i| doubles(&columns[i], start, keep.len()));
        let mut known: HashMap<u64, Option<f64>> = HashMap::new();
        let points = values.iter().zip(&from).zip(keep).filter(|(_, keep)| **keep);
        let agrees = |value: f64, from: f64, known: &mut HashMap<u64, Option<f64>>| match &self.table {
            // NaN is the same where its bits are; scans may store one number in steps of different sizes
            None => value.to_bits() == from.to_bits() || self.meanings[0].is(value, 0, self.meanings[1].one(from)),
            Some(table) => {
                let find = || table.iter().find(|[key, _]| self.meanings[1].is(from, 0, *key)).map(|[_, value]| *value);
                let expected = *known.entry(from.to_bits()).or_insert_with(find);
                expected.is_some_and(|expected| self.meanings[0].is(value, 0, expected))
            }
        };
        points.filter(|((value, from), _)| !agrees(**value, **from, &mut known)).count() as u64
    }
}

/// The values of some points.
#[allow(clippy::unnecessary_cast)] // one body for every type of column
fn doubles(column: &Column, start: usize, points: usize) -> Vec<f64> {
    with_column!(column, values => values.iter().skip(start).take(points).map(|v| *v as f64).collect())
}

#[cfg(test)]
mod tests {
    use pointmill_format::AttributeType;
    use serde_json::json;

    use super::*;

    #[test]
    fn points_that_do_not_follow_are_counted() {
        let rules = Follows::list(&json!([
            { "name": "c", "type": "uint8", "elements": 1, "constant": [1] },
            { "name": "b", "type": "uint8", "elements": 1, "sameAs": "a" },
            { "name": "c", "type": "uint8", "elements": 1, "followsFrom": "a", "table": [[1, 10], [2, 20]] },
        ]));
        let attributes = ["a", "b", "c"].map(|name| Attribute::new(name, AttributeType::UInt8, 1));
        let columns = [vec![9, 1, 2, 2, 3], vec![0, 1, 1, 2, 3], vec![0, 10, 20, 21, 30]].map(Column::UInt8);
        let count = |rule: usize, keep: &[bool]| {
            Followed::of((rule, &rules[rule]), &attributes).unwrap().count_deviating(&columns, 1, keep)
        };
        assert_eq!((rules.len(), count(0, &[true; 4]), count(1, &[true; 4])), (2, 1, 2));
        assert_eq!((count(0, &[true, false, true, true]), count(1, &[true, true, false, false])), (0, 0));
        assert!(Followed::of((0, &rules[0]), &attributes[..1]).is_none());
    }
}
