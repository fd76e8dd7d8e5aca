//! The columns of a dataset's points as those of a scan.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use super::own_key::OwnKey;
use super::restored::Restored;
use crate::scan::resize;
use crate::{Attribute, Changes, Column, NodePoints, PointBatch, Wanted, with_column};

/// Colours of 8 bits that a reader of datasets gives as 16: each channel times this.
const CHANNEL: u16 = 257;

/// The attributes of the scan, and the columns of the dataset that they come from.
#[derive(Debug, Clone, Default)]
pub(super) struct Columns {
    attributes: Arc<[Attribute]>,
    sources: Vec<Source>,
    /// Attributes that are not stored, behind those that are, each with the place among these that it follows from.
    restored: Vec<(Restored, Option<usize>)>,
}

/// A column of the dataset, and what becomes of it.
#[derive(Debug, Clone, Copy)]
struct Source {
    index: usize,
    becomes: Becomes,
}

/// What becomes of the values of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Becomes {
    /// What they are.
    Same,
    /// 16-bit channels that were made of 8 bits: these again.
    Eighths,
    /// Words whose lower bytes are red, green and blue: three channels of 8 bits.
    Channels,
    /// Four bytes, of which the first three are red, green and blue.
    FirstThree,
    /// Classes as floats: whole numbers of 8 bits.
    Class,
}

impl Columns {
    /// Columns one by one.
    pub(super) fn list(columns: impl IntoIterator<Item = (Attribute, usize, Becomes)>) -> Self {
        let (attributes, sources): (Vec<_>, _) =
            columns.into_iter().map(|(attribute, index, becomes)| (attribute, Source { index, becomes })).unzip();
        Self { attributes: attributes.into(), sources, restored: Vec::new() }
    }

    /// All columns of a dataset but those that `is_made` says are none of the points that it was made from. `renamed`: name in
    /// the dataset → name of the attribute; `is_8_bit`: the colours of the dataset are of 8 bits.
    pub(super) fn new(
        stored: &[Attribute],
        renamed: &HashMap<String, String>,
        is_made: impl Fn(&str) -> bool,
        is_8_bit: bool,
    ) -> Self {
        let (mut attributes, mut sources): (Vec<Attribute>, _) = (Vec::new(), Vec::new());
        let taken = |name: &str| stored.iter().any(|a| a.name == name);
        for (index, attribute) in stored.iter().enumerate().filter(|(_, a)| !is_made(&a.name)) {
            let mut attribute = attribute.clone();
            let own_name = renamed.get(&attribute.name).filter(|name| {
                let is_other = !taken(name) || renamed.contains_key(*name);
                is_other && !attributes.iter().any(|a| a.name == **name)
            });
            if let Some(name) = own_name {
                attribute.name.clone_from(name);
            }
            let becomes = if is_8_bit && attribute.name == "rgb" { Becomes::Eighths } else { Becomes::Same };
            sources.push(Source { index, becomes });
            attributes.push(attribute);
        }
        Self { attributes: attributes.into(), sources, restored: Vec::new() }
    }

    /// The same, and what the dataset says of attributes that the scene did not require.
    pub(super) fn with_restored(self, own: OwnKey<'_>) -> Self {
        let stored = self.sources.len();
        let (mut attributes, mut restored) = (self.attributes.to_vec(), Vec::new());
        for one in Restored::list(own) {
            let place = |name: &str| attributes[..stored].iter().position(|a| a.name == name);
            let from = one.source().map(place);
            let is_sound = from.is_none_or(|from| from.is_some_and(|from| one.can_follow(&attributes[from])));
            if is_sound && !attributes.iter().any(|a| a.name == one.attribute.name) {
                attributes.push(one.attribute.clone());
                restored.push((one, from.flatten()));
            }
        }
        Self { attributes: attributes.into(), restored, ..self }
    }

    pub(super) fn attributes(&self) -> Arc<[Attribute]> {
        Arc::clone(&self.attributes)
    }

    /// Puts the wanted columns of some points into a batch.
    pub(super) fn fill(&self, points: &NodePoints, range: &Range<usize>, wanted: &Wanted, batch: &mut PointBatch) {
        for (i, source) in self.sources.iter().enumerate() {
            let out = &mut batch.columns[i];
            match points.columns().get(source.index).filter(|_| wanted.is_wanted(i)) {
                Some(column) => {
                    let changes = source.becomes.put(column, self.attributes[i].elements, range, out);
                    batch.count_changes(i, &changes);
                }
                None => out.clear(),
            }
        }
        for (n, (restored, from)) in self.restored.iter().enumerate() {
            let i = self.sources.len() + n;
            if !wanted.is_wanted(i) {
                batch.columns[i].clear();
                continue;
            }
            let from = from.and_then(|from| self.stored(from, points, range));
            let changes = restored.put(from.as_ref(), range.len(), &mut batch.columns[i]);
            batch.count_changes(i, &changes);
        }
    }

    /// The values of a stored attribute of some points.
    fn stored(&self, i: usize, points: &NodePoints, range: &Range<usize>) -> Option<Column> {
        let (source, attribute) = (self.sources.get(i)?, self.attributes.get(i)?);
        let mut column = Column::new(attribute.ty);
        source.becomes.put(points.columns().get(source.index)?, attribute.elements, range, &mut column);
        Some(column)
    }
}

impl Becomes {
    /// Puts values of some points into the column of the attribute, which has the right type.
    fn put(self, from: &Column, elements: usize, range: &Range<usize>, to: &mut Column) -> Changes {
        let mut changes = Changes::default();
        match (self, from, to) {
            (Self::Channels, Column::UInt32(words), Column::UInt16(to)) => {
                let words = words.get(range.clone()).unwrap_or_default();
                resize(to, 3 * words.len());
                for (to, word) in to.as_chunks_mut::<3>().0.iter_mut().zip(words) {
                    let [r, g, b, _] = word.to_le_bytes();
                    *to = [r, g, b].map(u16::from);
                }
            }
            (Self::FirstThree, Column::UInt8(bytes), Column::UInt16(to)) => {
                let some = bytes.get(4 * range.start..4 * range.end).unwrap_or_default().as_chunks::<4>().0;
                resize(to, 3 * some.len());
                for (to, [r, g, b, _]) in to.as_chunks_mut::<3>().0.iter_mut().zip(some) {
                    *to = [*r, *g, *b].map(u16::from);
                }
            }
            (Self::Class, Column::Float32(classes), Column::UInt8(to)) => {
                let some = classes.get(range.clone()).unwrap_or_default();
                resize(to, some.len());
                to.iter_mut().zip(some).for_each(|(to, class)| *to = class_of(*class, &mut changes));
            }
            (becomes, from, to) => {
                copy(from, elements, range, to);
                if let (Self::Eighths, Column::UInt16(channels)) = (becomes, to) {
                    channels.iter_mut().for_each(|channel| *channel /= CHANNEL);
                }
            }
        }
        changes
    }
}

/// A class of 8 bits; what is none is 0, and counted.
fn class_of(class: f32, changes: &mut Changes) -> u8 {
    let rounded = class.round();
    match () {
        () if !class.is_finite() => changes.not_finite += 1,
        () if !(0.0..=255.0).contains(&rounded) => changes.leave_out(class.into()),
        () => {
            if rounded != class {
                changes.round(class.into());
            }
            return rounded as u8;
        }
    }
    0
}

/// Values of some points; the columns are of one type.
fn copy(from: &Column, elements: usize, range: &Range<usize>, to: &mut Column) {
    with_column!(to, to => {
        let all = from.values().unwrap_or_default();
        let some = all.get(range.start * elements..range.end * elements).unwrap_or_default();
        resize(to, some.len());
        to.copy_from_slice(some);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::AttributeType;

    #[test]
    fn colours_are_taken_from_words_and_from_bytes() {
        let mut rgb = Column::UInt16(Vec::new());
        Becomes::Channels.put(&Column::UInt32(vec![0, 0x0332_64c8]), 3, &(1..2), &mut rgb);
        assert_eq!(rgb, Column::UInt16(vec![200, 100, 50]));
        Becomes::FirstThree.put(&Column::UInt8(vec![1, 2, 3, 255, 4, 5, 6, 255]), 3, &(0..2), &mut rgb);
        assert_eq!(rgb, Column::UInt16(vec![1, 2, 3, 4, 5, 6]));
        Becomes::Eighths.put(&Column::UInt16(vec![257, 65_535, 0]), 3, &(0..1), &mut rgb);
        assert_eq!(rgb, Column::UInt16(vec![1, 255, 0]));
    }

    #[test]
    fn classes_are_whole_numbers_and_others_are_counted() {
        let mut classes = Column::UInt8(Vec::new());
        let floats = Column::Float32(vec![9.0, 2.0, 255.0, 256.0, -1.0, f32::NAN, 6.4]);
        let changes = Becomes::Class.put(&floats, 1, &(1..7), &mut classes);
        assert_eq!(classes, Column::UInt8(vec![2, 255, 0, 0, 0, 6]));
        assert_eq!((changes.out_of_range, changes.not_finite, changes.rounded), (2, 1, 1));
    }

    #[test]
    fn names_come_back_unless_another_attribute_has_them() {
        let stored = ["rgb", "color_", "height_", "height"].map(|name| Attribute::new(name, AttributeType::UInt16, 1));
        let renamed = [("color_", "color"), ("height_", "height")].map(|(a, b)| (a.to_owned(), b.to_owned()));
        let columns = Columns::new(&stored, &HashMap::from(renamed), |name| name == "rgb", false);
        let names: Vec<&str> = columns.attributes.iter().map(|a| a.name.as_str()).collect();
        assert_eq!(names, ["color", "height_", "height"]);
    }
}
