//! The layer of formats 6–10 that all others depend on: scanner channel, returns, x and y.

use super::channels::{Channels, Meta, State};
use super::coder::{Coder, by_copy};
use super::family::TinyFamily;
use super::in_turn::in_turn;
use super::integer::Integer;
use super::median::Median;
use super::model::{Changes, Tiny};
use super::returns::{context_16, level};

/// Bits of the symbol that says what differs from the last point of the channel.
const CHANNEL: usize = 1 << 6;
const SOURCE: usize = 1 << 5;
const TIME: usize = 1 << 4;
const ANGLE: usize = 1 << 3;
const RETURNS: usize = 1 << 2;
/// The number of the return: the same, one more, one less, another.
const NUMBER: usize = 3;

/// Where the fields are in a record.
pub(super) const RETURNS_AT: usize = 14;
pub(super) const FLAGS_AT: usize = 15;
/// The scanner channel among the flags.
pub(super) const CHANNEL_BITS: u8 = 0b0011_0000;

#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Values {
    x: i32,
    y: i32,
    returns: u8,
    number: u8,
    new_time: bool,
}

#[derive(Debug)]
struct Channel {
    last: Values,
    changes: [Changes; 8],
    channels: Tiny,
    /// Numbers of returns, and of the return, by the last one.
    returns: TinyFamily,
    numbers: TinyFamily,
    numbers_of_pulse: Tiny,
    dx: Integer,
    dy: Integer,
    medians: [[Median; 2]; 12],
}

impl State for Channel {
    type Value = Values;

    fn new() -> Self {
        Self {
            last: Values::default(),
            changes: std::array::from_fn(|_| Changes::new(128)),
            channels: Tiny::new(3),
            returns: TinyFamily::new(16),
            numbers: TinyFamily::new(16),
            numbers_of_pulse: Tiny::new(13),
            dx: Integer::new(32, 2),
            dy: Integer::new(32, 22),
            medians: [[Median::new(); 2]; 12],
        }
    }

    fn start(&mut self, last: Values) {
        self.last = Values { new_time: false, ..last };
        self.changes.iter_mut().for_each(Changes::reset);
        self.channels.reset();
        self.returns.reset();
        self.numbers.reset();
        self.numbers_of_pulse.reset();
        self.dx.reset();
        self.dy.reset();
        self.medians = [[Median::new(); 2]; 12];
    }

    fn last(&self) -> Values {
        self.last
    }
}

impl Channel {
    /// What differs from the last point of the channel.
    #[inline(always)]
    fn changes(&mut self, coder: &mut Coder<'_>) -> usize {
        let Values { returns, number, new_time, .. } = self.last;
        let context = usize::from(number == 1) | usize::from(number >= returns) << 1 | usize::from(new_time) << 2;
        coder.symbol(&mut self.changes[context])
    }

    #[inline(always)]
    fn returns(&mut self, coder: &mut Coder<'_>, changes: usize) {
        let Values { returns, number, new_time, .. } = &mut self.last;
        *new_time = changes & TIME != 0;
        if changes & RETURNS != 0 {
            *returns = by_copy(coder, |coder| coder.symbol(self.returns.of(*returns))) as u8;
        }
        *number = match changes & NUMBER {
            0 => *number,
            1 => (*number + 1) & 15,
            2 => (*number + 15) & 15,
            _ if *new_time => by_copy(coder, |coder| coder.symbol(self.numbers.of(*number))) as u8,
            _ => (*number + 2 + by_copy(coder, |coder| coder.symbol(&mut self.numbers_of_pulse)) as u8) & 15,
        };
    }

    /// Whether the pulse has one return, and which medians predict x and y.
    #[inline(always)]
    fn contexts(&self) -> (usize, usize) {
        let Values { returns, number, new_time, .. } = self.last;
        (usize::from(returns == 1), context_16(returns, number) << 1 | usize::from(new_time))
    }

    /// Decodes x and y of several points, in turn; returns the contexts of the heights.
    #[inline(always)]
    fn positions<const L: usize>(states: [&mut Self; L], coders: &mut [Coder<'_>; L]) -> [usize; L] {
        let (mut singles, mut medians, mut predicted) = ([0; L], [0; L], [0; L]);
        in_turn!(|l| (singles[l], medians[l]) = states[l].contexts());
        in_turn!(|l| predicted[l] = states[l].medians[medians[l]][0].get());
        let mut states = states;
        let by = Integer::next_of(states.each_mut().map(|state| &mut state.dx), coders, predicted, singles);
        in_turn!(|l| {
            states[l].last.x = states[l].last.x.wrapping_add(by[l]);
            states[l].medians[medians[l]][0].add(by[l]);
        });

        let mut contexts = [0; L];
        in_turn!(|l| predicted[l] = states[l].medians[medians[l]][1].get());
        in_turn!(|l| contexts[l] = singles[l] + (states[l].dx.last_bits() & !1).min(20));
        let by = Integer::next_of(states.each_mut().map(|state| &mut state.dy), coders, predicted, contexts);
        in_turn!(|l| {
            states[l].last.y = states[l].last.y.wrapping_add(by[l]);
            states[l].medians[medians[l]][1].add(by[l]);
        });
        in_turn!(|l| {
            let bits = (states[l].dx.last_bits() + states[l].dy.last_bits()) / 2;
            contexts[l] = singles[l] + (bits & !1).min(18);
        });
        contexts
    }
}

/// Decoder of the layer.
#[derive(Debug)]
pub(super) struct Base {
    /// Version 4 tells the layers of colours and extra bytes the channel of each point, version 3 where it changes.
    tells_channel: bool,
    channels: Channels<Channel>,
    channel: u8,
    is_used: [bool; 4],
    item_channel: u8,
    item_is_used: [bool; 4],
}

impl Base {
    pub(super) fn new(version: u16) -> Self {
        Self {
            tells_channel: version >= 4,
            channels: Channels::new(),
            channel: 0,
            is_used: [false; 4],
            item_channel: 0,
            item_is_used: [false; 4],
        }
    }

    /// Starts a chunk behind its first record, and returns its channel.
    pub(super) fn start(&mut self, first: &[u8]) -> u8 {
        let int = |at: usize| first.get(at..).and_then(|b| b.first_chunk()).map_or(0, |b| i32::from_le_bytes(*b));
        let byte = |at: usize| first.get(at).copied().unwrap_or(0);
        let channel = (byte(FLAGS_AT) & CHANNEL_BITS) >> 4;
        (self.channel, self.item_channel) = (channel, channel);
        (self.is_used, self.item_is_used) = ([false; 4], [false; 4]);
        self.is_used[usize::from(channel)] = true;
        self.item_is_used[usize::from(channel)] = true;
        let (returns, number) = (byte(RETURNS_AT) >> 4, byte(RETURNS_AT) & 15);
        self.channels.of(channel).start(Values { x: int(0), y: int(4), returns, number, new_time: false });
        channel
    }

    /// Decodes points of chunks that are decoded in turn, and writes what this layer knows to records that begin as the
    /// first one of the chunk. Each chunk has as many points and records.
    pub(super) fn run<const L: usize>(
        layers: [&mut Self; L],
        paused: [&mut Coder<'_>; L],
        points: [&mut [Meta]; L],
        records: [&mut [u8]; L],
        record_len: usize,
    ) -> [usize; L] {
        let mut coders = paused.each_ref().map(|coder| **coder);
        let count = points.iter().map(|points| points.len()).min().unwrap_or(0);
        let (mut layers, mut records, mut good) = (layers, records, [count; L]);
        for point in 0..count {
            let place = point * record_len..(point + 1) * record_len;
            let records = records.each_mut().map(|records| &mut records[place.clone()]);
            let metas = Self::next_of(&mut layers, &mut coders, records);
            in_turn!(|l| points[l][point] = metas[l]);
            if coders.iter().any(Coder::is_off) {
                in_turn!(|l| good[l] = point + usize::from(!coders[l].is_off()));
                break;
            }
        }
        in_turn!(|l| *paused[l] = coders[l]);
        good
    }

    /// Points of chunks that are decoded in turn.
    #[inline(always)]
    fn next_of<const L: usize>(
        layers: &mut [&mut Self; L],
        coders: &mut [Coder<'_>; L],
        records: [&mut [u8]; L],
    ) -> [Meta; L] {
        let (mut changes, mut metas) = ([0; L], [Meta::default(); L]);
        in_turn!(|l| changes[l] = layers[l].channels.of(layers[l].channel).changes(&mut coders[l]));
        in_turn!(|l| metas[l] = layers[l].channel(&mut coders[l], changes[l]));
        in_turn!(|l| layers[l].channels.of(layers[l].channel).returns(&mut coders[l], changes[l]));
        let states = layers.each_mut().map(|layer| layer.channels.of(layer.channel));
        let contexts = Channel::positions(states, coders);
        in_turn!(|l| {
            let Values { x, y, returns, number, new_time } = layers[l].channels.of(layers[l].channel).last;
            if let Some(bytes) = records[l].first_chunk_mut::<16>() {
                bytes[..4].copy_from_slice(&x.to_le_bytes());
                bytes[4..8].copy_from_slice(&y.to_le_bytes());
                bytes[RETURNS_AT] = number | returns << 4;
                bytes[FLAGS_AT] = bytes[FLAGS_AT] & !CHANNEL_BITS | metas[l].channel << 4;
            }
            metas[l] = Meta {
                new_time,
                new_angle: changes[l] & ANGLE != 0,
                new_source: changes[l] & SOURCE != 0,
                place: u8::from(number == 1) << 1 | u8::from(number >= returns),
                level: level(returns, number) as u8,
                z_context: contexts[l] as u8,
                ..metas[l]
            };
        });
        metas
    }

    /// The channel of the next point, and what follows from it.
    #[inline(always)]
    fn channel(&mut self, coder: &mut Coder<'_>, changes: usize) -> Meta {
        let (from, item_from) = (self.channel, self.item_channel);
        let is_new = changes & CHANNEL != 0 && by_copy(coder, |coder| self.change_channel(coder));
        self.item_channel = if self.tells_channel || changes & CHANNEL != 0 { self.channel } else { 0 };
        let item_is_new = !std::mem::replace(&mut self.item_is_used[usize::from(self.item_channel & 3)], true);
        let (channel, item_channel) = (self.channel, self.item_channel);
        Meta { channel, from, is_new, item_channel, item_from, item_is_new, ..Meta::default() }
    }

    /// Whether the channel was not there before.
    #[cold]
    fn change_channel(&mut self, coder: &mut Coder<'_>) -> bool {
        let from = self.channel;
        self.channel = (from + 1 + coder.symbol(&mut self.channels.of(from).channels) as u8) & 3;
        let is_new = !std::mem::replace(&mut self.is_used[usize::from(self.channel)], true);
        if is_new {
            self.channels.open(self.channel, from);
        }
        is_new
    }
}
