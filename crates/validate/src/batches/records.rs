//! Points of batches as the comparison with the sources wants them.

use pointmill_format::{Attribute, AttributeType, ReadError};
use rayon::prelude::*;

use super::batch::{Points, Raw};
use super::blocks::{Cache, Reported};
use super::description::{Colour, Description};
use super::examine::{axes, points_of};
use super::header::Header;
use super::task::{Task, slot_of};
use crate::against::block::{BLOCK_POINTS, Block};
use crate::against::rules::{Channels, Conversion};
use crate::against::{self, Rules, Sink};
use crate::finding::Findings;
use crate::place::Place;

/// What is compared: extra attributes, then what colours come from, if they are known.
pub(crate) fn rules(header: &Header, description: &Description) -> Rules {
    let mut attributes: Vec<Attribute> = description.attributes.iter().map(|e| e.attribute.clone()).collect();
    let known = !header.averaged() || header.originals();
    let colour = match description.colour {
        Colour::Rgb => Some((Attribute::new("rgb", AttributeType::UInt16, 3), Conversion::AsStored)),
        Colour::Intensity => description
            .intensity_range
            .map(|range| (Attribute::new("intensity", AttributeType::UInt16, 1), Conversion::Grey(range))),
        Colour::None => None,
    };
    let colour = colour.filter(|_| known);
    attributes.extend(colour.iter().map(|(attribute, _)| attribute.clone()));
    let mut rules = Rules::new(attributes, description.lattice, &description.json);
    rules.channels = Channels::Rounded;
    // not an extra attribute of that name
    rules.rgb = colour.as_ref().filter(|(a, _)| a.elements == 3).map(|_| rules.attributes.len() - 1);
    if let (Some((_, conversion)), Some(last)) = (colour, rules.conversions.last_mut()) {
        *last = conversion;
    }
    rules
}

/// All batches of a file, to be read again.
pub(crate) struct Records<'a> {
    pub(crate) task: &'a Task<'a>,
}

impl against::Records for Records<'_> {
    fn each_block(&self, rules: &Rules, work: &(dyn Fn(&mut Block, Place) + Sync)) -> Result<(), ReadError> {
        let task = self.task;
        let (batches, window) = (task.header.batches, task.window);
        let silent = Findings::new(task.findings.format(), 0); // the walk has reported broken blocks
        let reported = Reported::new(&silent);
        let mut cache = Cache::default();
        for first in (0..batches).step_by(window as usize) {
            let slots: Vec<(u64, u64)> =
                (first..(first + window).min(batches)).map(|m| (m, slot_of(task.header, m))).collect();
            let numbers: Vec<u64> = slots.iter().map(|s| s.1).collect();
            cache.prepare(task.bytes, task.header, task.columns, &numbers, &reported)?;
            slots.par_iter().try_for_each_init(Block::default, |block, &(number, slot)| {
                let Some(raw) = Raw::read(task, &cache, number, slot)? else { return Ok(()) };
                let points = points_of(task, &raw, &axes(task, &raw));
                let colours = original_colours(&raw);
                let place = Place::Batch(number as u32);
                fill(&raw, &points, &colours, rules, block, &mut |block| work(block, place));
                Ok::<_, ReadError>(())
            })?;
        }
        Ok(())
    }
}

/// Colours before averaging, as far as there are originals.
fn original_colours(raw: &Raw) -> Vec<u32> {
    let mut colours = raw.colours.clone();
    for entry in raw.originals.iter().flatten() {
        if let Some(colour) = colours.get_mut((u64::from(entry.index) - raw.index(0)) as usize) {
            *colour = entry.word;
        }
    }
    colours
}

/// Hands over a batch's records in blocks. `colours`: before averaging.
pub(crate) fn fill(raw: &Raw, points: &Points, colours: &[u32], rules: &Rules, block: &mut Block, sink: &mut Sink<'_>) {
    for start in (0..raw.len()).step_by(BLOCK_POINTS) {
        let range = start..(start + BLOCK_POINTS).min(raw.len());
        block.reset(rules.attributes.len());
        block.keep.resize(range.len(), true);
        for (to, from) in block.positions.iter_mut().zip(&points.x) {
            match rules.compare_positions {
                true => to.extend(&from[range.clone()]),
                false => to.resize(range.len(), 0),
            }
        }
        for (i, attribute) in rules.attributes.iter().enumerate() {
            let words = &mut block.words[i];
            match (raw.extras.get(i), rules.conversions[i]) {
                (Some(bytes), _) => append(bytes, attribute, range.clone(), words),
                (None, Conversion::Grey(_)) => words.extend(colours[range.clone()].iter().map(|w| grey_of(*w))),
                (None, _) => {
                    let channels = |w: &u32| [0, 8, 16].map(|shift| u64::from(w >> shift & 255));
                    words.extend(colours[range.clone()].iter().flat_map(channels));
                }
            }
        }
        sink(block);
    }
}

/// The grey of a colour; a colour that is not grey differs from every grey.
fn grey_of(word: u32) -> u64 {
    let grey = word & 255;
    if word & 0xff_ffff == grey * 0x01_0101 { u64::from(grey) } else { u64::from(word & 0xff_ffff) + 256 }
}

/// The bits of raw values.
fn append(bytes: &[u8], attribute: &Attribute, points: std::ops::Range<usize>, out: &mut Vec<u64>) {
    let size = attribute.size();
    let values = bytes.get(points.start * size..points.end * size).unwrap_or_default();
    let word = |value: &[u8]| value.iter().rev().fold(0u64, |w, b| w << 8 | u64::from(*b));
    out.extend(values.chunks_exact(attribute.ty.size()).map(word));
}
