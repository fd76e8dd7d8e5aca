//! The rule that gives points their colours, and what it has to know of all points first.

use std::ops::ControlFlow;

use pointmill_format::batches::{eight_bit, lod_of, rgb_of};
use pointmill_format::{Attribute, Column, Positions};

use super::{ramps, values};
use crate::raster::word;
use crate::sources::{Buffers, Points, Source, Unit};
use crate::{Colour, RenderError};

/// Units that are sampled for ranges, evenly spread.
const SAMPLED_UNITS: usize = 16;

/// Points that are sampled of each of these, at most.
const SAMPLED_POINTS: usize = 4096;

/// The parts of the order that a ramp of intensities or heights spans: what lies beyond has the colour of its ends, so that
/// a few extremes do not make everything else look alike.
const SPAN: [f64; 2] = [0.02, 0.98];

/// Attributes by their names in datasets and scans.
const RGB: &str = "rgb";
const RGBA: &str = "rgba"; // of binary trees; the fourth byte is not looked at
const WORDS: &str = "colour"; // of quantised batches: red, green, blue and level of detail
const INTENSITY: &str = "intensity";
const CLASS: &str = "classification";
const NORMALS: [&str; 3] = ["NormalX", "NormalY", "NormalZ"];

/// The rule: what was requested, or what [`Colour::Auto`] came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Paint {
    pub(crate) colour: Colour,
    /// Of intensities or heights.
    range: [f64; 2],
    /// Colours have 16 bits: one was above 255.
    is_16_bit: bool,
}

/// What a sample of the points says.
#[derive(Debug, Default)]
struct Sample {
    intensities: Vec<f64>,
    heights: Vec<f64>,
    brightest: f64,
    has: [bool; 4],
    names: Vec<String>,
}

impl Paint {
    /// The attributes that may be needed.
    pub(crate) fn wanted(colour: Colour) -> &'static [&'static str] {
        match colour {
            Colour::Auto => &[RGB, RGBA, INTENSITY],
            Colour::Rgb => &[RGB, RGBA],
            Colour::Intensity => &[INTENSITY],
            Colour::Class => &[CLASS],
            Colour::Normal => &NORMALS,
            Colour::Height | Colour::Level | Colour::Overdraw | Colour::Bits => &[],
        }
    }

    /// Samples the points, and decides.
    ///
    /// # Errors
    /// Points that cannot be read; an attribute that is not there.
    pub(crate) fn new(colour: Colour, source: &dyn Source) -> Result<Self, RenderError> {
        let sample = Sample::take(colour, source)?;
        let [rgb, intensity, class, normal] = sample.has;
        let missing = |what| {
            let known = if sample.names.is_empty() { "none".to_owned() } else { sample.names.join(", ") };
            Err(RenderError::NoAttribute { at: source.name(), what, known })
        };
        // nothing to draw has any colour
        let is_empty = source.len() == 0;
        let colour = match colour {
            Colour::Auto if rgb && sample.brightest > 0.0 => Colour::Rgb,
            Colour::Auto if sample.intensities.iter().any(|v| *v != sample.intensities[0]) => Colour::Intensity,
            Colour::Auto => Colour::Height,
            Colour::Rgb if !rgb && !is_empty => return missing("rgb"),
            Colour::Intensity if !intensity && !is_empty => return missing("intensity"),
            Colour::Class if !class && !is_empty => return missing("classification"),
            Colour::Normal if !normal && !is_empty => return missing("normals"),
            other => other,
        };
        let Sample { mut intensities, mut heights, brightest, .. } = sample;
        let span = if colour == Colour::Intensity { &mut intensities } else { &mut heights };
        let range = values::percentiles(span, SPAN).unwrap_or([0.0, 1.0]);
        Ok(Self { colour, range, is_16_bit: brightest > 255.0 })
    }

    /// Colour words of points, in their order; replaces the contents of `out`.
    pub(crate) fn paint(&self, points: &Points<'_>, attributes: &[Attribute], unit: &Unit, out: &mut Vec<u32>) {
        out.clear();
        let column = |name: &str| {
            let index = attributes.iter().position(|a| a.name == name)?;
            Some((points.columns.get(index)?, attributes.get(index)?))
        };
        match self.colour {
            Colour::Rgb | Colour::Auto => match column(WORDS) {
                Some((Column::UInt32(words), _)) => out.extend(words.iter().map(|w| word(rgb_of(*w)))),
                _ => self.rgb(column(RGB).or_else(|| column(RGBA)), out),
            },
            Colour::Intensity => {
                if let Some((column, attribute)) = column(INTENSITY) {
                    let [low, span] = [self.range[0], self.range[1] - self.range[0]];
                    let part = |v: f64| if span > 0.0 { ((v - low) / span) as f32 } else { 1.0 };
                    values::each(column, attribute.elements, 0, |v| out.push(word(ramps::grey(part(v)))));
                }
            }
            Colour::Class => {
                if let Some((column, attribute)) = column(CLASS) {
                    values::each(column, attribute.elements, 0, |v| out.push(word(ramps::class(v))));
                }
            }
            Colour::Height => self.heights(points, out),
            Colour::Level => match column(WORDS) {
                Some((Column::UInt32(words), _)) => {
                    out.extend(words.iter().map(|w| word(ramps::level(lod_of(*w)))));
                }
                _ => out.resize(points.len(), word(ramps::level(unit.level))),
            },
            Colour::Normal => normals(points, attributes, out),
            Colour::Bits => out.resize(points.len(), word(ramps::bits(unit.bits))),
            Colour::Overdraw => {}
        }
        // a scan without the attribute, among others that have it
        out.resize(points.len(), word([200; 3]));
    }

    fn rgb(&self, column: Option<(&Column, &Attribute)>, out: &mut Vec<u32>) {
        match column.map(|(column, attribute)| (column, attribute.elements)) {
            Some((Column::UInt8(values), 4)) => {
                out.extend(values.as_chunks::<4>().0.iter().map(|[r, g, b, _]| word([*r, *g, *b])));
            }
            Some((Column::UInt8(values), _)) => out.extend(values.as_chunks::<3>().0.iter().map(|rgb| word(*rgb))),
            Some((Column::UInt16(values), _)) if self.is_16_bit => {
                out.extend(values.as_chunks::<3>().0.iter().map(|rgb| word(rgb.map(eight_bit))));
            }
            Some((Column::UInt16(values), _)) => {
                out.extend(values.as_chunks::<3>().0.iter().map(|rgb| word(rgb.map(|c| c.min(255) as u8))));
            }
            _ => {}
        }
    }

    fn heights(&self, points: &Points<'_>, out: &mut Vec<u32>) {
        let [low, span] = [self.range[0], self.range[1] - self.range[0]];
        let colour = |z: f64| word(ramps::height(if span > 0.0 { ((z - low) / span) as f32 } else { 0.5 }));
        match points.positions {
            Positions::Quantized([_, _, z]) => {
                let (scale, offset) = (points.lattice.scale[2], points.lattice.offset[2]);
                out.extend(z.iter().map(|z| colour(f64::from(*z) * scale + offset)));
            }
            Positions::World([_, _, z]) => out.extend(z.iter().map(|z| colour(*z))),
        }
    }
}

/// One attribute of three elements, or three attributes.
fn normals(points: &Points<'_>, attributes: &[Attribute], out: &mut Vec<u32>) {
    let Some(places) = normal_columns(attributes) else { return };
    let mut axes = [const { Vec::new() }; 3];
    for ((column, element), axis) in places.into_iter().zip(&mut axes) {
        let (Some(values), Some(attribute)) = (points.columns.get(column), attributes.get(column)) else { return };
        let (scale, offset) = (attribute.scale.get(element), attribute.offset.get(element));
        let [scale, offset] = [scale.copied().unwrap_or(1.0), offset.copied().unwrap_or(0.0)];
        values::each(values, attribute.elements, element, |v| axis.push(v * scale + offset));
    }
    let [x, y, z] = &axes;
    out.extend(x.iter().zip(y).zip(z).map(|((x, y), z)| word(ramps::normal([*x, *y, *z]))));
}

/// Column and element of each axis of a normal.
fn normal_columns(attributes: &[Attribute]) -> Option<[(usize, usize); 3]> {
    let at = |name: &str| attributes.iter().position(|a| a.name == name);
    if let [Some(x), Some(y), Some(z)] = NORMALS.map(at) {
        return Some([(x, 0), (y, 0), (z, 0)]);
    }
    let is_triple = |a: &Attribute| a.elements == 3 && a.name.to_ascii_lowercase().starts_with("normal");
    attributes.iter().position(is_triple).map(|i| [(i, 0), (i, 1), (i, 2)])
}

impl Sample {
    fn take(colour: Colour, source: &dyn Source) -> Result<Self, RenderError> {
        let mut sample = Self::default();
        let units = source.len();
        if units == 0 {
            return Ok(sample);
        }
        let count = units.min(SAMPLED_UNITS);
        let mut buffers = Buffers::default();
        for i in 0..count {
            let unit = i * units / count;
            let attributes = source.attributes(unit);
            sample.know(&attributes);
            source.read(unit, Paint::wanted(colour), &mut buffers, &mut |points| {
                sample.add(&points, &attributes);
                ControlFlow::Break(())
            })?;
        }
        Ok(sample)
    }

    fn know(&mut self, attributes: &[Attribute]) {
        let is_there = |name: &str| attributes.iter().any(|a| a.name == name);
        let found = [
            is_there(RGB) || is_there(RGBA) || is_there(WORDS),
            is_there(INTENSITY),
            is_there(CLASS),
            normal_columns(attributes).is_some(),
        ];
        for (has, found) in self.has.iter_mut().zip(found) {
            *has |= found;
        }
        let new = attributes.iter().filter(|a| !self.names.contains(&a.name)).map(|a| a.name.clone());
        let new: Vec<String> = new.collect();
        self.names.extend(new);
    }

    fn add(&mut self, points: &Points<'_>, attributes: &[Attribute]) {
        let step = points.len().div_ceil(SAMPLED_POINTS).max(1);
        self.heights.extend((0..points.len()).step_by(step).filter_map(|i| points.world(i)).map(|[_, _, z]| z));
        for (attribute, column) in attributes.iter().zip(points.columns) {
            let mut index = 0;
            let mut every = |kept: &mut Vec<f64>, v: f64| {
                if index % step == 0 {
                    kept.push(v);
                }
                index += 1;
            };
            match attribute.name.as_str() {
                INTENSITY => values::each(column, attribute.elements, 0, |v| every(&mut self.intensities, v)),
                RGB => values::each(column, 1, 0, |v| self.brightest = self.brightest.max(v)),
                RGBA => {
                    (0..3).for_each(|e| values::each(column, 4, e, |v| self.brightest = self.brightest.max(v)));
                }
                WORDS => self.brightest = 255.0,
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pointmill_format::{AttributeType, Lattice};

    fn paint(paint: &Paint, name: &str, elements: usize, column: Column) -> Vec<u32> {
        let attributes = [Attribute::new(name, column.ty(), elements)];
        let points = column.len() / elements;
        let z: Vec<f64> = (0..points).map(|i| i as f64).collect();
        let positions = Positions::World([z.clone(), z.clone(), z]);
        let columns = [column];
        let lattice = Lattice { scale: [1.0; 3], offset: [0.0; 3] };
        let points = Points { positions: &positions, lattice, columns: &columns };
        let mut out = vec![7; 99];
        paint.paint(&points, &attributes, &Unit::new(points.len() as u64), &mut out);
        out
    }

    const PLAIN: Paint = Paint { colour: Colour::Rgb, range: [0.0, 1.0], is_16_bit: false };

    #[test]
    fn colours_of_8_and_16_bits_are_what_they_mean() {
        let of = |rule: Paint, column| paint(&rule, RGB, 3, column);
        let deep = Paint { is_16_bit: true, ..PLAIN };
        assert_eq!(of(PLAIN, Column::UInt8(vec![1, 2, 255])), [0x0102ff]);
        assert_eq!(of(PLAIN, Column::UInt16(vec![1, 2, 255])), [0x0102ff]);
        assert_eq!(paint(&PLAIN, RGBA, 4, Column::UInt8(vec![1, 2, 255, 9, 0, 0, 3, 255])), [0x0102ff, 0x000003]);
        // rounded: 128 is nearer to 0, 129 to 257
        assert_eq!(of(deep, Column::UInt16(vec![257, 514, 65535, 128, 129, 0])), [0x0102ff, 0x000100]);
        let words = Column::UInt32(vec![1 | 2 << 8 | 255 << 16 | 3 << 24]);
        assert_eq!(paint(&PLAIN, WORDS, 1, words.clone()), [0x0102ff]);
        let levels = Paint { colour: Colour::Level, ..PLAIN };
        assert_eq!(paint(&levels, WORDS, 1, words), [word(ramps::level(3))]);
    }

    #[test]
    fn ramps_span_the_range() {
        let rule = Paint { colour: Colour::Intensity, range: [100.0, 200.0], ..PLAIN };
        let greys = paint(&rule, INTENSITY, 1, Column::UInt16(vec![50, 100, 200, 60000]));
        assert_eq!(greys, [0x1e1e1e, 0x1e1e1e, 0xffffff, 0xffffff]);
        let rule = Paint { colour: Colour::Height, range: [0.0, 2.0], ..PLAIN };
        let heights = paint(&rule, "x", 1, Column::UInt8(vec![0; 3]));
        assert_eq!(heights, [ramps::height(0.0), ramps::height(0.5), ramps::height(1.0)].map(word));
    }

    #[test]
    fn normals_are_found_under_their_names() {
        let three = NORMALS.map(|name| Attribute::new(name, AttributeType::Float32, 1));
        assert_eq!(normal_columns(&three), Some([(0, 0), (1, 0), (2, 0)]));
        let one = [Attribute::new("x", AttributeType::Int8, 1), Attribute::new("NORMAL", AttributeType::Float32, 3)];
        assert_eq!(normal_columns(&one), Some([(1, 0), (1, 1), (1, 2)]));
        assert_eq!(normal_columns(&one[..1]), None);
        let rule = Paint { colour: Colour::Normal, ..PLAIN };
        let found = paint(&rule, "normals", 3, Column::Float32(vec![0.0, 0.0, 1.0, 0.0, 0.0, 0.0]));
        assert_eq!(found, [0x8080ff, 0x808080]);
    }

    #[test]
    fn a_missing_column_gives_every_point_a_colour_all_the_same() {
        let rule = Paint { colour: Colour::Class, ..PLAIN };
        assert_eq!(paint(&rule, "x", 1, Column::UInt8(vec![1, 2])), [0xc8c8c8; 2]);
    }
}
