//! Colours: `RGB12` version 2, and the layers of formats 7, 8 and 10.

use super::coder::Coder;
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
        let changes = coder.symbol(&mut self.changes);
        let [red, green, blue] = last.map(u16::to_le_bytes);
        let mut byte = |which: usize, last: u8, predicted: u8| match changes >> which & 1 {
            0 => last,
            _ => predicted.wrapping_add(coder.symbol(&mut self.bytes[which]) as u8),
        };
        let new_red = [byte(0, red[0], red[0]), byte(1, red[1], red[1])];
        if changes & COLOURED == 0 {
            return [u16::from_le_bytes(new_red); 3];
        }
        let (mut new_green, mut new_blue) = ([0; 2], [0; 2]);
        for half in 0..2 {
            // green is expected to change as red did, blue as both did on average
            let by_red = i32::from(new_red[half]) - i32::from(red[half]);
            new_green[half] = byte(GREEN + half, green[half], moved(green[half], by_red));
            let by_green = i32::from(new_green[half]) - i32::from(green[half]);
            new_blue[half] = byte(BLUE + half, blue[half], moved(blue[half], (by_red + by_green) / 2));
        }
        [new_red, new_green, new_blue].map(u16::from_le_bytes)
    }
}

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
