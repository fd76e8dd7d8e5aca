//! The columns of a dataset's points as those of a scan.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use crate::scan::resize;
use crate::{Attribute, Column, NodePoints, PointBatch, Wanted, with_column};

/// Colours of 8 bits that a reader of datasets gives as 16: each channel times this.
const CHANNEL: u16 = 257;

/// The attributes of the scan, and the columns of the dataset that they come from.
#[derive(Debug, Clone, Default)]
pub(super) struct Columns {
    attributes: Arc<[Attribute]>,
    sources: Vec<Source>,
}

/// A column of the dataset.
#[derive(Debug, Clone, Copy)]
struct Source {
    index: usize,
    /// Colours are taken back to 8 bits.
    is_8_bit: bool,
}

impl Columns {
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
            sources.push(Source { index, is_8_bit: is_8_bit && attribute.name == "rgb" });
            attributes.push(attribute);
        }
        Self { attributes: attributes.into(), sources }
    }

    pub(super) fn attributes(&self) -> Arc<[Attribute]> {
        Arc::clone(&self.attributes)
    }

    /// Puts the wanted columns of some points into a batch.
    pub(super) fn fill(&self, points: &NodePoints, range: &Range<usize>, wanted: &Wanted, batch: &mut PointBatch) {
        for (i, (source, out)) in self.sources.iter().zip(&mut batch.columns).enumerate() {
            match points.columns().get(source.index).filter(|_| wanted.is_wanted(i)) {
                Some(column) => copy(column, self.attributes[i].elements, range, out),
                None => out.clear(),
            }
            if let (true, Column::UInt16(channels)) = (source.is_8_bit, out) {
                channels.iter_mut().for_each(|channel| *channel /= CHANNEL);
            }
        }
    }
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
    fn names_come_back_unless_another_attribute_has_them() {
        let stored = ["rgb", "color_", "height_", "height"].map(|name| Attribute::new(name, AttributeType::UInt16, 1));
        let renamed = [("color_", "color"), ("height_", "height")].map(|(a, b)| (a.to_owned(), b.to_owned()));
        let columns = Columns::new(&stored, &HashMap::from(renamed), |name| name == "rgb", false);
        let names: Vec<&str> = columns.attributes.iter().map(|a| a.name.as_str()).collect();
        assert_eq!(names, ["color", "height_", "height"]);
    }
}
