//! Attributes that follow from others, as the one pass over the points finds them: exactly, of every point.
//!
//! Two relations are looked for: an attribute that equals another one everywhere, and one whose values follow from those of
//! another by a table of at most [`MOST_KEYS`] entries. The result is the same for any order of points.

use std::collections::HashMap;

use pointmill_format::{Attribute, AttributeType};
use serde::{Deserialize, Serialize};

use crate::sources::Schema;

/// The largest table, entries.
pub(crate) const MOST_KEYS: usize = 256;

/// Attributes that renderers look for, and are kept whatever they follow from.
const VISIBLE: [&str; 3] = ["rgb", "intensity", "classification"];

/// What the values of an attribute follow from; indices are those of the schema.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Relation {
    /// The values of this attribute, which has the same type.
    SameAs(usize),
    /// A value of `attribute` gives one of this: pairs, ascending.
    FollowsFrom { attribute: usize, table: Vec<[f64; 2]> },
}

/// An attribute that can take part, and where its bytes are in a stored record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Place {
    attribute: usize,
    at: usize,
    ty: AttributeType,
}

impl Place {
    #[inline]
    fn value(&self, record: &[u8]) -> u64 {
        let size = self.ty.size();
        let mut bytes = [0; 8];
        bytes[..size].copy_from_slice(&record[self.at..self.at + size]);
        u64::from_le_bytes(bytes)
    }

    /// True if values can be the keys of a table: integers of at most 32 bits.
    fn can_be_key(&self) -> bool {
        !matches!(self.ty, AttributeType::Float32 | AttributeType::Float64)
    }
}

/// The values of an attribute so far, numbered as they came.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
struct Keys {
    numbers: HashMap<u64, usize>,
    /// More than [`MOST_KEYS`].
    is_full: bool,
    /// The last one, and its number: neighbours are alike.
    last: Option<(u64, usize)>,
}

impl Keys {
    /// The number of a value, and whether it is new; `None`: there are too many.
    fn number(&mut self, value: u64) -> Option<(usize, bool)> {
        if self.is_full {
            return None;
        }
        if let Some((_, number)) = self.last.filter(|(last, _)| *last == value) {
            return Some((number, false));
        }
        let next = self.numbers.len();
        let number = *self.numbers.entry(value).or_insert(next);
        if number == MOST_KEYS {
            *self = Self { is_full: true, ..Self::default() };
            return None;
        }
        self.last = Some((value, number));
        Some((number, number == next))
    }
}

/// The value of an attribute for each number of a key.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Pair {
    key: usize,
    follower: usize,
    values: Vec<u64>,
}

/// Relations that no point has contradicted. Indices are those of `places`.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(crate) struct Relations {
    places: Vec<Place>,
    /// Of the first point; `None`: no point yet.
    first: Option<Vec<u64>>,
    /// All points have that value: it follows from anything, and no pair holds it until another comes.
    is_constant: Vec<bool>,
    keys: Vec<Keys>,
    pairs: Vec<Pair>,
    /// Places whose values are equal, the lower first.
    equal: Vec<(usize, usize)>,
    /// Of the point that is looked at, for want of a place elsewhere.
    values: Vec<u64>,
    numbers: Vec<Option<(usize, bool)>>,
}

impl Relations {
    /// Nothing seen yet. Attributes with several elements take no part, nor do integers of 64 bits, which some formats round.
    pub(crate) fn new(schema: &Schema) -> Self {
        let takes_part =
            |a: &Attribute| a.elements == 1 && !matches!(a.ty, AttributeType::Int64 | AttributeType::UInt64);
        let all = schema.attributes.iter().zip(&schema.offsets).enumerate();
        let places: Vec<Place> = all
            .filter(|(_, (a, _))| takes_part(a))
            .map(|(attribute, (a, at))| Place { attribute, at: *at, ty: a.ty })
            .collect();
        let keys = places.iter().map(|p| Keys { is_full: !p.can_be_key(), ..Keys::default() }).collect();
        let pairs = (0..places.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let equal = pairs.filter(|(i, j)| places[*i].ty == places[*j].ty).collect();
        Self { is_constant: vec![true; places.len()], keys, equal, places, ..Self::default() }
    }

    /// True if it can be of points with these attributes.
    pub(crate) fn can_be_of(&self, schema: &Schema) -> bool {
        let count = self.places.len();
        let is_numbered = |keys: &Keys, values: usize| {
            let last = keys.last.map(|(_, number)| number);
            keys.numbers.len() <= MOST_KEYS && keys.numbers.values().copied().chain(last).all(|n| n < values)
        };
        let is_table = |pair: &Pair| {
            let keys = self.keys.get(pair.key);
            pair.follower < count && keys.is_some_and(|keys| is_numbered(keys, pair.values.len()))
        };
        self.places == Self::new(schema).places
            && [self.is_constant.len(), self.keys.len()] == [count; 2]
            && self.keys.iter().all(|keys| is_numbered(keys, keys.numbers.len()))
            && self.first.as_ref().is_none_or(|first| first.len() == count)
            && self.equal.iter().all(|(i, j)| i < j && *j < count)
            && self.pairs.iter().all(is_table)
    }

    /// Adds stored records of `stride` bytes.
    pub(crate) fn add(&mut self, records: &[u8], stride: usize) {
        for record in records.chunks_exact(stride) {
            let mut values = std::mem::take(&mut self.values);
            values.clear();
            values.extend(self.places.iter().map(|place| place.value(record)));
            self.add_values(&values);
            self.values = values;
        }
    }

    fn add_values(&mut self, values: &[u64]) {
        let first = self.first.get_or_insert_with(|| values.to_vec());
        let changed: Vec<usize> =
            (0..values.len()).filter(|j| self.is_constant[*j] && first[*j] != values[*j]).collect();
        changed.into_iter().for_each(|j| self.end_constant(j));
        self.equal.retain(|(i, j)| values[*i] == values[*j]);
        let Self { keys, numbers, pairs, .. } = self;
        numbers.clear();
        numbers.extend(keys.iter_mut().zip(values).map(|(keys, value)| keys.number(*value)));
        pairs.retain_mut(|pair| match numbers[pair.key] {
            None => false,
            Some((_, true)) => {
                pair.values.push(values[pair.follower]);
                true
            }
            Some((number, false)) => pair.values[number] == values[pair.follower],
        });
    }

    /// From here on an attribute has other values than the one that all points have had: that one follows from each key so far.
    fn end_constant(&mut self, follower: usize) {
        let Some(value) = self.first.as_ref().map(|first| first[follower]) else { return };
        self.is_constant[follower] = false;
        for (key, keys) in self.keys.iter().enumerate().filter(|(key, keys)| *key != follower && !keys.is_full) {
            self.pairs.push(Pair { key, follower, values: vec![value; keys.numbers.len()] });
        }
    }

    /// Adds what was seen of other points of the same schema.
    pub(crate) fn merge(&mut self, other: &Self) {
        let Some(theirs) = &other.first else { return };
        let Some(ours) = &self.first else {
            *self = other.clone();
            return;
        };
        let mut other = other.clone();
        let is_constant: Vec<bool> = (0..self.places.len())
            .map(|j| self.is_constant[j] && other.is_constant[j] && ours[j] == theirs[j])
            .collect();
        for side in [&mut *self, &mut other] {
            let ended: Vec<usize> =
                (0..is_constant.len()).filter(|j| side.is_constant[*j] && !is_constant[*j]).collect();
            ended.into_iter().for_each(|j| side.end_constant(j));
        }
        self.equal.retain(|pair| other.equal.contains(pair));
        let find = |pairs: &[Pair], of: &Pair| pairs.iter().position(|p| (p.key, p.follower) == (of.key, of.follower));
        self.pairs.retain(|pair| find(&other.pairs, pair).is_some());
        let partners: Vec<Option<usize>> = self.pairs.iter().map(|pair| find(&other.pairs, pair)).collect();
        let mut holds = vec![true; self.pairs.len()];
        for key in 0..self.keys.len() {
            let mut theirs: Vec<(usize, u64)> = other.keys[key].numbers.iter().map(|(v, n)| (*n, *v)).collect();
            theirs.sort_unstable();
            self.keys[key].is_full |= other.keys[key].is_full;
            for (their_number, value) in theirs {
                let found = self.keys[key].number(value);
                let of_key = self.pairs.iter_mut().enumerate().filter(|(_, pair)| pair.key == key);
                for (i, pair) in of_key {
                    let follows = partners[i].map(|partner| other.pairs[partner].values[their_number]);
                    match (found, follows) {
                        (Some((_, true)), Some(follows)) => pair.values.push(follows),
                        (Some((number, false)), Some(follows)) => holds[i] &= pair.values[number] == follows,
                        _ => holds[i] = false,
                    }
                }
            }
            if self.keys[key].is_full {
                self.keys[key].numbers.clear();
                self.pairs
                    .iter()
                    .zip(&mut holds)
                    .filter(|(pair, _)| pair.key == key)
                    .for_each(|(_, holds)| *holds = false);
            }
        }
        let mut holds = holds.into_iter();
        self.pairs.retain(|_| holds.next().unwrap_or(false));
    }

    /// What each attribute of the schema follows from, if it may be left out. What others follow from stays. `is_constant`: by
    /// attribute, those that are left out because they have one value.
    pub(crate) fn choose(&self, schema: &Schema, is_constant: &[bool]) -> Vec<Option<Relation>> {
        let mut chosen: Vec<Option<Relation>> = vec![None; schema.attributes.len()];
        let mut is_needed = vec![false; schema.attributes.len()];
        for follower in (0..self.places.len()).rev() {
            let attribute = self.places[follower].attribute;
            let is_visible = VISIBLE.contains(&schema.attributes[attribute].name.as_str());
            if is_constant[attribute] || is_needed[attribute] || is_visible {
                continue;
            }
            let stays = |place: usize| {
                let attribute = self.places[place].attribute;
                !is_constant[attribute] && chosen[attribute].is_none()
            };
            let same = self.equal.iter().filter_map(|(i, j)| match follower {
                f if f == *i => Some(*j),
                f if f == *j => Some(*i),
                _ => None,
            });
            let same = same.filter(|place| stays(*place)).min();
            let pairs = self.pairs.iter().filter(|pair| pair.follower == follower && stays(pair.key));
            let relation = match (same, pairs.min_by_key(|pair| pair.key)) {
                (Some(place), _) => Some((place, Relation::SameAs(self.places[place].attribute))),
                (None, Some(pair)) => self.table(pair).map(|relation| (pair.key, relation)),
                (None, None) => None,
            };
            if let Some((place, relation)) = relation {
                is_needed[self.places[place].attribute] = true;
                chosen[attribute] = Some(relation);
            }
        }
        chosen
    }

    /// The table of a pair; `None` if a value is not finite.
    fn table(&self, pair: &Pair) -> Option<Relation> {
        let (key, follower) = (&self.places[pair.key], &self.places[pair.follower]);
        let row = |(value, number): (&u64, &usize)| {
            let follows = pair.values.get(*number)?;
            Some([number_of(*value, key.ty), number_of(*follows, follower.ty)])
        };
        let mut table: Vec<[f64; 2]> = self.keys[pair.key].numbers.iter().map(row).collect::<Option<_>>()?;
        table.sort_by(|a, b| a[0].total_cmp(&b[0]));
        let is_finite = table.iter().flatten().all(|v| v.is_finite());
        is_finite.then_some(Relation::FollowsFrom { attribute: key.attribute, table })
    }
}

/// The number that the lowest bytes of a value are.
fn number_of(value: u64, ty: AttributeType) -> f64 {
    match ty {
        AttributeType::Int8 => f64::from(value as u8 as i8),
        AttributeType::UInt8 => f64::from(value as u8),
        AttributeType::Int16 => f64::from(value as u16 as i16),
        AttributeType::UInt16 => f64::from(value as u16),
        AttributeType::Int32 => f64::from(value as u32 as i32),
        AttributeType::UInt32 => f64::from(value as u32),
        AttributeType::Float32 => f64::from(f32::from_bits(value as u32)),
        AttributeType::Float64 => f64::from_bits(value),
        _ => f64::NAN,
    }
}

#[cfg(test)]
mod tests;
