//! The points of a node or a leaf, as a vertex buffer takes them.

use pointmill_format::batches::eight_bit;
use pointmill_format::{Attribute, Column, NodePoints};

use super::cells::Cells;
use super::header::{Flag, UNIT_HEADER_BYTES, UnitHeader};
use crate::values::{Number, scaled};

/// The most bytes of a point: positions of 32 bits with an intensity, colour and class, an attribute.
const MOST_POINT_BYTES: u64 = 16 + 4 + 4;

/// The most bytes that `count` points take.
pub(crate) fn cost(count: u64) -> u64 {
    count.saturating_mul(MOST_POINT_BYTES).saturating_add(UNIT_HEADER_BYTES as u64 + 8)
}

/// What of points is requested, and what has to be known of all points to show them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Look<'a> {
    /// Columns of the points.
    pub(crate) attributes: &'a [Attribute],
    /// Index of the attribute whose values follow, and what is subtracted from them.
    pub(crate) attribute: Option<(usize, f64)>,
    /// The points 0, K, 2K, …
    pub(crate) every: usize,
    /// Colours of 16 bits have 16 bits: one is above 255.
    pub(crate) is_16_bit: bool,
    /// Least and greatest intensity, if they are no 16-bit integers.
    pub(crate) intensities: Option<[f64; 2]>,
}

/// A node or a leaf.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Unit<'a> {
    pub(crate) points: &'a NodePoints,
    /// 16 bits over the box will do for positions.
    pub(crate) may_round: bool,
}

/// Puts header and body of a unit at the end of `out`.
pub(crate) fn encode_unit(unit: Unit<'_>, look: &Look<'_>, out: &mut Vec<u8>) {
    let Unit { points, may_round } = unit;
    let every = look.every.max(1);
    let cells = Cells::new(points, every, may_round);
    let colours = Colours::new(points, look);
    let classes = column(points, look, "classification").map(|(column, _)| column);
    let intensities = Intensities::new(points, look);
    let attribute = look.attribute.and_then(|(index, least)| Some((look.attributes.get(index)?, index, least)));
    let flag = |is: bool, flag: u32| if is { flag } else { 0 };
    let header = UnitHeader {
        count: u32::try_from(points.len().div_ceil(every)).unwrap_or(u32::MAX),
        flags: flag(cells.is_wide, Flag::WIDE)
            | flag(!matches!(colours, Colours::None), Flag::COLOURS)
            | flag(attribute.is_some(), Flag::ATTRIBUTE)
            | flag(classes.is_some(), Flag::CLASSES)
            | flag(!matches!(intensities, Intensities::None), Flag::INTENSITIES),
        origin: cells.origin,
        step: cells.step,
        total: u32::try_from(points.len()).unwrap_or(u32::MAX),
    };
    let at = header.begin(out);
    let selected = || (0..points.len()).step_by(every);
    for index in selected() {
        let [x, y, z] = cells.of(points.positions(), index);
        let row = [x, y, z, intensities.of(index).into()];
        if cells.is_wide {
            row.iter().for_each(|v| out.extend_from_slice(&v.to_le_bytes()));
        } else {
            row.iter().for_each(|v| out.extend_from_slice(&(*v as u16).to_le_bytes()));
        }
    }
    for index in selected() {
        let [r, g, b] = colours.of(index);
        out.extend_from_slice(&[r, g, b, classes.map_or(0, |column| class(column, index))]);
    }
    if let Some((described, place, least)) = attribute {
        for index in selected() {
            let number = points.columns().get(place).and_then(|c| Number::of_column(c, index * described.elements));
            let value = number.map_or(0.0, |n| scaled(described, 0, n.as_f64()) - least);
            out.extend_from_slice(&(value as f32).to_le_bytes());
        }
    }
    UnitHeader::end(at, out);
}

fn column<'a>(points: &'a NodePoints, look: &Look<'a>, name: &str) -> Option<(&'a Column, &'a Attribute)> {
    let index = look.attributes.iter().position(|a| a.name == name)?;
    Some((points.columns().get(index)?, look.attributes.get(index)?))
}

/// A class is a byte; what is none is the nearest.
fn class(column: &Column, index: usize) -> u8 {
    match column {
        Column::UInt8(values) => values.get(index).copied().unwrap_or(0),
        other => Number::of_column(other, index).map_or(0, |n| n.as_f64() as u8),
    }
}

/// Where colours come from.
enum Colours<'a> {
    None,
    /// Channels of 8 bits, and how many a point has.
    Eight(&'a [u8], usize),
    /// Three channels of 16 bits.
    Sixteen(&'a [u16], usize, bool),
}

impl<'a> Colours<'a> {
    fn new(points: &'a NodePoints, look: &Look<'a>) -> Self {
        let found = ["rgb", "rgba"].into_iter().find_map(|name| column(points, look, name));
        match found {
            Some((Column::UInt8(values), attribute)) if attribute.elements >= 3 => {
                Self::Eight(values, attribute.elements)
            }
            Some((Column::UInt16(values), attribute)) if attribute.elements >= 3 => {
                Self::Sixteen(values, attribute.elements, look.is_16_bit)
            }
            _ => Self::None,
        }
    }

    #[inline]
    fn of(&self, index: usize) -> [u8; 3] {
        match self {
            Self::None => [0; 3],
            Self::Eight(values, elements) => three(values, index * elements).unwrap_or_default(),
            Self::Sixteen(values, elements, is_16_bit) => {
                let channels = three(values, index * elements).unwrap_or_default();
                channels.map(|c| if *is_16_bit { eight_bit(c) } else { c.min(255) as u8 })
            }
        }
    }
}

fn three<T: Copy>(values: &[T], at: usize) -> Option<[T; 3]> {
    values.get(at..)?.first_chunk().copied()
}

/// Intensities of 16 bits.
enum Intensities<'a> {
    None,
    Sixteen(&'a [u16]),
    /// Any other type, over its range.
    Scaled(&'a Column, &'a Attribute, [f64; 2]),
}

impl<'a> Intensities<'a> {
    fn new(points: &'a NodePoints, look: &Look<'a>) -> Self {
        match (column(points, look, "intensity"), look.intensities) {
            (None, _) => Self::None,
            (Some((Column::UInt16(values), _)), _) => Self::Sixteen(values),
            (Some((column, attribute)), range) => Self::Scaled(column, attribute, range.unwrap_or([0.0, 1.0])),
        }
    }

    #[inline]
    fn of(&self, index: usize) -> u16 {
        match self {
            Self::None => 0,
            Self::Sixteen(values) => values.get(index).copied().unwrap_or(0),
            Self::Scaled(column, attribute, [least, greatest]) => {
                let value = Number::of_column(column, index * attribute.elements).map_or(0.0, Number::as_f64);
                let span = greatest - least;
                if span > 0.0 { ((scaled(attribute, 0, value) - least) / span * 65_535.0).round() as u16 } else { 0 }
            }
        }
    }
}
