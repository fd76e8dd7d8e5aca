//! Chunks of layers: point formats 6–10.
//!
//! A chunk begins with a record as it is, the number of its points and the sizes of its layers; then the layers follow,
//! each a field of all other points, with an arithmetic decoder of its own. A layer of no bytes is a field that never
//! changes. Layers are decoded one after the other for a block of points, so that each has the processor to itself.

use super::base::Base;
use super::channels::{Layer, Meta, run};
use super::coder::Coder;
use super::colour::{Nir, Rgb};
use super::gps_time::GpsTime;
use super::item_layers::ItemLayer;
use super::items::{Item, ItemKind, record_len};
use super::layers::{Angle, Class, FieldLayer, Intensity, PointFlags, Source, User, Z};
use super::model::Bytes;
use super::stop::Stop;

/// Points whose layers are decoded one after the other: their records and [`Meta`] stay in the first-level cache.
const BLOCK: usize = 512;

/// Bytes of the count of points, and of the size of a layer.
const COUNT: usize = 4;

/// What a layer holds, in the order of a chunk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) enum Part {
    /// Scanner channel, returns, x and y.
    Base,
    Z,
    Class,
    Flags,
    Intensity,
    Angle,
    User,
    Source,
    Time,
    Rgb,
    Nir,
    WavePacket,
    ExtraBytes,
}

/// A set of parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in super::super) struct Parts(u16);

impl Parts {
    /// Nothing but positions, without which there is no point.
    pub(in super::super) const POSITIONS: Self = Self(1 << Part::Base as u16 | 1 << Part::Z as u16);

    /// This set and `part`.
    pub(in super::super) const fn with(self, part: Part) -> Self {
        Self(self.0 | 1 << part as u16)
    }

    fn has(self, part: Part) -> bool {
        self.0 >> part as u16 & 1 != 0
    }
}

/// The decoder of a part.
#[derive(Debug)]
enum Decoder {
    Base(Base),
    Z(FieldLayer<Z>),
    Class(FieldLayer<Class>),
    Flags(FieldLayer<PointFlags>),
    Intensity(FieldLayer<Intensity>),
    Angle(FieldLayer<Angle>),
    User(FieldLayer<User>),
    Source(FieldLayer<Source>),
    Time(FieldLayer<GpsTime>),
    Rgb(ItemLayer<Rgb>),
    Nir(ItemLayer<Nir>),
    /// Of which nothing is read.
    WavePacket,
    ExtraByte(ItemLayer<Bytes>),
}

impl Decoder {
    fn part(&self) -> Part {
        match self {
            Self::Base(_) => Part::Base,
            Self::Z(_) => Part::Z,
            Self::Class(_) => Part::Class,
            Self::Flags(_) => Part::Flags,
            Self::Intensity(_) => Part::Intensity,
            Self::Angle(_) => Part::Angle,
            Self::User(_) => Part::User,
            Self::Source(_) => Part::Source,
            Self::Time(_) => Part::Time,
            Self::Rgb(_) => Part::Rgb,
            Self::Nir(_) => Part::Nir,
            Self::WavePacket => Part::WavePacket,
            Self::ExtraByte(_) => Part::ExtraBytes,
        }
    }

    fn name(&self) -> &'static str {
        match self.part() {
            Part::Base => "x, y and returns",
            Part::Z => "z",
            Part::Class => "classes",
            Part::Flags => "flags",
            Part::Intensity => "intensity",
            Part::Angle => "scan angles",
            Part::User => "user data",
            Part::Source => "point source ids",
            Part::Time => "GPS times",
            Part::Rgb => "colours",
            Part::Nir => "near infrared",
            Part::WavePacket => "waveforms",
            Part::ExtraBytes => "extra bytes",
        }
    }

    fn start(&mut self, first: &[u8], channel: u8) {
        match self {
            Self::Z(layer) => layer.start(first, channel),
            Self::Class(layer) => layer.start(first, channel),
            Self::Flags(layer) => layer.start(first, channel),
            Self::Intensity(layer) => layer.start(first, channel),
            Self::Angle(layer) => layer.start(first, channel),
            Self::User(layer) => layer.start(first, channel),
            Self::Source(layer) => layer.start(first, channel),
            Self::Time(layer) => layer.start(first, channel),
            Self::Rgb(layer) => layer.start(first, channel),
            Self::Nir(layer) => layer.start(first, channel),
            Self::ExtraByte(layer) => layer.start(first, channel),
            Self::Base(_) | Self::WavePacket => {}
        }
    }

    /// Decodes a block of points; returns how many are good.
    fn run(&mut self, coder: &mut Coder<'_>, points: &mut [Meta], records: &mut [u8], len: usize) -> usize {
        match self {
            Self::Base(layer) => layer.run(coder, points, records, len),
            Self::Z(layer) => run(layer, coder, points, records, len),
            Self::Class(layer) => run(layer, coder, points, records, len),
            Self::Flags(layer) => run(layer, coder, points, records, len),
            Self::Intensity(layer) => run(layer, coder, points, records, len),
            Self::Angle(layer) => run(layer, coder, points, records, len),
            Self::User(layer) => run(layer, coder, points, records, len),
            Self::Source(layer) => run(layer, coder, points, records, len),
            Self::Time(layer) => run(layer, coder, points, records, len),
            Self::Rgb(layer) => run(layer, coder, points, records, len),
            Self::Nir(layer) => run(layer, coder, points, records, len),
            Self::ExtraByte(layer) => run(layer, coder, points, records, len),
            Self::WavePacket => points.len(),
        }
    }
}

/// What is learnt while a chunk is decoded. Made once, used for any number of chunks.
#[derive(Debug)]
pub(in super::super) struct LayeredModels {
    items: Vec<Item>,
    record_len: usize,
    /// A decoder a layer, in the order of a chunk.
    decoders: Vec<Decoder>,
    points: Vec<Meta>,
}

impl LayeredModels {
    /// For records of `items`, which are those of a point format 6–10, in order.
    pub(in super::super) fn new(items: &[Item]) -> Self {
        let (mut decoders, mut at) = (Vec::new(), 0);
        for Item { kind, bytes, version } in items.iter().copied() {
            match kind {
                ItemKind::Point14 => decoders.extend([
                    Decoder::Base(Base::new(version)),
                    Decoder::Z(FieldLayer::new()),
                    Decoder::Class(FieldLayer::new()),
                    Decoder::Flags(FieldLayer::new()),
                    Decoder::Intensity(FieldLayer::new()),
                    Decoder::Angle(FieldLayer::new()),
                    Decoder::User(FieldLayer::new()),
                    Decoder::Source(FieldLayer::new()),
                    Decoder::Time(FieldLayer::new()),
                ]),
                ItemKind::Rgb14 => decoders.push(Decoder::Rgb(ItemLayer::new(at, version))),
                ItemKind::RgbNir14 => decoders
                    .extend([Decoder::Rgb(ItemLayer::new(at, version)), Decoder::Nir(ItemLayer::new(at + 6, version))]),
                ItemKind::WavePacket14 => decoders.push(Decoder::WavePacket),
                ItemKind::Byte14 => {
                    let places = at..at + usize::from(bytes);
                    decoders.extend(places.map(|at| Decoder::ExtraByte(ItemLayer::new(at, version))));
                }
                _ => {}
            }
            at += usize::from(bytes);
        }
        let points = vec![Meta::default(); BLOCK];
        Self { items: items.to_vec(), record_len: record_len(items), decoders, points }
    }

    /// Whether these models are for `items`.
    pub(in super::super) fn is_for(&self, items: &[Item]) -> bool {
        self.items == items
    }
}

/// Decodes consecutive records of one chunk.
pub(in super::super) struct Layered<'m, 'a> {
    models: &'m mut LayeredModels,
    chunk: &'a [u8],
    /// A place for each layer that is decoded, by its number.
    layers: Vec<(usize, LayerPlace<'a>)>,
    is_started: bool,
}

/// Where the decoder of a layer stands.
struct LayerPlace<'a> {
    /// Bytes from the start of the chunk to the layer.
    start: usize,
    coder: Coder<'a>,
}

impl<'m, 'a> Layered<'m, 'a> {
    /// A decoder of the `parts` of a chunk; what else a record has is that of the first one.
    ///
    /// # Errors
    /// Layers that are longer than the chunk, or too short to begin.
    pub(in super::super) fn new(models: &'m mut LayeredModels, chunk: &'a [u8], parts: Parts) -> Result<Self, Stop> {
        let head = models.record_len + COUNT;
        let mut start = head + COUNT * models.decoders.len();
        let sizes = chunk.get(head..start).unwrap_or_default().as_chunks::<COUNT>().0;
        let mut layers = Vec::new();
        for (i, (decoder, size)) in models.decoders.iter().zip(sizes).enumerate() {
            let size = u32::from_le_bytes(*size) as usize;
            let bytes = chunk.get(start..).and_then(|rest| rest.get(..size));
            let Some(bytes) = bytes else {
                let why = format!("the layer of {} has {size} bytes, more than are there", decoder.name());
                return Err(Stop::Corrupt { at: (head + COUNT * i) as u64, why });
            };
            let is_needed = size > 0 || decoder.part() == Part::Base;
            if is_needed && parts.has(decoder.part()) && decoder.part() != Part::WavePacket {
                layers.push((i, LayerPlace { start, coder: Coder::start(bytes, 0) }));
            }
            start += size;
        }
        match layers.first() {
            Some((0, _)) => Ok(Self { models, chunk, layers, is_started: false }),
            _ => Err(Stop::Corrupt { at: 0, why: "its head is not that of a chunk".to_owned() }),
        }
    }

    /// Fills `out` with whole records. Returns how many are good, and why it stopped if that is not all.
    pub(in super::super) fn fill(&mut self, out: &mut [u8]) -> (usize, Result<(), Stop>) {
        let len = self.models.record_len;
        let first = if self.is_started { 0 } else { len.min(out.len()) };
        let (record, rest) = out.split_at_mut(first);
        if first > 0 {
            self.first(record);
        }
        let mut good = first / len;
        for block in rest.chunks_mut(BLOCK * len) {
            let (more, result) = self.block(block);
            good += more;
            if result.is_err() {
                return (good, result);
            }
        }
        (good, Ok(()))
    }

    fn first(&mut self, record: &mut [u8]) {
        self.is_started = true;
        let first = self.first_record();
        record.copy_from_slice(first);
        let mut channel = 0;
        for (i, _) in &self.layers {
            match &mut self.models.decoders[*i] {
                Decoder::Base(base) => channel = base.start(first),
                other => other.start(first, channel),
            }
        }
    }

    fn first_record(&self) -> &'a [u8] {
        &self.chunk[..self.models.record_len]
    }

    /// Decodes at most [`BLOCK`] records.
    fn block(&mut self, records: &mut [u8]) -> (usize, Result<(), Stop>) {
        let first = self.first_record();
        let LayeredModels { record_len, decoders, points, .. } = &mut *self.models;
        let mut good = records.len() / *record_len;
        records.chunks_exact_mut(*record_len).for_each(|record| record.copy_from_slice(first));
        let mut result = Ok(());
        for (i, LayerPlace { start, coder }) in &mut self.layers {
            let decoder = &mut decoders[*i];
            let (points, records) = (&mut points[..good], &mut records[..good * *record_len]);
            good = decoder.run(coder, points, records, *record_len);
            if coder.is_off() {
                let at = *start + coder.at();
                result = Err(match coder.is_broken() {
                    true => Stop::senseless(at as u64),
                    false => Stop::LayerEnds { at, layer: decoder.name() },
                });
            }
        }
        (good, result)
    }
}
