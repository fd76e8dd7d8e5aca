//! What stands beside the positions: the colour, and the extra attributes.

use pointmill_format::batches::{ColourSource, colour_word, eight_bit, grey};
use pointmill_format::{Attribute, AttributeType};

use crate::convert::Run;
use crate::needs;
use crate::octree::choose_attributes;
use crate::plan::AttributeChoice;
use crate::report::DroppedAttribute;

/// Where colours come from, and which attributes have sections of their own.
pub(super) struct Content {
    colour: Colour,
    /// In the order of their sections.
    pub(super) extras: Vec<Extra>,
    /// Names for the report, the position not among them.
    pub(super) kept: Vec<usize>,
    pub(super) dropped: Vec<DroppedAttribute>,
    /// For people.
    pub(super) warnings: Vec<String>,
}

/// An attribute with a section of its own.
#[derive(Debug, Clone)]
pub(super) struct Extra {
    pub(super) attribute: Attribute,
    /// Index in the schema.
    pub(super) index: usize,
    /// Its bytes in a stored record.
    pub(super) from: usize,
    pub(super) to: usize,
}

#[derive(Debug, Clone, PartialEq)]
enum Colour {
    /// Byte offset in a stored record; for each source, if its values are 8 bits deep.
    Rgb {
        at: usize,
        is_eight_bit: Vec<bool>,
    },
    /// Byte offset in a stored record, type, and the range of all points.
    Intensity {
        at: usize,
        ty: AttributeType,
        least: f64,
        greatest: f64,
    },
    None,
}

impl Content {
    pub(super) fn choose(run: &Run<'_>) -> Self {
        let (job, schema) = (run.job, &run.job.schema);
        let colour_index = needs::colour(schema);
        let is_rgb = schema.rgb().is_some();
        let choice = match &run.plan.attributes {
            AttributeChoice::Usual => Vec::new(),
            other => choose_attributes(other, job, &run.facts.ranges).kept,
        };
        let extras: Vec<usize> = choice.into_iter().filter(|i| !(is_rgb && Some(*i) == colour_index)).collect();
        let mut kept: Vec<usize> = colour_index.filter(|_| is_rgb).into_iter().collect();
        kept.extend(&extras);
        let usual = "not part of the usual record; --attributes adds it";
        let unasked = if run.plan.attributes == AttributeChoice::Usual { usual } else { "not asked for" };
        let left = |i: usize| {
            let is_scene = run.plan.attributes == AttributeChoice::Scene;
            let constant = run.facts.ranges[i].constant().filter(|_| is_scene).map(<[f64]>::to_vec);
            let why = match &constant {
                Some(values) => {
                    format!("constant {}", values.iter().map(f64::to_string).collect::<Vec<_>>().join(" "))
                }
                None if !is_rgb && Some(i) == colour_index => "shown as grey of 8 bits".to_owned(),
                None => unasked.to_owned(),
            };
            DroppedAttribute { name: schema.attributes[i].name.clone(), why, constant }
        };
        let left_out = (0..schema.attributes.len()).filter(|i| !kept.contains(i));
        let mut dropped: Vec<DroppedAttribute> = left_out.map(left).collect();
        dropped.extend(needs::dropped(schema, &job.unread, |_| true, unasked));
        let colour = match colour_index {
            Some(i) if is_rgb => Colour::Rgb {
                at: schema.offsets[i],
                is_eight_bit: run.facts.widen_rgb.iter().map(Option::is_some).collect(),
            },
            Some(i) => {
                let range = &run.facts.ranges[i];
                let (least, greatest) = if range.is_empty() { (0.0, 0.0) } else { (range.min[0], range.max[0]) };
                Colour::Intensity { at: schema.offsets[i], ty: schema.attributes[i].ty, least, greatest }
            }
            None => Colour::None,
        };
        let extra = |index: usize| {
            let (attribute, from) = (schema.attributes[index].clone(), schema.offsets[index]);
            let to = from + attribute.size();
            Extra { attribute, index, from, to }
        };
        let extras = extras.into_iter().map(extra).collect();
        let mut content = Self { colour, extras, kept, dropped, warnings: Vec::new() };
        content.warnings = content.warnings(run);
        content
    }

    fn warnings(&self, run: &Run<'_>) -> Vec<String> {
        let mut lines = Vec::new();
        match &self.colour {
            Colour::Rgb { is_eight_bit, .. } => {
                let rgb = run.job.schema.rgb();
                let used = |i: &usize| run.gathered.stats.sources[*i].kept > 0;
                let coloured = |i: &usize| run.job.sources[*i].columns.contains(&rgb);
                let sources: Vec<usize> = (0..is_eight_bit.len()).filter(used).collect();
                if sources.iter().any(|i| coloured(i) && !is_eight_bit[*i]) {
                    lines.push("batches: colours of 16 bits are stored in 8".to_owned());
                }
                match sources.iter().filter(|i| !coloured(i)).count() {
                    0 => {}
                    n => lines.push(format!("batches: {n} of {} inputs have no colour and are black", sources.len())),
                }
            }
            Colour::Intensity { least, greatest, .. } => {
                lines.push(format!("batches: no input has colour; grey shows the intensity, {least} to {greatest}"));
            }
            Colour::None => lines.push("batches: no input has colour or intensity; all points are white".to_owned()),
        }
        lines
    }

    pub(super) fn source(&self) -> ColourSource {
        match self.colour {
            Colour::Rgb { .. } => ColourSource::Rgb,
            Colour::Intensity { .. } => ColourSource::Intensity,
            Colour::None => ColourSource::None,
        }
    }

    /// Range of the intensities that grey stands for.
    pub(super) fn intensity_range(&self) -> Option<[f64; 2]> {
        match self.colour {
            Colour::Intensity { least, greatest, .. } => Some([least, greatest]),
            _ => None,
        }
    }

    /// Appends the colour words of records of one source, levels 0.
    pub(super) fn words(&self, records: &[u8], stride: usize, source: u32, out: &mut Vec<u32>) {
        let records = records.chunks_exact(stride);
        match &self.colour {
            Colour::Rgb { at, is_eight_bit } => {
                let is_eight_bit = is_eight_bit.get(source as usize).copied().unwrap_or(false);
                let channels = |r: &[u8]| match r.get(*at..).and_then(|r| r.first_chunk::<6>()) {
                    Some(&[a, b, c, d, e, f]) => [[a, b], [c, d], [e, f]].map(u16::from_le_bytes),
                    None => [0; 3],
                };
                if is_eight_bit {
                    out.extend(records.map(|r| colour_word(channels(r).map(|v| v as u8), 0)));
                } else {
                    out.extend(records.map(|r| colour_word(channels(r).map(eight_bit), 0)));
                }
            }
            Colour::Intensity { at, ty, least, greatest } => {
                let grey = |r: &[u8]| grey_of(&r[*at..], *ty, *least, *greatest);
                out.extend(records.map(|r| colour_word([grey(r); 3], 0)));
            }
            Colour::None => out.extend(records.map(|_| colour_word([255; 3], 0))),
        }
    }
}

/// The grey of one intensity, given as stored bytes.
fn grey_of(bytes: &[u8], ty: AttributeType, least: f64, greatest: f64) -> u8 {
    match (ty, bytes) {
        (AttributeType::UInt8, [v, ..]) => grey(u16::from(*v), least as u16, greatest as u16),
        (AttributeType::UInt16, [a, b, ..]) => grey(u16::from_le_bytes([*a, *b]), least as u16, greatest as u16),
        (AttributeType::Float32, [a, b, c, d, ..]) => {
            let v = f64::from(f32::from_le_bytes([*a, *b, *c, *d]));
            let range = greatest - least;
            if range > 0.0 { ((v - least) / range * 255.0 + 0.5) as u8 } else { 255 }
        }
        _ => 255,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn content(colour: Colour) -> Content {
        Content { colour, extras: vec![], kept: vec![], dropped: vec![], warnings: vec![] }
    }

    #[test]
    fn colours_are_taken_by_the_depth_of_their_source() {
        let c = content(Colour::Rgb { at: 1, is_eight_bit: vec![true, false] });
        let record = [9, 200, 0, 1, 0, 255, 0, 9, 0x34, 0x12, 0xff, 0xff, 0x80, 0];
        let mut out = Vec::new();
        c.words(&record, 7, 0, &mut out);
        assert_eq!(out[0], colour_word([200, 1, 255], 0));
        out.clear();
        c.words(&record, 7, 1, &mut out);
        assert_eq!(out, [colour_word([1, 0, 1], 0), colour_word([eight_bit(0x1234), 255, 0], 0)]);
    }

    #[test]
    fn intensities_of_every_usual_type_become_grey_and_nothing_is_white() {
        let of = |ty, bytes: &[u8], least, greatest| {
            let mut out = Vec::new();
            content(Colour::Intensity { at: 0, ty, least, greatest }).words(bytes, bytes.len(), 0, &mut out);
            out[0]
        };
        let grey = |v| colour_word([v; 3], 0);
        assert_eq!(of(AttributeType::UInt8, &[20], 10.0, 30.0), grey(128));
        assert_eq!(of(AttributeType::UInt16, &1000u16.to_le_bytes(), 0.0, 1000.0), grey(255));
        assert_eq!(of(AttributeType::Float32, &0.5f32.to_le_bytes(), 0.0, 1.0), grey(128));
        assert_eq!(of(AttributeType::Float32, &f32::NAN.to_le_bytes(), 0.0, 1.0), grey(0));
        assert_eq!(of(AttributeType::Float32, &3f32.to_le_bytes(), 3.0, 3.0), grey(255));
        let mut out = Vec::new();
        content(Colour::None).words(&[0; 24], 12, 0, &mut out);
        assert_eq!(out, [grey(255); 2]);
    }
}
