//! Quantised batches: words as they are stored, of the levels that are requested.

use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use pointmill_format::batches::{
    BatchRecord, BlockScratch, ColourSource, Decoder, Flags, Part, Precision, lod_of, rgb_of,
};
use pointmill_format::{Aabb, Attribute, AttributeType, ReadError};
use serde_json::{Value, json};

use super::batch_file::BatchFile;
use super::ranges::{Attributes, Range};
use super::request::BatchesRequest;
use super::scene::{Scene, keys};
use crate::encode::{self, BoxRow, Flag, UNIT_HEADER_BYTES, UnitHeader};
use crate::refusal::Refusal;
use crate::values::{Number, point_json, scaled};

/// Points whose levels are counted, at most; of larger files some batches stand for those behind them.
const COUNTED_POINTS: u64 = 64 << 20;

/// Batches whose values are looked at for ranges, evenly spread, where the file gives none.
const SAMPLED_BATCHES: usize = 8;

/// Planes in the order of their significance.
const PLANES: [Part; 3] = [Part::Hi10, Part::Mid10, Part::Lo10];

/// A file of batches that is open.
#[derive(Debug)]
pub(super) struct Batches {
    file: BatchFile,
    /// With the ranges that the file gives.
    said: Attributes,
    /// With ranges of a sample where the file gives none; read when they are needed first.
    attributes: OnceLock<Attributes>,
    /// Of each slot: points of level 0, of at most 1, 2, 3. Counted when they are requested first.
    levels: Mutex<Option<Arc<Vec<[u16; 4]>>>>,
}

/// Memory that is used again from slot to slot.
#[derive(Default)]
struct Scratch {
    blocks: [BlockScratch; 5],
    bytes: Vec<u8>,
    selected: Vec<u16>,
}

impl Batches {
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let file = BatchFile::open(path)?;
        let known = file.attributes.iter().map(|(attribute, entry)| {
            let range = Range::of_raw(attribute, &entry.min, &entry.max);
            (attribute.clone(), range)
        });
        let said = Attributes::new(known);
        Ok(Self { file, said, attributes: OnceLock::new(), levels: Mutex::default() })
    }

    fn attributes(&self) -> &Attributes {
        self.attributes.get_or_init(|| {
            let (mut attributes, mut scratch) = (self.said.clone(), Scratch::default());
            let (count, slots) = (self.file.records.len().min(SAMPLED_BATCHES), self.file.header.batches as usize);
            for (slot, (place, (attribute, _))) in
                (0..count).flat_map(|i| self.file.attributes.iter().enumerate().map(move |a| (i * slots / count, a)))
            {
                let Scratch { blocks, bytes, .. } = &mut scratch;
                // a batch that cannot be read is an error of the request for its points
                if self.file.read(Part::Attribute(place), slot as u32, &mut blocks[4], bytes).is_ok() {
                    let values = bytes.chunks_exact(attribute.ty.size());
                    let numbers = values.filter_map(|bytes| Number::of_bytes(attribute.ty, bytes));
                    attributes.sample_values(place, numbers.map(Number::as_f64));
                }
            }
            attributes
        })
    }

    pub(super) fn scene(&self) -> Scene {
        let BatchFile { header, colour, .. } = &self.file;
        let empty = header.points == 0;
        Scene {
            kind: "batches",
            format: "quantised batches".to_owned(),
            name: self.file.name.clone(),
            points: Some(header.points),
            bounds: if empty { Aabb::EMPTY } else { header.tight },
            projection: self.file.projection.clone(),
            attributes: self.attributes().clone(),
            has_colour: *colour != ColourSource::None,
            own: keys([
                ("colourSource", colour.name().into()),
                ("batches", header.batches.into()),
                ("cell", header.grid.cell.into()),
                ("planes", header.precision().planes().into()),
                ("lods", header.flags.has(Flags::LOD).into()),
            ]),
        }
    }

    /// All slots with their boxes.
    pub(super) fn nodes(&self) -> Result<Vec<u8>, Refusal> {
        let levels = self.levels()?;
        let rows = (0..).zip(&self.file.records).zip(levels.iter()).map(|((unit, record), by_level)| BoxRow {
            bounds: self.bounds(record),
            points: record.points,
            unit,
            by_level: *by_level,
        });
        Ok(encode::boxes(rows.collect::<Vec<_>>().into_iter()))
    }

    /// World coordinates.
    fn bounds(&self, record: &BatchRecord) -> Aabb {
        let origin = self.file.header.grid.origin;
        let world = |corner: [f32; 3]| std::array::from_fn(|a| origin[a] + f64::from(corner[a]));
        Aabb { min: world(record.min), max: world(record.max) }
    }

    fn levels(&self) -> Result<Arc<Vec<[u16; 4]>>, Refusal> {
        let mut kept = self.levels.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(levels) = &*kept {
            return Ok(Arc::clone(levels));
        }
        let counted = Arc::new(self.count_levels()?);
        *kept = Some(Arc::clone(&counted));
        Ok(counted)
    }

    fn count_levels(&self) -> Result<Vec<[u16; 4]>, Refusal> {
        let step = self.file.header.points.div_ceil(COUNTED_POINTS).max(1);
        let (mut scratch, mut levels, mut last) = (Scratch::default(), Vec::new(), ([0u16; 4], 0u32));
        for (slot, record) in (0u32..).zip(&self.file.records) {
            if u64::from(slot).is_multiple_of(step) {
                self.file.read(Part::Colour, slot, &mut scratch.blocks[3], &mut scratch.bytes)?;
                let mut exact = [0u16; 4];
                for word in words(&scratch.bytes) {
                    let from = usize::from(lod_of(word)).min(3);
                    exact.iter_mut().skip(from).for_each(|count| *count += 1); // a batch has at most 10,240
                }
                last = (exact, record.points);
            }
            let (counts, of) = last;
            let share = |count: u16| (u64::from(count) * u64::from(record.points) / u64::from(of.max(1))) as u16;
            levels.push(counts.map(share));
        }
        Ok(levels)
    }

    /// The most bytes of the answer.
    pub(super) fn cost(&self, request: &BatchesRequest) -> Result<u64, Refusal> {
        if let Some(name) = &request.attribute {
            self.attributes().find(name)?;
        }
        let point_bytes = 4 * (self.planes(request).len() as u64 + 2) + 2;
        request.units.iter().try_fold(0u64, |sum, slot| {
            let record = self.record(*slot)?;
            Ok(sum + UNIT_HEADER_BYTES as u64 + 16 + u64::from(record.points) * point_bytes)
        })
    }

    pub(super) fn words(&self, request: &BatchesRequest) -> Result<Vec<u8>, Refusal> {
        let (mut scratch, mut out) = (Scratch::default(), Vec::new());
        for slot in &request.units {
            self.batch(*slot, request, &mut scratch, &mut out)?;
        }
        Ok(out)
    }

    /// Puts header and body of a batch at the end of `out`.
    fn batch(
        &self,
        slot: u32,
        request: &BatchesRequest,
        scratch: &mut Scratch,
        out: &mut Vec<u8>,
    ) -> Result<(), Refusal> {
        let record = self.record(slot)?;
        let Scratch { blocks, bytes, selected } = scratch;
        let mut colours = Vec::new();
        self.file.read(Part::Colour, slot, &mut blocks[3], &mut colours)?;
        selected.clear();
        let [from, to] = request.levels;
        selected
            .extend((0u16..).zip(words(&colours)).filter(|(_, w)| (from..=to).contains(&lod_of(*w))).map(|(i, _)| i));
        let attribute = request.attribute.as_deref().map(|name| self.attributes().find(name)).transpose()?;
        let planes = self.planes(request);
        let header = UnitHeader {
            count: selected.len() as u32,
            flags: planes.len() as u32 | if attribute.is_some() { Flag::ATTRIBUTE } else { 0 },
            origin: self.bounds(&record).min,
            step: record.sides(),
            total: record.points,
        };
        let at = header.begin(out);
        let take = |bytes: &[u8], out: &mut Vec<u8>| {
            for index in selected.iter() {
                out.extend_from_slice(
                    bytes.get(usize::from(*index) * 4..).and_then(|b| b.first_chunk::<4>()).unwrap_or(&[0; 4]),
                );
            }
        };
        for (plane, block) in planes.iter().zip(&mut blocks[..3]) {
            self.file.read(*plane, slot, block, bytes)?;
            take(bytes, out);
        }
        take(&colours, out);
        selected.iter().for_each(|index| out.extend_from_slice(&index.to_le_bytes()));
        out.resize(out.len().next_multiple_of(4), 0);
        if let Some((place, least)) = attribute {
            self.file.read(Part::Attribute(place), slot, &mut blocks[4], bytes)?;
            let described = &self.file.attributes[place].0;
            for index in selected.iter() {
                let stored = bytes.get(usize::from(*index) * described.size()..).unwrap_or(&[]);
                let value = Number::of_bytes(described.ty, stored).map_or(0.0, Number::as_f64);
                out.extend_from_slice(&((scaled(described, 0, value) - least) as f32).to_le_bytes());
            }
        }
        UnitHeader::end(at, out);
        Ok(())
    }

    /// Those that are requested and in the file.
    fn planes(&self, request: &BatchesRequest) -> &'static [Part] {
        let there = self.file.header.precision().planes() as usize;
        PLANES.get(..request.planes.min(there)).unwrap_or(&PLANES)
    }

    fn record(&self, slot: u32) -> Result<BatchRecord, Refusal> {
        let batches = self.file.header.batches;
        let absent = || Refusal::absent(format!("there is no batch {slot}: there are {batches}"));
        self.file.records.get(slot as usize).copied().ok_or_else(absent)
    }

    /// Position by all planes, colour, level and the other attributes of a point.
    pub(super) fn point(&self, unit: &str, index: u64) -> Result<Value, Refusal> {
        let shown: String = unit.chars().take(40).collect();
        let slot: u32 = unit.parse().map_err(|_| Refusal::bad(format!("\"{shown}\" is no number of a batch")))?;
        let record = self.record(slot)?;
        let place = usize::try_from(index)
            .ok()
            .filter(|i| *i < record.points as usize)
            .ok_or_else(|| Refusal::absent(format!("batch {slot} has {} points, no point {index}", record.points)))?;
        let mut scratch = Scratch::default();
        let mut stored = |part: Part, size: usize| -> Result<Vec<u8>, Refusal> {
            self.file.read(part, slot, &mut scratch.blocks[0], &mut scratch.bytes)?;
            Ok(scratch.bytes.get(place * size..(place + 1) * size).unwrap_or(&[]).to_vec())
        };
        let mut plane = [0; 3];
        let precision = self.file.header.precision();
        for (word, part) in plane.iter_mut().zip(PLANES).take(precision.planes() as usize) {
            *word = words(&stored(part, 4)?).next().unwrap_or(0);
        }
        let word = words(&stored(Part::Colour, 4)?).next().unwrap_or(0);
        let mut attributes = self.colour_json(word);
        for (i, (attribute, _)) in self.file.attributes.iter().enumerate() {
            let bytes = stored(Part::Attribute(i), attribute.size())?;
            let number = |element| Number::of_bytes(attribute.ty, bytes.get(element * attribute.ty.size()..)?);
            attributes.push(point_json(attribute, number));
        }
        Ok(json!({ "position": self.position(&record, precision, plane), "attributes": attributes }))
    }

    fn position(&self, record: &BatchRecord, precision: Precision, [hi, mid, lo]: [u32; 3]) -> [f64; 3] {
        let decoder: Decoder = record.decoder(precision);
        let (relative, origin) = (decoder.position_of_words(hi, mid, lo), self.file.header.grid.origin);
        std::array::from_fn(|a| origin[a] + relative[a])
    }

    fn colour_json(&self, word: u32) -> Vec<Value> {
        let level = Attribute::new("level of detail", AttributeType::UInt8, 1);
        let colour = Attribute::new("rgb", AttributeType::UInt8, 3);
        let mut attributes = Vec::new();
        if self.file.colour != ColourSource::None {
            attributes.push(point_json(&colour, |e| rgb_of(word).get(e).map(|c| Number::from(*c))));
        }
        if self.file.header.flags.has(Flags::LOD) {
            attributes.push(point_json(&level, |_| Some(Number::from(lod_of(word)))));
        }
        attributes
    }
}

fn words(bytes: &[u8]) -> impl Iterator<Item = u32> + '_ {
    bytes.as_chunks::<4>().0.iter().map(|b| u32::from_le_bytes(*b))
}
