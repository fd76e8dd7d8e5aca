//! The layers of colours and extra bytes: their last value may be that of another channel than their models.

use super::channels::{Layer, Meta};
use super::coder::Coder;
use super::colour::{Nir, Rgb};
use super::layers::{read, write};
use super::model::Bytes;

/// A colour or an extra byte.
pub(super) trait Item {
    type Value: Copy + Default;

    fn new() -> Self;
    fn reset(&mut self);
    fn of(record: &[u8], at: usize) -> Self::Value;
    fn next(&mut self, coder: &mut Coder<'_>, last: Self::Value) -> Self::Value;
    fn write(record: &mut [u8], at: usize, value: Self::Value);
}

/// The layer of a colour or an extra byte.
#[derive(Debug)]
pub(super) struct ItemLayer<I: Item> {
    /// Where the field is in a record.
    at: usize,
    /// Version 4 predicts from the last value of the channel; version 3, where the channel changes, from that of the
    /// point before.
    is_of_channel: bool,
    last: [I::Value; 4],
    models: [Option<Box<I>>; 4],
}

impl<I: Item> ItemLayer<I> {
    pub(super) fn new(at: usize, version: u16) -> Self {
        let (last, models) = (Default::default(), [const { None }; 4]);
        Self { at, is_of_channel: version >= 4, last, models }
    }

    #[inline(always)]
    fn models(&mut self, channel: u8) -> &mut I {
        match &mut self.models[usize::from(channel & 3)] {
            Some(models) => models,
            empty => Self::fill(empty),
        }
    }

    #[cold]
    fn fill(empty: &mut Option<Box<I>>) -> &mut I {
        empty.get_or_insert_with(|| Box::new(I::new()))
    }
}

impl<I: Item> Layer for ItemLayer<I> {
    fn start(&mut self, first: &[u8], channel: u8) {
        self.last = [I::of(first, self.at); 4];
        self.models(channel).reset();
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, meta: &Meta, record: &mut [u8]) {
        let (channel, from) = (usize::from(meta.item_channel & 3), usize::from(meta.item_from & 3));
        if meta.item_is_new {
            self.last[channel] = self.last[from];
            self.models(meta.item_channel).reset();
        }
        let predictor = if self.is_of_channel || meta.item_is_new { channel } else { from };
        let value = self.last[predictor];
        let value = self.models(meta.item_channel).next(coder, value);
        self.last[predictor] = value;
        I::write(record, self.at, value);
    }
}

impl Item for Rgb {
    type Value = [u16; 3];

    fn new() -> Self {
        Self::new()
    }

    fn reset(&mut self) {
        self.reset();
    }

    fn of(record: &[u8], at: usize) -> [u16; 3] {
        [0, 2, 4].map(|offset| u16::from_le_bytes(read(record, at + offset)))
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, last: [u16; 3]) -> [u16; 3] {
        self.next(coder, last)
    }

    #[inline(always)]
    fn write(record: &mut [u8], at: usize, [red, green, blue]: [u16; 3]) {
        let [[r0, r1], [g0, g1], [b0, b1]] = [red, green, blue].map(u16::to_le_bytes);
        write(record, at, [r0, r1, g0, g1, b0, b1]);
    }
}

impl Item for Nir {
    type Value = u16;

    fn new() -> Self {
        Self::new()
    }

    fn reset(&mut self) {
        self.reset();
    }

    fn of(record: &[u8], at: usize) -> u16 {
        u16::from_le_bytes(read(record, at))
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, last: u16) -> u16 {
        self.next(coder, last)
    }

    #[inline(always)]
    fn write(record: &mut [u8], at: usize, value: u16) {
        write(record, at, value.to_le_bytes());
    }
}

impl Item for Bytes {
    type Value = u8;

    fn new() -> Self {
        Self::new(256)
    }

    fn reset(&mut self) {
        self.reset();
    }

    fn of(record: &[u8], at: usize) -> u8 {
        read::<1>(record, at)[0]
    }

    #[inline(always)]
    fn next(&mut self, coder: &mut Coder<'_>, last: u8) -> u8 {
        last.wrapping_add(coder.symbol(self) as u8)
    }

    #[inline(always)]
    fn write(record: &mut [u8], at: usize, value: u8) {
        write(record, at, [value]);
    }
}
