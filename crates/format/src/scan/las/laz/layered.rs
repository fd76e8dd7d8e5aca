//! Chunks of layers: point formats 6–10.
//!
//! A chunk begins with a record as it is, the number of its points and the sizes of its layers; then the layers follow,
//! each a field of all other points, with an arithmetic decoder of its own. A layer of no bytes is a field that never
//! changes. Layers are decoded one after the other for a block of points, so that each has the processor to itself.

use std::array::from_fn;

use super::base::Base;
use super::channels::{Layer, Meta, run};
use super::coder::Coder;
use super::colour::{Nir, Rgb};
use super::gps_time::GpsTime;
use super::item_layers::ItemLayer;
use super::items::{Item, ItemKind, record_len};
use super::lanes::LANES;
use super::layers::{Angle, Class, FieldLayer, Intensity, PointFlags, Source, User, Z};
use super::model::Bytes;

/// Points whose layers are decoded one after the other: their records and [`Meta`], those of two chunks, stay in the
/// first-level cache.
pub(super) const BLOCK: usize = 256;

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

    pub(super) fn has(self, part: Part) -> bool {
        self.0 >> part as u16 & 1 != 0
    }
}

/// The decoder of a part.
#[derive(Debug)]
pub(super) enum Decoder {
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
    pub(super) fn part(&self) -> Part {
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

    pub(super) fn name(&self) -> &'static str {
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

    /// Starts a chunk behind its first record. The base, which comes first, says its channel.
    pub(super) fn start(&mut self, first: &[u8], channel: &mut u8) {
        macro_rules! start {
            ($($kind:ident)*) => {
                match self {
                    Self::Base(layer) => *channel = layer.start(first),
                    $(Self::$kind(layer) => layer.start(first, *channel),)*
                    Self::WavePacket => {}
                }
            };
        }
        start!(Z Class Flags Intensity Angle User Source Time Rgb Nir ExtraByte);
    }

    /// Decodes a block of points; returns how many are good.
    pub(super) fn run(&mut self, coder: &mut Coder<'_>, points: &mut [Meta], records: &mut [u8], len: usize) -> usize {
        macro_rules! run {
            ($($kind:ident)*) => {
                match self {
                    Self::Base(layer) => Base::run([layer], [coder], [points], [records], len),
                    $(Self::$kind(layer) => run([layer], [coder], [points], [records], len),)*
                    Self::WavePacket => [points.len()],
                }
            };
        }
        let [good] = run!(Z Class Flags Intensity Angle User Source Time Rgb Nir ExtraByte);
        good
    }

    /// Decodes blocks of as many points of two chunks, in turn; `None`: these are different parts.
    pub(super) fn run_two(
        decoders: [&mut Self; LANES],
        coders: [&mut Coder<'_>; LANES],
        points: [&mut [Meta]; LANES],
        records: [&mut [u8]; LANES],
        len: usize,
    ) -> Option<[usize; LANES]> {
        macro_rules! run {
            ($($kind:ident)*) => {
                match decoders {
                    [Self::Base(a), Self::Base(b)] => Base::run([a, b], coders, points, records, len),
                    $([Self::$kind(a), Self::$kind(b)] => run([a, b], coders, points.map(|p| &*p), records, len),)*
                    _ => return None,
                }
            };
        }
        Some(run!(Z Class Flags Intensity Angle User Source Time Rgb Nir ExtraByte))
    }
}

/// What is learnt while a chunk is decoded, for each of the chunks that a thread decodes in turn. Made once, used for any
/// number of chunks.
#[derive(Debug)]
pub(in super::super) struct LayeredModels {
    items: Vec<Item>,
    pub(super) record_len: usize,
    pub(super) lanes: [Lane; LANES],
}

#[derive(Debug)]
pub(super) struct Lane {
    /// A decoder a layer, in the order of a chunk.
    pub(super) decoders: Vec<Decoder>,
    pub(super) points: Vec<Meta>,
}

impl LayeredModels {
    /// For records of `items`, which are those of a point format 6–10, in order.
    pub(in super::super) fn new(items: &[Item]) -> Self {
        Self { items: items.to_vec(), record_len: record_len(items), lanes: from_fn(|_| Lane::new(items)) }
    }

    /// Whether these models are for `items`.
    pub(in super::super) fn is_for(&self, items: &[Item]) -> bool {
        self.items == items
    }
}

impl Lane {
    fn new(items: &[Item]) -> Self {
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
        Self { decoders, points: vec![Meta::default(); BLOCK] }
    }
}
