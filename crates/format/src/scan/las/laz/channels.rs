//! Points of up to four scanner channels side by side, each channel predicted from its own.

use super::coder::Coder;
use super::in_turn::in_turn;

/// What the layers need to know of a point: how it follows from those before.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Meta {
    /// The scanner channel, and that of the point before.
    pub(super) channel: u8,
    pub(super) from: u8,
    /// The first point of its channel.
    pub(super) is_new: bool,
    /// As these, for the layers of colours and extra bytes: LASzip takes channel 0 where version 3 says nothing.
    pub(super) item_channel: u8,
    pub(super) item_from: u8,
    pub(super) item_is_new: bool,
    /// The GPS time, the scan angle, the point source id differ from those of the last point of the channel.
    pub(super) new_time: bool,
    pub(super) new_angle: bool,
    pub(super) new_source: bool,
    /// 2 for a first return, and 1 for a last one.
    pub(super) place: u8,
    /// How deep the pulse has gone.
    pub(super) level: u8,
    /// Context of the height.
    pub(super) z_context: u8,
}

/// State of one channel of a layer.
pub(super) trait State {
    /// A value of a point.
    type Value: Copy;

    fn new() -> Self;

    /// Forgets everything; `last` is the value of the point before.
    fn start(&mut self, last: Self::Value);

    /// The value of the last point.
    fn last(&self) -> Self::Value;
}

/// State for each channel, made when the channel first occurs.
#[derive(Debug)]
pub(super) struct Channels<S> {
    states: [Option<Box<S>>; 4],
}

impl<S: State> Channels<S> {
    pub(super) fn new() -> Self {
        Self { states: [const { None }; 4] }
    }

    #[inline(always)]
    pub(super) fn of(&mut self, channel: u8) -> &mut S {
        match &mut self.states[usize::from(channel & 3)] {
            Some(state) => state,
            empty => Self::fill(empty),
        }
    }

    #[cold]
    fn fill(empty: &mut Option<Box<S>>) -> &mut S {
        empty.get_or_insert_with(|| Box::new(S::new()))
    }

    /// Begins a channel behind a point of the channel `from`.
    #[cold]
    pub(super) fn open(&mut self, channel: u8, from: u8) {
        let last = self.of(from).last();
        self.of(channel).start(last);
    }
}

/// A layer of a chunk: one field of all points, decoded alone.
pub(super) trait Layer {
    /// Starts a chunk behind its first record.
    fn start(&mut self, first: &[u8], channel: u8);

    /// Decodes the field of a point and writes it to the record.
    fn next(&mut self, coder: &mut Coder<'_>, meta: &Meta, record: &mut [u8]);
}

/// Decodes the field of many points of chunks that are decoded in turn; returns how many are good. Each chunk has as
/// many points and records.
pub(super) fn run<T: Layer, const L: usize>(
    layers: [&mut T; L],
    paused: [&mut Coder<'_>; L],
    points: [&[Meta]; L],
    records: [&mut [u8]; L],
    record_len: usize,
) -> [usize; L] {
    let mut coders = paused.each_ref().map(|coder| **coder);
    let count = points.iter().map(|points| points.len()).min().unwrap_or(0);
    let mut good = [count; L];
    for point in 0..count {
        let place = point * record_len..(point + 1) * record_len;
        in_turn!(|l| layers[l].next(&mut coders[l], &points[l][point], &mut records[l][place.clone()]));
        if coders.iter().any(Coder::is_off) {
            in_turn!(|l| good[l] = point + usize::from(!coders[l].is_off()));
            break;
        }
    }
    in_turn!(|l| *paused[l] = coders[l]);
    good
}
