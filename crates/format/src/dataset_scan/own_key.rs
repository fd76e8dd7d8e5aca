//! What the key `pointmill` of a dataset says of the points that it was made from.

use std::collections::HashMap;

use serde_json::{Map, Value};

use crate::Lattice;

/// The key, if the dataset has it.
#[derive(Debug, Clone, Copy)]
pub(super) struct OwnKey<'a>(Option<&'a Map<String, Value>>);

impl<'a> OwnKey<'a> {
    /// `extra`: the keys of a description that its format does not know.
    pub(super) fn of(extra: &'a Map<String, Value>) -> Self {
        Self(extra.get("pointmill").and_then(Value::as_object))
    }

    /// The key itself.
    pub(super) const fn of_map(own: &'a Map<String, Value>) -> Self {
        Self(Some(own))
    }

    pub(super) fn is_there(self) -> bool {
        self.0.is_some()
    }

    pub(super) fn get(self, key: &str) -> Option<&'a Value> {
        self.0?.get(key)
    }

    /// The coordinate reference system as WKT.
    pub(super) fn wkt(self) -> Option<&'a str> {
        self.get("wkt")?.as_str()
    }

    /// Name in the dataset → name in the sources, where they differ.
    pub(super) fn renamed(self) -> HashMap<String, String> {
        let renamed = self.get("attributesRenamed").and_then(Value::as_object).into_iter().flatten();
        renamed.filter_map(|(stored, name)| Some((stored.clone(), name.as_str()?.to_owned()))).collect()
    }

    /// Three numbers.
    pub(super) fn vector(self, key: &str) -> Option<[f64; 3]> {
        vector(self.get(key)?)
    }

    /// The lattice of the job that made the dataset, where it says it.
    pub(super) fn lattice(self) -> Option<Lattice> {
        let lattice = self.get("lattice")?;
        let lattice = Lattice { scale: vector(lattice.get("scale")?)?, offset: vector(lattice.get("offset")?)? };
        lattice.is_valid().then_some(lattice)
    }
}

fn vector(value: &Value) -> Option<[f64; 3]> {
    match value.as_array()?.as_slice() {
        [x, y, z] => Some([x.as_f64()?, y.as_f64()?, z.as_f64()?]),
        _ => None,
    }
}
