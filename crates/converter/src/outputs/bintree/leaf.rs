//! From stored records to the records of a leaf: which columns there are, and how they are made.

use std::cmp::Ordering;

use pointmill_format::bintree::{RecordLayout, class_value};
use pointmill_format::{Attribute, AttributeType};

use super::settings::{RGBA, class_of};
use crate::cloud::{Cloud, Facts};
use crate::error::{ConvertError, Unsupported};
use crate::outputs::attributes::{derived, is_derived, left_out, not_required};
use crate::outputs::number::number;
use crate::plan::AttributeChoice;
use crate::report::{DropReason, DroppedAttribute};
use crate::sources::Schema;

/// The columns of a leaf record, and where their bytes come from.
#[derive(Debug)]
pub(super) struct Columns {
    pub(super) record: RecordLayout,
    pub(super) dropped: Vec<DroppedAttribute>,
    class: Option<(usize, AttributeType)>,
    moves: Vec<Move>,
}

/// How an optional column comes from a stored record; `to` counts from the end of the core.
#[derive(Debug, Clone, Copy)]
enum Move {
    Copy {
        from: usize,
        to: usize,
        len: usize,
    },
    /// Three `u16` to four bytes.
    Rgba {
        from: usize,
        to: usize,
    },
}

impl Columns {
    /// The class, and what was requested beside it.
    pub(super) fn choose(cloud: &Cloud<'_>) -> Result<Self, ConvertError> {
        let schema = cloud.schema();
        let class = class_of(schema);
        let (extras, why) = extras(cloud, class);
        let attributes = extras.iter().map(|e| match e {
            Extra::Own(i) => schema.attributes[*i].clone(),
            Extra::Rgba(_) => Attribute::new(RGBA, AttributeType::UInt8, 4),
        });
        let record = RecordLayout::new(attributes).map_err(|what| Unsupported::LeafColumns(what.to_string()))?;
        let moves = extras.iter().zip(record.extras()).map(|(extra, placed)| {
            let to = placed.offset - pointmill_format::bintree::CORE_BYTES;
            match extra {
                Extra::Own(i) => Move::Copy { from: schema.offsets[*i], to, len: schema.attributes[*i].size() },
                Extra::Rgba(i) => Move::Rgba { from: schema.offsets[*i], to },
            }
        });
        let moves = moves.collect();
        let kept = |i: usize| {
            class == Some(i) || extras.iter().any(|e| matches!(e, Extra::Own(k) | Extra::Rgba(k) if *k == i))
        };
        let mut dropped = left_out(schema, &cloud.intake.unread, kept, &why);
        if cloud.plan.attributes == AttributeChoice::Scene {
            name_reasons(schema, &cloud.facts, &mut dropped);
        }
        let class = class.map(|i| (schema.offsets[i], schema.attributes[i].ty));
        Ok(Self { record, dropped, class, moves })
    }

    /// Names of what is kept, for the report.
    pub(super) fn names(&self) -> Vec<String> {
        let class = self.class.is_some().then(|| "classification".to_owned());
        let extras = self.record.extras().iter().map(|e| e.attribute.name.clone());
        std::iter::once("position".to_owned()).chain(class).chain(extras).collect()
    }

    /// The raw class of a stored record.
    #[inline]
    pub(super) fn class(&self, record: &[u8]) -> f64 {
        match self.class {
            None => 0.0,
            Some((at, AttributeType::UInt8)) => f64::from(record[at]),
            Some((at, ty)) => number(&record[at..], ty),
        }
    }

    /// Fills the optional columns of a record: `rest` is what follows the core.
    #[inline]
    pub(super) fn fill(&self, record: &[u8], rest: &mut [u8]) {
        for step in &self.moves {
            match *step {
                Move::Copy { from, to, len } => rest[to..to + len].copy_from_slice(&record[from..from + len]),
                Move::Rgba { from, to } => {
                    for (byte, v) in rest[to..to + 3].iter_mut().zip(record[from..from + 6].as_chunks::<2>().0) {
                        *byte = eight_bit(*v);
                    }
                    rest[to + 3] = 255;
                }
            }
        }
    }

    /// Compares the bytes that two stored records have in the output from the class on, by which points of one place are
    /// put in order.
    pub(super) fn compare(&self, a: &[u8], b: &[u8]) -> Ordering {
        let class = |record| class_value(self.class(record)).to_le_bytes();
        let rgba = |record: &[u8], from: usize| {
            let mut bytes = [0; 3];
            let channels = record[from..from + 6].as_chunks::<2>().0;
            bytes.iter_mut().zip(channels).for_each(|(byte, v)| *byte = eight_bit(*v));
            bytes
        };
        let columns = self.moves.iter().map(|step| match *step {
            Move::Copy { from, len, .. } => a[from..from + len].cmp(&b[from..from + len]),
            Move::Rgba { from, .. } => rgba(a, from).cmp(&rgba(b, from)),
        });
        columns.fold(class(a).cmp(&class(b)), Ordering::then)
    }
}

/// A channel of 16 bits in 8, to the nearest.
fn eight_bit(v: [u8; 2]) -> u8 {
    ((u32::from(u16::from_le_bytes(v)) * 255 + 32767) / 65535) as u8
}

enum Extra {
    Own(usize),
    Rgba(usize),
}

/// Optional columns, and why others are omitted.
fn extras(cloud: &Cloud<'_>, class: Option<usize>) -> (Vec<Extra>, DropReason) {
    let (schema, derive) = (cloud.schema(), &cloud.plan.derive);
    let others = (0..schema.attributes.len()).filter(|i| Some(*i) != class);
    let computed = || derived(derive, schema).map(Extra::Own);
    match &cloud.plan.attributes {
        AttributeChoice::Usual => (computed().collect(), DropReason::NotUsual),
        AttributeChoice::All => (others.map(Extra::Own).collect(), DropReason::NotUsual),
        AttributeChoice::Scene => {
            let facts = &cloud.facts;
            let is_required = |i: &usize| {
                is_derived(derive, schema, *i) || not_required(schema, &facts.ranges, &facts.relations, *i).is_none()
            };
            (others.filter(is_required).map(Extra::Own).collect(), DropReason::NotUsual)
        }
        AttributeChoice::List(names) => {
            let mut extras = named(schema, names, class);
            let is_new =
                |extra: &Extra| !extras.iter().any(|e| matches!((e, extra), (Extra::Own(a), Extra::Own(b)) if a == b));
            let more: Vec<Extra> = computed().filter(is_new).collect();
            extras.extend(more);
            (extras, DropReason::NotRequested)
        }
    }
}

fn named(schema: &Schema, names: &[String], class: Option<usize>) -> Vec<Extra> {
    let mut extras: Vec<Extra> = Vec::new();
    let mut seen: Vec<&str> = Vec::new();
    for name in names.iter().filter(|n| *n != "position") {
        if seen.contains(&name.as_str()) {
            continue;
        }
        seen.push(name);
        match (schema.find(name), schema.rgb()) {
            (Some(i), _) if Some(i) != class => extras.push(Extra::Own(i)),
            (None, Some(rgb)) if name == RGBA => extras.push(Extra::Rgba(rgb)),
            _ => {}
        }
    }
    extras
}

/// Where attributes that the scene does not require are omitted, says why each is.
fn name_reasons(schema: &Schema, facts: &Facts, dropped: &mut [DroppedAttribute]) {
    for d in dropped {
        let why = schema.find(&d.name).and_then(|i| not_required(schema, &facts.ranges, &facts.relations, i));
        if let Some(why) = why {
            d.why = why;
        }
    }
}
