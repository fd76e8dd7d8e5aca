//! Where the attributes that were computed are in the records of a dataset.

use super::derived::{CURVATURE, Derived, NORMALS, RADIUS};
use crate::against::Rules;
use crate::against::block::{Block, number};
use pointmill_format::AttributeType;

/// Where the values of an attribute of one element come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Column {
    /// The words of that attribute of the rules, of that type.
    Stored(usize, AttributeType),
    /// All points agree, and it was left out for it.
    Constant(f64),
    /// It was left out, for another reason.
    LeftOut,
    /// It should be there.
    Missing,
}

impl Column {
    fn find(name: &str, rules: &Rules, derived: &Derived) -> Self {
        let mut stored = rules.attributes.iter().enumerate();
        if let Some((at, attribute)) = stored.find(|(_, a)| a.name == name && a.elements == 1) {
            return Self::Stored(at, attribute.ty);
        }
        match derived.left_out.iter().find(|(left_out, _)| left_out == name) {
            Some((_, Some(constant))) => Self::Constant(*constant),
            Some((_, None)) => Self::LeftOut,
            None => Self::Missing,
        }
    }

    /// The value of a record; NaN if there is none.
    fn value(self, block: &Block, i: usize) -> f64 {
        match self {
            Self::Stored(at, ty) => block.words[at].get(i).map_or(f64::NAN, |word| number(*word, ty)),
            Self::Constant(value) => value,
            Self::LeftOut | Self::Missing => f64::NAN,
        }
    }

    fn is_known(self) -> bool {
        matches!(self, Self::Stored(..) | Self::Constant(_))
    }
}

/// Attributes that were computed; `None`: this one was not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Columns {
    pub(super) normal: Option<[Column; 3]>,
    pub(super) curvature: Option<Column>,
    pub(super) radius: Option<Column>,
}

/// What a record has of them; NaN where nothing is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Surfel {
    pub(super) normal: [f64; 3],
    pub(super) curvature: f64,
    pub(super) radius: f64,
}

impl Columns {
    /// Of a dataset whose records have the attributes of `rules`.
    pub(super) fn new(rules: &Rules, derived: &Derived) -> Self {
        let find = |name: &str| Column::find(name, rules, derived);
        Self {
            normal: derived.normals.then(|| NORMALS.map(find)),
            curvature: derived.normals.then(|| find(CURVATURE)),
            radius: derived.radius.then(|| find(RADIUS)),
        }
    }

    /// Normals, if all components are known.
    pub(super) fn known_normal(&self) -> Option<[Column; 3]> {
        self.normal.filter(|columns| columns.iter().all(|c| c.is_known()))
    }

    pub(super) fn known_curvature(&self) -> Option<Column> {
        self.curvature.filter(|column| column.is_known())
    }

    pub(super) fn known_radius(&self) -> Option<Column> {
        self.radius.filter(|column| column.is_known())
    }

    /// What a record has.
    pub(super) fn surfel(&self, block: &Block, i: usize) -> Surfel {
        let one = |column: Option<Column>| column.map_or(f64::NAN, |column| column.value(block, i));
        Surfel {
            normal: self.normal.map_or([f64::NAN; 3], |columns| columns.map(|column| column.value(block, i))),
            curvature: one(self.curvature),
            radius: one(self.radius),
        }
    }
}
