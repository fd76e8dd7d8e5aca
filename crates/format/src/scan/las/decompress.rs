//! LAZ points to records: which decoder a file needs, and what is asked of it beside its points.

use std::any::Any;

use super::ahead::{Ahead, Reader, Two};
use super::chunk_table::{Chunk, Layout};
use super::laz::{Input, Item, Layered, LayeredModels, Part, Parts, Pointwise, PointwiseModels, Stop, record_len};
use super::schema::{Layer, Schema};
use crate::Wanted;
use crate::scan::source::Source;

/// The models of a thread, made when they are first needed.
#[derive(Debug, Default)]
pub(super) struct LazModels {
    pointwise: Option<PointwiseModels>,
    layered: Option<LayeredModels>,
    /// The chunk behind the last one.
    pub(super) ahead: Option<Ahead>,
    /// Memory for the records of such a chunk.
    pub(super) spare: Vec<u8>,
}

impl LazModels {
    /// Those of the thread that keeps `kept`.
    pub(super) fn of(kept: &mut Option<Box<dyn Any + Send + Sync>>) -> Option<&mut Self> {
        if !kept.as_ref().is_some_and(|kept| kept.is::<Self>()) {
            *kept = Some(Box::new(Self::default()));
        }
        kept.as_mut()?.downcast_mut()
    }

    /// For records of `items`, compressed one after the other.
    pub(super) fn pointwise(&mut self, items: &[Item]) -> &mut PointwiseModels {
        let fitting = self.pointwise.take().filter(|models| models.is_for(items));
        self.pointwise.insert(fitting.unwrap_or_else(|| PointwiseModels::new(items)))
    }

    /// For layers of `items`.
    pub(super) fn layered(&mut self, items: &[Item]) -> &mut LayeredModels {
        let fitting = self.layered.take().filter(|models| models.is_for(items));
        self.layered.insert(fitting.unwrap_or_else(|| LayeredModels::new(items)))
    }
}

/// Decodes consecutive records.
pub(super) enum Decompressor<'m, 'a> {
    Pointwise(Pointwise<'m, 'a>),
    Layered(Layered<'m, 'a>),
    Two(Two<'m, 'a>),
    Ahead(Reader<'m>),
}

impl Decompressor<'_, '_> {
    /// Fills `out` with whole records. Returns how many are good, and why it stopped if that is not all.
    pub(super) fn fill(&mut self, out: &mut [u8]) -> (usize, Result<(), Stop>) {
        match self {
            Self::Pointwise(decoder) => decoder.fill(out),
            Self::Layered(decoder) => decoder.fill(out),
            Self::Two(decoder) => decoder.fill(out),
            Self::Ahead(reader) => reader.fill(out),
        }
    }

    /// The next record begins another chunk.
    pub(super) fn next_chunk(&mut self) {
        if let Self::Pointwise(decoder) = self {
            decoder.next_chunk();
        }
    }
}

/// An error if the head of a layered chunk is not that of one with at least `points` points in so many bytes.
pub(super) fn check_layered(layout: Layout, chunk: &[u8], points: u64) -> Result<(), Stop> {
    let corrupt = |why: String| Err(Stop::Corrupt { at: layout.record_len as u64, why });
    match layout.layered_head(chunk) {
        Some(head) if head.bytes <= chunk.len() as u64 && head.points >= points => Ok(()),
        Some(Chunk { points, bytes }) => {
            corrupt(format!("it says of itself that it has {points} points in {bytes} bytes"))
        }
        None => corrupt("its head is not that of a chunk".to_owned()),
    }
}

/// Records that are decoded at once where only their number matters.
const COUNTED: u64 = 512;

/// Decodes a chunk of records compressed one after the other, and forgets them; returns how many are good, and whether
/// the last one ends with the bytes.
fn count(source: &Source, items: &[Item], at: u64, chunk: Chunk) -> (u64, bool) {
    let mut models = PointwiseModels::new(items);
    let mut decoder = Pointwise::new(&mut models, Input::of_file(source, at, at + chunk.bytes));
    let record_len = record_len(items);
    let mut records = vec![0; COUNTED.min(chunk.points) as usize * record_len];
    let mut points = 0;
    while points < chunk.points {
        let more = (chunk.points - points).min(COUNTED) as usize;
        let (good, result) = decoder.fill(&mut records[..more * record_len]);
        points += good as u64;
        if result.is_err() {
            return (points, false);
        }
    }
    (points, decoder.is_at_end())
}

/// Counts the points of one chunk of sequential records by decoding it, at most `chunk.points`.
pub(super) fn count_points(source: &Source, items: &[Item], at: u64, chunk: Chunk) -> u64 {
    count(source, items, at, chunk).0
}

/// True if the bytes of one chunk of sequential records hold exactly its points: the last one ends with the bytes.
pub(super) fn is_exactly(source: &Source, items: &[Item], at: u64, chunk: Chunk) -> bool {
    count(source, items, at, chunk) == (chunk.points, true)
}

/// The parts that `wanted` needs. Waveform packets are never among them.
pub(super) fn parts(schema: &Schema, wanted: &Wanted) -> Parts {
    let fields = schema.fields.iter().zip(wanted.flags()).filter(|(_, wanted)| **wanted);
    fields.fold(Parts::POSITIONS, |parts, (field, _)| {
        parts.with(match field.layer {
            Layer::Base => Part::Base,
            Layer::Classification => Part::Class,
            Layer::Flags => Part::Flags,
            Layer::Intensity => Part::Intensity,
            Layer::ScanAngle => Part::Angle,
            Layer::UserData => Part::User,
            Layer::PointSource => Part::Source,
            Layer::GpsTime => Part::Time,
            Layer::Rgb => Part::Rgb,
            Layer::Nir => Part::Nir,
            Layer::ExtraBytes => Part::ExtraBytes,
        })
    })
}
