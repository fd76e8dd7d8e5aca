//! What is learnt while records that are compressed one after the other are decoded, for each of the chunks that a
//! thread decodes in turn.

use std::array::from_fn;

use super::coder::{Coder, Paused, by_copy};
use super::colour::Rgb;
use super::gps_time::GpsTime;
use super::in_turn::in_turn;
use super::input::Input;
use super::integer::Integer;
use super::items::{Item, ItemKind, record_len};
use super::layers::write;
use super::model::Bytes;
use super::point10::{self, Point10};
use super::version_1;
use super::wave_packet::{self, WavePacket};

/// Chunks that a thread decodes in turn: a symbol waits for the one before, and meanwhile the processor has another
/// chunk to do.
pub(super) const LANES: usize = 2;

/// The decoders of an item in each lane, by the version of the item.
#[derive(Debug)]
enum Versions<A, B> {
    None,
    V1(A),
    V2(B),
}

impl<A, B> Versions<Box<[A; LANES]>, Box<[B; LANES]>> {
    fn new(version: Option<u16>, v1: impl Fn() -> A, v2: impl Fn() -> B) -> Self {
        match version {
            None => Self::None,
            Some(1) => Self::V1(Box::new(from_fn(|_| v1()))),
            Some(_) => Self::V2(Box::new(from_fn(|_| v2()))),
        }
    }

    fn lanes<const L: usize>(&mut self, first: usize) -> Option<Versions<&mut [A; L], &mut [B; L]>> {
        Some(match self {
            Self::None => Versions::None,
            Self::V1(all) => Versions::V1(all.get_mut(first..)?.first_chunk_mut()?),
            Self::V2(all) => Versions::V2(all.get_mut(first..)?.first_chunk_mut()?),
        })
    }
}

type Stored<A, B> = Versions<Box<[A; LANES]>, Box<[B; LANES]>>;
type Used<'m, A, B, const L: usize> = Versions<&'m mut [A; L], &'m mut [B; L]>;

/// Models of all lanes. Made once, used for any number of chunks.
#[derive(Debug)]
pub(in super::super) struct PointwiseModels {
    items: Vec<Item>,
    record_len: usize,
    point: Stored<version_1::Point10, Point10>,
    time: Stored<version_1::GpsTime, GpsTime>,
    colour: Stored<version_1::Rgb, Rgb>,
    last_colours: [[u16; 3]; LANES],
    wave: Stored<WavePacket, WavePacket>,
    extra: Stored<Integer, Vec<Bytes>>,
    last_extra: [Vec<u8>; LANES],
}

impl PointwiseModels {
    /// For records of `items`, which are those of a point format 0–5, in order.
    pub(in super::super) fn new(items: &[Item]) -> Self {
        let version = |kind: ItemKind| items.iter().find(|item| item.kind == kind).map(|item| item.version);
        let extra = items.iter().find(|item| item.kind == ItemKind::Byte).map_or(0, |item| usize::from(item.bytes));
        Self {
            items: items.to_vec(),
            record_len: record_len(items),
            point: Versions::new(version(ItemKind::Point10), version_1::Point10::new, Point10::new),
            time: Versions::new(version(ItemKind::GpsTime11), version_1::GpsTime::new, || GpsTime::new(true)),
            colour: Versions::new(version(ItemKind::Rgb12), version_1::Rgb::new, Rgb::new),
            last_colours: [[0; 3]; LANES],
            wave: Versions::new(version(ItemKind::WavePacket13), WavePacket::new, WavePacket::new),
            extra: Versions::new(version(ItemKind::Byte), || Integer::new(8, extra), || vec![Bytes::new(256); extra]),
            last_extra: from_fn(|_| vec![0; extra]),
        }
    }

    /// Whether these models are for `items`.
    pub(in super::super) fn is_for(&self, items: &[Item]) -> bool {
        self.items == items
    }

    pub(super) fn record_len(&self) -> usize {
        self.record_len
    }

    /// More bytes than any point takes: a value costs at most seven.
    pub(super) fn most_bytes(&self) -> usize {
        256 + 8 * self.record_len
    }

    fn lanes<const L: usize>(&mut self, first: usize) -> Option<Lanes<'_, L>> {
        Some(Lanes {
            record_len: self.record_len,
            point: self.point.lanes(first)?,
            time: self.time.lanes(first)?,
            colour: self.colour.lanes(first)?,
            last_colours: self.last_colours.get_mut(first..)?.first_chunk_mut()?,
            wave: self.wave.lanes(first)?,
            extra: self.extra.lanes(first)?,
            last_extra: self.last_extra.get_mut(first..)?.first_chunk_mut()?,
        })
    }

    /// Starts a chunk behind its first record.
    pub(super) fn start(&mut self, lane: usize, record: &[u8]) {
        if let Some(mut lane) = self.lanes(lane) {
            lane.start(record);
        }
    }

    /// Decodes records from where `paused` stand, in the lanes from `first` on, until one is damaged or none may begin
    /// any more. Returns how many are good in each lane.
    pub(super) fn run<const L: usize>(
        &mut self,
        first: usize,
        paused: [Paused; L],
        inputs: [&Input<'_>; L],
        outs: [&mut [u8]; L],
    ) -> ([usize; L], [Paused; L]) {
        let last_starts = inputs.map(|input| input.last_start(self.most_bytes()));
        let bytes = inputs.map(Input::bytes);
        match self.lanes(first) {
            Some(mut lanes) => lanes.run(paused, bytes, last_starts, outs),
            None => ([0; L], paused),
        }
    }
}

/// Models of the lanes that are decoded in turn.
struct Lanes<'m, const L: usize> {
    record_len: usize,
    point: Used<'m, version_1::Point10, Point10, L>,
    time: Used<'m, version_1::GpsTime, GpsTime, L>,
    colour: Used<'m, version_1::Rgb, Rgb, L>,
    last_colours: &'m mut [[u16; 3]; L],
    wave: Used<'m, WavePacket, WavePacket, L>,
    extra: Used<'m, Integer, Vec<Bytes>, L>,
    last_extra: &'m mut [Vec<u8>; L],
}

impl Lanes<'_, 1> {
    fn start(&mut self, record: &[u8]) {
        let mut rest = record;
        if let Some(item) = take::<{ point10::LEN }>(&mut rest) {
            match &mut self.point {
                Versions::None => {}
                Versions::V1([point]) => point.start(item),
                Versions::V2([point]) => point.start(item),
            }
        }
        let mut time = || take(&mut rest).map_or(0, |item| i64::from_le_bytes(*item));
        match &mut self.time {
            Versions::None => {}
            Versions::V1([model]) => model.start(time()),
            Versions::V2([model]) => model.start(time()),
        }
        match &mut self.colour {
            Versions::None => {}
            Versions::V1([model]) => model.reset(),
            Versions::V2([model]) => model.reset(),
        }
        if !matches!(self.colour, Versions::None)
            && let Some(item) = take::<6>(&mut rest)
        {
            *self.last_colours = [colour(item)];
        }
        if let Versions::V1([wave]) | Versions::V2([wave]) = &mut self.wave
            && let Some(item) = take::<{ wave_packet::LEN }>(&mut rest)
        {
            wave.start(item);
        }
        match &mut self.extra {
            Versions::None => {}
            Versions::V1([model]) => model.reset(),
            Versions::V2([models]) => models.iter_mut().for_each(Bytes::reset),
        }
        for (last, byte) in self.last_extra[0].iter_mut().zip(rest) {
            *last = *byte;
        }
    }
}

impl<const L: usize> Lanes<'_, L> {
    fn run(
        &mut self,
        paused: [Paused; L],
        bytes: [&[u8]; L],
        last_starts: [usize; L],
        mut outs: [&mut [u8]; L],
    ) -> ([usize; L], [Paused; L]) {
        let len = self.record_len;
        let points = outs.iter().map(|out| out.len() / len).min().unwrap_or(0);
        let mut coders: [Coder<'_>; L] = from_fn(|l| paused[l].resume(bytes[l]));
        let mut good = [0; L];
        for point in 0..points {
            if (0..L).any(|l| coders[l].at() > last_starts[l]) {
                break;
            }
            let place = point * len..(point + 1) * len;
            self.next(&mut coders, outs.each_mut().map(|out| &mut out[place.clone()]));
            if coders.iter().any(Coder::is_off) {
                good = from_fn(|l| point + usize::from(!coders[l].is_off()));
                break;
            }
            good = [point + 1; L];
        }
        (good, coders.map(Coder::pause))
    }

    /// A record of each lane.
    #[inline(always)]
    fn next(&mut self, coders: &mut [Coder<'_>; L], records: [&mut [u8]; L]) {
        let mut at = point10::LEN;
        match &mut self.point {
            Versions::None => {}
            Versions::V2(points) => {
                let values = Point10::next_of(points, coders);
                in_turn!(|l| write(records[l], 0, values[l].to_bytes()));
            }
            Versions::V1(points) => {
                in_turn!(|l| write(records[l], 0, by_copy(&mut coders[l], |c| points[l].next(c)).to_bytes()));
            }
        }
        match &mut self.time {
            Versions::None => {}
            Versions::V2(times) => {
                let times = GpsTime::next_of(times, coders);
                in_turn!(|l| write(records[l], at, times[l].to_le_bytes()));
                at += 8;
            }
            Versions::V1(times) => {
                in_turn!(|l| write(records[l], at, by_copy(&mut coders[l], |c| times[l].next(c)).to_le_bytes()));
                at += 8;
            }
        }
        if !matches!(self.colour, Versions::None) {
            let last = &mut *self.last_colours;
            match &mut self.colour {
                Versions::None => {}
                Versions::V2(colours) => *last = Rgb::next_of(colours.each_mut(), coders, *last),
                Versions::V1(colours) => {
                    in_turn!(|l| last[l] = by_copy(&mut coders[l], |c| colours[l].next(c, last[l])));
                }
            }
            in_turn!(|l| write(records[l], at, bytes_of(last[l])));
            at += 6;
        }
        if let Versions::V1(waves) | Versions::V2(waves) = &mut self.wave {
            in_turn!(|l| write(records[l], at, by_copy(&mut coders[l], |c| waves[l].next(c))));
            at += wave_packet::LEN;
        }
        self.extra(coders, records, at);
    }

    #[inline(always)]
    fn extra(&mut self, coders: &mut [Coder<'_>; L], records: [&mut [u8]; L], at: usize) {
        match &mut self.extra {
            Versions::None => {}
            Versions::V2(models) => {
                for i in 0..self.last_extra[0].len() {
                    in_turn!(|l| {
                        let last = &mut self.last_extra[l][i];
                        *last = last.wrapping_add(coders[l].symbol(&mut models[l][i]) as u8);
                        write(records[l], at + i, [*last]);
                    });
                }
            }
            Versions::V1(models) => {
                for i in 0..self.last_extra[0].len() {
                    in_turn!(|l| {
                        let last = &mut self.last_extra[l][i];
                        *last = by_copy(&mut coders[l], |c| models[l].next(c, i32::from(*last), i)) as u8;
                        write(records[l], at + i, [*last]);
                    });
                }
            }
        }
    }
}

fn bytes_of([red, green, blue]: [u16; 3]) -> [u8; 6] {
    let [[r0, r1], [g0, g1], [b0, b1]] = [red, green, blue].map(u16::to_le_bytes);
    [r0, r1, g0, g1, b0, b1]
}

fn colour(item: &[u8; 6]) -> [u16; 3] {
    let [r0, r1, g0, g1, b0, b1] = *item;
    [[r0, r1], [g0, g1], [b0, b1]].map(u16::from_le_bytes)
}

/// The first `N` bytes of `rest`, which then begins behind them.
fn take<'a, const N: usize>(rest: &mut &'a [u8]) -> Option<&'a [u8; N]> {
    let (item, behind) = rest.split_first_chunk()?;
    *rest = behind;
    Some(item)
}
