//! Colours of points as red, green, blue and alpha.

use pointmill_format::batches::{eight_bit, rgb_of};
use pointmill_format::{Column, NodePoints};

use crate::about::{Colours, Depth};
use crate::dataset::{Content, PmDataset};
use crate::decode::Decoder;
use crate::status::Outcome;

/// Nodes that are looked at, evenly spread, where a dataset does not say how many bits its colours have.
const SAMPLED: u32 = 16;

impl PmDataset {
    /// Where colours are and how deep; looks at points the first time, if the dataset does not say it.
    pub(crate) fn known_colours(&self) -> Outcome<Option<Colours>> {
        if let Some(known) = self.colours.get() {
            return Ok(*known);
        }
        let mut colours = self.about.colours();
        if let Some(colours) = &mut colours
            && colours.depth == Depth::Unknown
        {
            colours.depth = if self.is_deep(colours.column)? { Depth::Sixteen } else { Depth::Eight };
        }
        Ok(*self.colours.get_or_init(|| colours))
    }

    /// True if one of the values of some nodes takes more than 8 bits.
    fn is_deep(&self, column: usize) -> Outcome<bool> {
        let units: Vec<u32> = match &self.content {
            Content::Bintree(leaves) => leaves.tree.leaves().collect(),
            // chunks that are not read yet stay unread
            Content::Octree(tree) => {
                (0..tree.len()).filter(|id| tree.node(*id).is_some_and(|(node, _)| !node.is_proxy)).collect()
            }
            Content::Batches(_) => (0..self.node_count()).collect(),
        };
        let taken = SAMPLED.min(units.len() as u32) as usize;
        let mut decoder = Decoder::default();
        for id in (0..taken).filter_map(|i| units.get(i * units.len() / taken)) {
            decoder.decode(self, *id, 0)?;
            let values = decoder.points.columns().get(column).and_then(Column::values::<u16>);
            if values.unwrap_or(&[]).iter().any(|v| *v > 255) {
                return Ok(true);
            }
        }
        Ok(false)
    }
}

/// The colour of point `i`, opaque; `None` if the column is not one of colours.
pub(crate) fn colour(points: &NodePoints, colours: Colours, elements: usize, i: usize) -> Option<[u8; 4]> {
    let opaque = |[r, g, b]: [u8; 3]| [r, g, b, 255];
    match points.columns().get(colours.column)? {
        Column::UInt32(words) => Some(opaque(rgb_of(*words.get(i)?))),
        Column::UInt8(values) => {
            let rgb = values.get(i * elements..)?.first_chunk::<3>()?;
            Some(opaque(*rgb))
        }
        Column::UInt16(values) => {
            let rgb = values.get(i * elements..)?.first_chunk::<3>()?;
            Some(opaque(match colours.depth {
                Depth::Sixteen => rgb.map(eight_bit),
                _ => rgb.map(|v| v.min(255) as u8),
            }))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axes::PmAxes;
    use crate::test_help::open;

    /// A tree of which some chunks are not read, in a dataset that does not say the range of its colours.
    #[test]
    fn proxies_are_not_looked_at() {
        let dataset = open("copc/pages.copc.laz", PmAxes::ZUp);
        let Content::Octree(tree) = &dataset.content else { panic!() };
        let known = tree.len();
        assert!((0..known).any(|id| tree.node(id).unwrap().0.is_proxy), "the fixture has pages");
        let column = dataset.about.columns.iter().position(|c| c.attribute.name == "classification").unwrap(); // never above 255
        assert!(dataset.is_deep(column).is_ok());
        assert_eq!(tree.len(), known);
    }

    #[test]
    fn sixteen_bits_are_rounded_and_eight_bits_in_sixteen_are_kept() {
        let of = |depth, name: &str| {
            let dataset = open(name, PmAxes::ZUp);
            let colours = Colours { depth, ..dataset.about.colours().unwrap() };
            let mut decoder = Decoder::default();
            decoder.decode(&dataset, 0, 0).unwrap();
            let rgb = decoder.points.columns()[colours.column].values::<u16>().unwrap()[..3].to_vec();
            (rgb, colour(&decoder.points, colours, 3, 0).unwrap())
        };
        let (rgb, found) = of(Depth::Sixteen, "potree2/default");
        assert_eq!(found[..3], [eight_bit(rgb[0]), eight_bit(rgb[1]), eight_bit(rgb[2])]);
        let (rgb, found) = of(Depth::Eight, "potree2/default");
        assert_eq!(found.map(u16::from), [rgb[0].min(255), rgb[1].min(255), rgb[2].min(255), 255]);
    }
}
