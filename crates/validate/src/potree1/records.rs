//! Records of nodes as the comparison with the sources wants them.

use pointmill_format::octree::Octree as _;
use pointmill_format::potree1::{Dataset, NodeFiles};
use pointmill_format::{Attribute, AttributeType, NodeKey, NodePoints, ReadError};
use rayon::prelude::*;
use serde_json::Value;

use super::steps::Steps;
use crate::against::block::{BLOCK_POINTS, Block, append_words};
use crate::against::rules::{Channels, Conversion};
use crate::against::{self, Rules, Sink};
use crate::octree::tree::Tree;
use crate::place::Place;

/// What fills each attribute that is compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Feed {
    /// The column of that number, as it is.
    Column(usize),
    /// The channels of the colours in the column of that number.
    Channels(usize),
    /// The greys in it.
    Greys(usize),
}

/// The columns of a dataset that are compared.
#[derive(Debug, Clone)]
pub(crate) struct Columns(Vec<Feed>);

/// Which normals records have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Normals {
    /// Those that are exactly what they were made of.
    IfExact,
    Always,
}

/// What is compared: all that a record holds exactly. Normals of two bytes are not what they were made of; colours that
/// were made of intensities are compared with these, if they are whole numbers, and white is with nothing.
pub(crate) fn rules(dataset: &Dataset, steps: &Steps, own: &Value, normals: Normals) -> (Rules, Columns) {
    let attributes = &dataset.info().attributes;
    let is_exact = |name: &str| !name.starts_with("Normal") || normals == Normals::Always || has_floats(dataset);
    let (mut compared, mut conversions, mut feeds) = (Vec::new(), Vec::new(), Vec::new());
    for (column, attribute) in attributes.iter().enumerate().filter(|(_, a)| is_exact(&a.name)) {
        let (attribute, conversion, feed) = match (attribute.name.as_str(), Colours::of(own)) {
            ("rgb", _) if dataset.metadata().files != NodeFiles::Bin => {
                (attribute.clone(), Conversion::AsStored, Feed::Column(column))
            }
            ("rgb", Colours::Own) => (attribute.clone(), Conversion::AsStored, Feed::Channels(column)),
            ("rgb", Colours::Grey(range)) => {
                let intensity = Attribute::new("intensity", AttributeType::UInt16, 1);
                (intensity, Conversion::Grey(range), Feed::Greys(column))
            }
            ("rgb", Colours::Made) => continue,
            _ => (attribute.clone(), Conversion::AsStored, Feed::Column(column)),
        };
        compared.push(scaled(attribute, own));
        conversions.push(conversion);
        feeds.push(feed);
    }
    let mut known = own.clone();
    if let Some(map) = known.as_object_mut() {
        map.insert("latticeOffset".into(), own["lattice"]["offset"].clone());
    }
    let mut rules = Rules::new(compared, steps.lattice, &known);
    rules.conversions = conversions;
    rules.has_no_wide_integers = true;
    rules.compare_positions = steps.is_stated();
    rules.channels = match (dataset.metadata().files, rules.foreign) {
        (NodeFiles::Bin, false) => Channels::Rounded,
        (NodeFiles::Bin, true) => Channels::Upper,
        _ => Channels::Wide,
    };
    (rules, Columns(feeds))
}

/// The attribute with the scale and offset that the dataset's own key states of its values.
fn scaled(mut attribute: Attribute, own: &Value) -> Attribute {
    let stated = &own["attributeScales"][&attribute.name];
    let numbers = |key: &str| -> Option<Vec<f64>> { stated[key].as_array()?.iter().map(Value::as_f64).collect() };
    for (key, place) in [("scale", &mut attribute.scale), ("offset", &mut attribute.offset)] {
        if let Some(numbers) = numbers(key).filter(|numbers| numbers.len() == attribute.elements) {
            *place = numbers;
        }
    }
    attribute
}

/// Normals are stored as three floats.
pub(crate) fn has_floats(dataset: &Dataset) -> bool {
    dataset.metadata().attributes.iter().any(|a| a.ty == AttributeType::Float32 && a.elements == 3)
}

/// Where the colours of a dataset come from, as its own key states it.
enum Colours {
    /// The sources' colours.
    Own,
    /// Their intensities, of that range.
    Grey([u64; 2]),
    /// White, or greys of what is no whole number.
    Made,
}

impl Colours {
    fn of(own: &Value) -> Self {
        let stated = &own["colours"];
        let range = stated["intensity"].as_array().map(|ends| ends.iter().filter_map(whole).collect::<Vec<u64>>());
        match range.as_deref() {
            Some(&[least, greatest]) => Self::Grey([least, greatest]),
            _ if stated.is_null() => Self::Own,
            _ => Self::Made,
        }
    }
}

/// A number that is whole, however it is written.
fn whole(value: &Value) -> Option<u64> {
    value.as_f64().filter(|v| v.fract() == 0.0 && *v >= 0.0).map(|v| v as u64)
}

/// All nodes of a dataset.
pub(crate) struct Records<'a> {
    pub(crate) dataset: &'a Dataset,
    pub(crate) tree: &'a Tree,
    pub(crate) steps: &'a Steps,
    pub(crate) columns: &'a Columns,
}

impl against::Records for Records<'_> {
    fn each_block(&self, rules: &Rules, work: &(dyn Fn(&mut Block, Place) + Sync)) -> Result<(), ReadError> {
        let readable = self.tree.nodes.par_iter().filter(|n| n.readable);
        readable.try_for_each_init(<(NodePoints, Block)>::default, |(points, block), node| {
            match self.dataset.read_points(node.key, points) {
                Err(error) if !error.is_io() => return Ok(()), // reported by the walk
                other => other?,
            }
            let sink = &mut |block: &mut Block| work(block, node.key.into());
            fill_blocks(node.key, points, (self.steps, self.columns), rules, block, sink);
            Ok(())
        })
    }
}

/// Hands over a node's records in blocks.
pub(crate) fn fill_blocks(
    key: NodeKey,
    points: &NodePoints,
    (steps, columns): (&Steps, &Columns),
    rules: &Rules,
    block: &mut Block,
    sink: &mut Sink<'_>,
) {
    let axes = rules.compare_positions.then(|| [0, 1, 2].map(|axis| steps.axis(key, points, axis)));
    for start in (0..points.len()).step_by(BLOCK_POINTS) {
        let n = (points.len() - start).min(BLOCK_POINTS);
        block.reset(rules.attributes.len());
        block.keep.resize(n, true);
        for (axis, to) in block.positions.iter_mut().enumerate() {
            match &axes {
                Some(axes) => to.extend(&axes[axis][start..start + n]),
                None => to.resize(n, 0),
            }
        }
        for ((attribute, feed), words) in rules.attributes.iter().zip(&columns.0).zip(&mut block.words) {
            match *feed {
                Feed::Column(column) => {
                    let column = points.columns().get(column).map(|c| (c, attribute.elements));
                    append_words(column, start, n, attribute, words);
                }
                Feed::Channels(column) => words.extend(bytes(points, column, start, n).flatten()),
                Feed::Greys(column) => words.extend(bytes(points, column, start, n).map(grey_of)),
            }
        }
        sink(block);
    }
}

/// The channels of colours as the bytes that are stored.
fn bytes(points: &NodePoints, column: usize, start: usize, n: usize) -> impl Iterator<Item = [u64; 3]> + '_ {
    let values = points.columns().get(column).and_then(|c| c.values::<u16>()).unwrap_or_default();
    let colours = values.as_chunks::<3>().0.iter();
    colours.skip(start).take(n).map(|rgb| rgb.map(|channel| u64::from(channel >> 8)))
}

/// The grey of a colour; a colour that is not grey differs from every grey.
fn grey_of([r, g, b]: [u64; 3]) -> u64 {
    if r == g && g == b { r } else { 256 + (r << 16 | g << 8 | b) }
}
