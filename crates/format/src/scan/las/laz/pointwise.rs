//! Records compressed one after the other: point formats 0–5.
//!
//! A chunk begins with a record as it is; all others are symbols of one arithmetic decoder, item after item, point
//! after point.

use super::coder::{Coder, Paused};
use super::colour::Rgb;
use super::gps_time::GpsTime;
use super::input::Input;
use super::integer::Integer;
use super::items::{Item, ItemKind, record_len};
use super::model::Bytes;
use super::point10::{self, Point10};
use super::stop::Stop;
use super::version_1;
use super::wave_packet::{self, WavePacket};

#[derive(Debug)]
enum Point {
    V1(Box<version_1::Point10>),
    V2(Box<Point10>),
}

#[derive(Debug)]
enum Time {
    None,
    V1(Box<version_1::GpsTime>),
    V2(Box<GpsTime>),
}

#[derive(Debug)]
enum Colour {
    None,
    V1(Box<version_1::Rgb>),
    V2(Box<Rgb>),
}

#[derive(Debug)]
enum Extra {
    V1(Box<Integer>),
    V2(Vec<Bytes>),
}

/// What is learnt while the records of a chunk are decoded. Made once, used for any number of chunks.
#[derive(Debug)]
pub(in super::super) struct PointwiseModels {
    items: Vec<Item>,
    record_len: usize,
    point: Point,
    time: Time,
    colour: Colour,
    last_colour: [u16; 3],
    wave: Option<Box<WavePacket>>,
    extra: Extra,
    last_extra: Vec<u8>,
}

impl PointwiseModels {
    /// For records of `items`, which are those of a point format 0–5, in order.
    pub(in super::super) fn new(items: &[Item]) -> Self {
        let version = |kind: ItemKind| items.iter().find(|item| item.kind == kind).map(|item| item.version);
        let extra = items.iter().find(|item| item.kind == ItemKind::Byte).map_or(0, |item| usize::from(item.bytes));
        Self {
            items: items.to_vec(),
            record_len: record_len(items),
            point: match version(ItemKind::Point10) {
                Some(1) => Point::V1(Box::new(version_1::Point10::new())),
                _ => Point::V2(Box::new(Point10::new())),
            },
            time: match version(ItemKind::GpsTime11) {
                None => Time::None,
                Some(1) => Time::V1(Box::new(version_1::GpsTime::new())),
                Some(_) => Time::V2(Box::new(GpsTime::new(true))),
            },
            colour: match version(ItemKind::Rgb12) {
                None => Colour::None,
                Some(1) => Colour::V1(Box::new(version_1::Rgb::new())),
                Some(_) => Colour::V2(Box::new(Rgb::new())),
            },
            last_colour: [0; 3],
            wave: version(ItemKind::WavePacket13).map(|_| Box::new(WavePacket::new())),
            extra: match version(ItemKind::Byte) {
                Some(1) => Extra::V1(Box::new(Integer::new(8, extra))),
                _ => Extra::V2(vec![Bytes::new(256); extra]),
            },
            last_extra: vec![0; extra],
        }
    }

    /// Whether these models are for `items`.
    pub(in super::super) fn is_for(&self, items: &[Item]) -> bool {
        self.items == items
    }

    /// More bytes than any point takes: a value costs at most seven.
    fn most_bytes(&self) -> usize {
        256 + 8 * self.record_len
    }

    /// Starts a chunk behind its first record.
    fn start(&mut self, record: &[u8]) {
        let mut rest = record;
        if let Some(item) = take::<{ point10::LEN }>(&mut rest) {
            match &mut self.point {
                Point::V1(point) => point.start(item),
                Point::V2(point) => point.start(item),
            }
        }
        let mut time = || take(&mut rest).map_or(0, |item| i64::from_le_bytes(*item));
        match &mut self.time {
            Time::None => {}
            Time::V1(model) => model.start(time()),
            Time::V2(model) => model.start(time()),
        }
        match &mut self.colour {
            Colour::None => {}
            Colour::V1(model) => model.reset(),
            Colour::V2(model) => model.reset(),
        }
        if !matches!(self.colour, Colour::None)
            && let Some(item) = take::<6>(&mut rest)
        {
            self.last_colour = colour(item);
        }
        if let Some(wave) = &mut self.wave
            && let Some(item) = take::<{ wave_packet::LEN }>(&mut rest)
        {
            wave.start(item);
        }
        match &mut self.extra {
            Extra::V1(model) => model.reset(),
            Extra::V2(models) => models.iter_mut().for_each(Bytes::reset),
        }
        for (last, byte) in self.last_extra.iter_mut().zip(rest) {
            *last = *byte;
        }
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, record: &mut [u8]) {
        let Some((item, mut rest)) = record.split_first_chunk_mut::<{ point10::LEN }>() else { return };
        match &mut self.point {
            Point::V2(point) => point.next(coder, item),
            Point::V1(point) => point.next(coder, item),
        }
        let time = match &mut self.time {
            Time::None => None,
            Time::V1(model) => Some(model.next(coder)),
            Time::V2(model) => Some(model.next(coder)),
        };
        if let Some(time) = time
            && let Some((item, behind)) = std::mem::take(&mut rest).split_first_chunk_mut()
        {
            (*item, rest) = (time.to_le_bytes(), behind);
        }
        let rgb = match &mut self.colour {
            Colour::None => None,
            Colour::V1(model) => Some(model.next(coder, self.last_colour)),
            Colour::V2(model) => Some(model.next(coder, self.last_colour)),
        };
        if let Some(rgb) = rgb
            && let Some((item, behind)) = std::mem::take(&mut rest).split_first_chunk_mut::<6>()
        {
            self.last_colour = rgb;
            item.copy_from_slice(rgb.map(u16::to_le_bytes).as_flattened());
            rest = behind;
        }
        if let Some(wave) = &mut self.wave
            && let Some((item, behind)) = std::mem::take(&mut rest).split_first_chunk_mut()
        {
            wave.next(coder, item);
            rest = behind;
        }
        self.extra(coder, rest);
    }

    #[inline(always)]
    fn extra(&mut self, coder: &mut Coder<'_>, out: &mut [u8]) {
        let bytes = self.last_extra.iter_mut().zip(out);
        match &mut self.extra {
            Extra::V2(models) => {
                for (model, (last, byte)) in models.iter_mut().zip(bytes) {
                    *last = last.wrapping_add(coder.symbol(model) as u8);
                    *byte = *last;
                }
            }
            Extra::V1(model) => {
                for (i, (last, byte)) in bytes.enumerate() {
                    *last = model.next(coder, i32::from(*last), i) as u8;
                    *byte = *last;
                }
            }
        }
    }

    /// Decodes records from where `paused` stands, until one is damaged or none may begin any more.
    fn run(&mut self, paused: Paused, input: &Input<'_>, out: &mut [u8]) -> (usize, Paused) {
        let last_start = input.last_start(self.most_bytes());
        let mut coder = paused.resume(input.bytes());
        let mut good = 0;
        for record in out.chunks_exact_mut(self.record_len) {
            if coder.at() > last_start {
                break;
            }
            self.next(&mut coder, record);
            if coder.is_off() {
                break;
            }
            good += 1;
        }
        (good, coder.pause())
    }
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

/// Decodes consecutive records of one chunk, or of several that follow one another.
pub(in super::super) struct Pointwise<'m, 'a> {
    models: &'m mut PointwiseModels,
    input: Input<'a>,
    /// Behind the first record of the chunk.
    coder: Option<Paused>,
    /// The next byte, before the chunk has begun.
    at: usize,
}

impl<'m, 'a> Pointwise<'m, 'a> {
    pub(in super::super) fn new(models: &'m mut PointwiseModels, input: Input<'a>) -> Self {
        Self { models, input, coder: None, at: 0 }
    }

    /// Fills `out` with whole records. Returns how many are good, and why it stopped if that is not all.
    pub(in super::super) fn fill(&mut self, out: &mut [u8]) -> (usize, Result<(), Stop>) {
        let len = self.models.record_len;
        let points = out.len() / len;
        let mut good = 0;
        while good < points {
            let rest = &mut out[good * len..];
            let result = match self.coder {
                None => self.first(&mut rest[..len]),
                Some(paused) => self.others(paused, rest),
            };
            match result {
                (more, Ok(())) => good += more,
                (more, Err(stop)) => return (good + more, Err(stop)),
            }
        }
        (good, Ok(()))
    }

    /// The next record begins another chunk.
    pub(in super::super) fn next_chunk(&mut self) {
        if let Some(paused) = self.coder.take() {
            self.at = paused.at;
        }
    }

    /// True if no byte is left.
    pub(in super::super) fn is_at_end(&mut self) -> bool {
        let mut at = self.coder.map_or(self.at, |paused| paused.at);
        let more = self.input.refill(&mut at, 1);
        more.is_ok() && at == self.input.bytes().len()
    }

    fn first(&mut self, record: &mut [u8]) -> (usize, Result<(), Stop>) {
        let behind = record.len() + Coder::START;
        if let Err(stop) = self.input.refill(&mut self.at, behind) {
            return (0, Err(stop));
        }
        let Some(bytes) = self.input.bytes().get(self.at..).and_then(|bytes| bytes.get(..behind)) else {
            return (0, Err(Stop::CutShort));
        };
        record.copy_from_slice(&bytes[..record.len()]);
        self.models.start(record);
        let coder = Coder::start(self.input.bytes(), self.at + record.len());
        self.coder = Some(coder.pause());
        match coder.is_off() {
            true => (0, Err(Stop::senseless(self.input.place(coder.at())))),
            false => (1, Ok(())),
        }
    }

    fn others(&mut self, mut paused: Paused, out: &mut [u8]) -> (usize, Result<(), Stop>) {
        if let Err(stop) = self.input.refill(&mut paused.at, self.models.most_bytes()) {
            return (0, Err(stop));
        }
        let (good, paused) = self.models.run(paused, &self.input, out);
        self.coder = Some(paused);
        let coder = paused.resume(self.input.bytes());
        let result = match (coder.is_off(), coder.is_broken()) {
            (false, _) => Ok(()),
            (true, false) => Err(Stop::CutShort),
            (true, true) => Err(Stop::senseless(self.input.place(coder.at()))),
        };
        (good, result)
    }
}
