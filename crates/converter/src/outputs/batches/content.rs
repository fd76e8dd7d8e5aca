//! What stands beside the positions: the colour, and the extra attributes.

use pointmill_format::batches::{ColourSource, colour_word, eight_bit};
use pointmill_format::{Attribute, AttributeType, DatasetKind};

use crate::cloud::{Cloud, Widening};
use crate::outputs::attributes::{choose, derived, left_out, not_required};
use crate::outputs::colour::{colour_notes, colour_of, extremes, grey_of};
use crate::plan::AttributeChoice;
use crate::report::{DropReason, DroppedAttribute};
use crate::warning::Warning;

/// Where colours come from, and which attributes have a section each.
pub(super) struct Content {
    colour: Colour,
    /// In the order of their sections.
    pub(super) extras: Vec<Extra>,
    /// Names for the report, the position not among them.
    pub(super) kept: Vec<usize>,
    pub(super) dropped: Vec<DroppedAttribute>,
    pub(super) warnings: Vec<Warning>,
}

/// An attribute that has a section.
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
    /// Byte offset in a stored record, and which values are 8 bits deep.
    Rgb {
        at: usize,
        widening: Widening,
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
    pub(super) fn choose(cloud: &Cloud<'_>) -> Self {
        let (schema, facts, requested) = (cloud.schema(), &cloud.facts, &cloud.plan.attributes);
        let colour_index = colour_of(schema);
        let is_rgb = schema.rgb().is_some();
        let choice = match requested {
            AttributeChoice::Usual => derived(&cloud.plan.derive, schema).collect(),
            _ => choose(cloud.plan, schema, &cloud.intake.unread, &facts.ranges, &facts.relations).kept,
        };
        let extras: Vec<usize> = choice.into_iter().filter(|i| !(is_rgb && Some(*i) == colour_index)).collect();
        let mut kept: Vec<usize> = colour_index.filter(|_| is_rgb).into_iter().collect();
        kept.extend(&extras);
        let is_usual = *requested == AttributeChoice::Usual;
        let unwanted = if is_usual { DropReason::NotUsual } else { DropReason::NotRequested };
        let left = |i: usize| {
            let is_scene = *requested == AttributeChoice::Scene;
            let why = match not_required(schema, &facts.ranges, &facts.relations, i).filter(|_| is_scene) {
                Some(why) => why,
                None if !is_rgb && Some(i) == colour_index => DropReason::ShownAsGrey,
                None => unwanted.clone(),
            };
            DroppedAttribute { name: schema.attributes[i].name.clone(), why }
        };
        let not_kept = (0..schema.attributes.len()).filter(|i| !kept.contains(i));
        let mut dropped: Vec<DroppedAttribute> = not_kept.map(left).collect();
        dropped.extend(left_out(schema, &cloud.intake.unread, |_| true, &unwanted));
        let colour = match colour_index {
            Some(i) if is_rgb => Colour::Rgb { at: schema.offsets[i], widening: facts.widening.clone() },
            Some(i) => {
                let [least, greatest] = extremes(cloud, i);
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
        Self { colour, extras, kept, dropped, warnings: colour_notes(cloud, DatasetKind::Batches) }
    }

    pub(super) fn source(&self) -> ColourSource {
        match self.colour {
            Colour::Rgb { .. } => ColourSource::Rgb,
            Colour::Intensity { .. } => ColourSource::Intensity,
            Colour::None => ColourSource::None,
        }
    }

    /// Range of the integers that grey stands for.
    pub(super) fn intensity_range(&self) -> Option<[u64; 2]> {
        match self.colour {
            Colour::Intensity { ty: AttributeType::UInt8 | AttributeType::UInt16, least, greatest, .. } => {
                Some([least as u64, greatest as u64])
            }
            _ => None,
        }
    }

    /// Appends the colour words of records of one group, levels 0.
    pub(super) fn words(&self, records: &[u8], stride: usize, group: u32, out: &mut Vec<u32>) {
        let records = records.chunks_exact(stride);
        match &self.colour {
            Colour::Rgb { at, widening } => {
                let channels = |r: &[u8]| match r.get(*at..).and_then(|r| r.first_chunk::<6>()) {
                    Some(&[a, b, c, d, e, f]) => [[a, b], [c, d], [e, f]].map(u16::from_le_bytes),
                    None => [0; 3],
                };
                if widening.of(group).is_some() {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Group;

    fn content(colour: Colour) -> Content {
        Content { colour, extras: vec![], kept: vec![], dropped: vec![], warnings: vec![] }
    }

    #[test]
    fn colours_are_taken_by_the_depth_of_their_source() {
        let widening = Widening::new(Some(1), vec![true, false]);
        let c = content(Colour::Rgb { at: 1, widening });
        let record = [9, 200, 0, 1, 0, 255, 0, 9, 0x34, 0x12, 0xff, 0xff, 0x80, 0];
        let mut out = Vec::new();
        c.words(&record, 7, Group::of_source(0).0, &mut out);
        assert_eq!(out[0], colour_word([200, 1, 255], 0));
        out.clear();
        c.words(&record, 7, Group::of_source(1).0, &mut out);
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
        assert_eq!(of(AttributeType::Float32, &f32::NAN.to_le_bytes(), 0.0, 0.0), grey(0), "nothing but NaN");
        assert_eq!(of(AttributeType::Float64, &0.5f64.to_le_bytes(), 0.0, 1.0), grey(128));
        assert_eq!(of(AttributeType::Int16, &(-5i16).to_le_bytes(), -10.0, 0.0), grey(128));
        assert_eq!(of(AttributeType::UInt64, &(1u64 << 40).to_le_bytes(), 0.0, (1u64 << 40) as f64), grey(255));
        let mut out = Vec::new();
        content(Colour::None).words(&[0; 24], 12, 0, &mut out);
        assert_eq!(out, [grey(255); 2]);
    }
}
