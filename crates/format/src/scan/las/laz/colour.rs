//! Colours: `RGB12` version 2, and the layers of formats 7, 8 and 10.

use super::coder::Coder;
use super::in_turn::in_turn;
use super::model::{Bytes, Changes, Tiny};

/// Bits of the symbol that says which bytes differ from those of the point before: two a channel, the lower byte first.
const GREEN: usize = 2;
const BLUE: usize = 4;
/// Set if green and blue are not those of red.
const COLOURED: usize = 1 << 6;

/// Decoder of red, green and blue.
#[derive(Debug, Clone)]
pub(super) struct Rgb {
    changes: Changes,
    /// Lower and upper bytes of red, green and blue.
    bytes: [Bytes; 6],
}

impl Rgb {
    pub(super) fn new() -> Self {
        Self { changes: Changes::new(128), bytes: std::array::from_fn(|_| Bytes::new(256)) }
    }

    pub(super) fn reset(&mut self) {
        self.changes.reset();
        self.bytes.iter_mut().for_each(Bytes::reset);
    }

    /// The colour behind `last`.
    #[inline(always)]
    pub(super) fn next(&mut self, coder: &mut Coder<'_>, last: [u16; 3]) -> [u16; 3] {
        let [next] = Self::next_of([self], std::array::from_mut(coder), [last]);
        next
    }

    /// The colours of several decoders, in turn.
    #[inline(always)]
    pub(super) fn next_of<const L: usize>(
        models: [&mut Self; L],
        coders: &mut [Coder<'_>; L],
        last: [[u16; 3]; L],
    ) -> [[u16; 3]; L] {
        let mut changes = [0; L];
        in_turn!(|l| changes[l] = coders[l].symbol(&mut models[l].changes));
        let last = last.map(|colour| colour.map(u16::to_le_bytes));
        let (mut models, mut new) = (models, [[[0; 2]; 3]; L]);
        // written out: a loop would keep the decoders in memory
        Self::reds(&mut models, coders, changes, 0, &last, &mut new);
        Self::reds(&mut models, coders, changes, 1, &last, &mut new);
        Self::greens_and_blues(&mut models, coders, changes, 0, &last, &mut new);
        Self::greens_and_blues(&mut models, coders, changes, 1, &last, &mut new);
        let mut out = [[0; 3]; L];
        in_turn!(|l| {
            let [red, green, blue] = new[l].map(u16::from_le_bytes);
            out[l] = if changes[l] & COLOURED == 0 { [red; 3] } else { [red, green, blue] };
        });
        out
    }

    #[inline(always)]
    fn reds<const L: usize>(
        models: &mut [&mut Self; L],
        coders: &mut [Coder<'_>; L],
        changes: [usize; L],
        half: usize,
        last: &[[[u8; 2]; 3]; L],
        new: &mut [[[u8; 2]; 3]; L],
    ) {
        in_turn!(|l| {
            let red = last[l][0][half];
            new[l][0][half] = models[l].byte(&mut coders[l], changes[l], half, red, red);
        });
    }

    /// Green is expected to change as red did, blue as both did on average.
    #[inline(always)]
    fn greens_and_blues<const L: usize>(
        models: &mut [&mut Self; L],
        coders: &mut [Coder<'_>; L],
        changes: [usize; L],
        half: usize,
        last: &[[[u8; 2]; 3]; L],
        new: &mut [[[u8; 2]; 3]; L],
    ) {
        let mut by_red = [0; L];
        in_turn!(|l| {
            if changes[l] & COLOURED != 0 {
                by_red[l] = i32::from(new[l][0][half]) - i32::from(last[l][0][half]);
                let green = last[l][1][half];
                let predicted = moved(green, by_red[l]);
                new[l][1][half] = models[l].byte(&mut coders[l], changes[l], GREEN + half, green, predicted);
            }
        });
        in_turn!(|l| {
            if changes[l] & COLOURED != 0 {
                let by_green = i32::from(new[l][1][half]) - i32::from(last[l][1][half]);
                let blue = last[l][2][half];
                let predicted = moved(blue, (by_red[l] + by_green) / 2);
                new[l][2][half] = models[l].byte(&mut coders[l], changes[l], BLUE + half, blue, predicted);
            }
        });
    }

    /// The byte of that number.
    #[inline(always)]
    fn byte(&mut self, coder: &mut Coder<'_>, changes: usize, which: usize, last: u8, predicted: u8) -> u8 {
        match changes >> which & 1 {
            0 => last,
            _ => predicted.wrapping_add(coder.symbol(&mut self.bytes[which]) as u8),
        }
    }
}

#[inline(always)]
fn moved(byte: u8, by: i32) -> u8 {
    (i32::from(byte) + by).clamp(0, 255) as u8
}

/// Decoder of near infrared.
#[derive(Debug, Clone)]
pub(super) struct Nir {
    changes: Tiny,
    bytes: [Bytes; 2],
}

impl Nir {
    pub(super) fn new() -> Self {
        Self { changes: Tiny::new(4), bytes: std::array::from_fn(|_| Bytes::new(256)) }
    }

    pub(super) fn reset(&mut self) {
        self.changes.reset();
        self.bytes.iter_mut().for_each(Bytes::reset);
    }

    /// The value behind `last`.
    #[inline(always)]
    pub(super) fn next(&mut self, coder: &mut Coder<'_>, last: u16) -> u16 {
        let changes = coder.symbol(&mut self.changes);
        let mut bytes = last.to_le_bytes();
        for (half, byte) in bytes.iter_mut().enumerate() {
            if changes >> half & 1 != 0 {
                *byte = byte.wrapping_add(coder.symbol(&mut self.bytes[half]) as u8);
            }
        }
        u16::from_le_bytes(bytes)
    }
}
