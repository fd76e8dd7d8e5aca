//! `WAVEPACKET13`: where the waveform of a point is. Nobody asks for it, but other items stand behind it.

use super::coder::Coder;
use super::integer::Integer;
use super::model::{Bytes, Tiny};

/// Bytes of the item.
pub(super) const LEN: usize = 29;

/// How the place of a waveform follows from the last one.
const SAME: usize = 0;
const BEHIND: usize = 1;
const NEAR: usize = 2;

/// Decoder of the item.
#[derive(Debug, Clone)]
pub(super) struct WavePacket {
    offset: u64,
    size: i32,
    /// Return point and direction, as bit patterns.
    rest: [i32; 4],
    last_kind: usize,
    last_step: i32,
    descriptors: Bytes,
    kinds: [Tiny; 4],
    steps: Integer,
    sizes: Integer,
    return_points: Integer,
    directions: Integer,
}

impl WavePacket {
    pub(super) fn new() -> Self {
        Self {
            offset: 0,
            size: 0,
            rest: [0; 4],
            last_kind: 0,
            last_step: 0,
            descriptors: Bytes::new(256),
            kinds: std::array::from_fn(|_| Tiny::new(4)),
            steps: Integer::new(32, 1),
            sizes: Integer::new(32, 1),
            return_points: Integer::new(32, 1),
            directions: Integer::new(32, 3),
        }
    }

    /// Starts a chunk behind its first point.
    pub(super) fn start(&mut self, first: &[u8; LEN]) {
        let [_, o0, o1, o2, o3, o4, o5, o6, o7, rest @ ..] = *first;
        self.offset = u64::from_le_bytes([o0, o1, o2, o3, o4, o5, o6, o7]);
        let mut numbers = rest.as_chunks::<4>().0.iter().map(|bytes| i32::from_le_bytes(*bytes));
        self.size = numbers.next().unwrap_or(0);
        self.rest = std::array::from_fn(|_| numbers.next().unwrap_or(0));
        (self.last_kind, self.last_step) = (SAME, 0);
        self.descriptors.reset();
        self.kinds.iter_mut().for_each(Tiny::reset);
        [&mut self.steps, &mut self.sizes, &mut self.return_points, &mut self.directions]
            .into_iter()
            .for_each(Integer::reset);
    }

    pub(super) fn next(&mut self, coder: &mut Coder<'_>) -> [u8; LEN] {
        let mut item = [0; LEN];
        item[0] = coder.symbol(&mut self.descriptors) as u8;
        self.last_kind = coder.symbol(&mut self.kinds[self.last_kind]);
        self.offset = match self.last_kind {
            SAME => self.offset,
            BEHIND => self.offset.wrapping_add(u64::from(self.size.cast_unsigned())),
            NEAR => {
                self.last_step = self.steps.next(coder, self.last_step, 0);
                self.offset.wrapping_add_signed(i64::from(self.last_step))
            }
            _ => coder.bits_64(),
        };
        self.size = self.sizes.next(coder, self.size, 0);
        let [return_point, direction @ ..] = &mut self.rest;
        *return_point = self.return_points.next(coder, *return_point, 0);
        for (axis, value) in direction.iter_mut().enumerate() {
            *value = self.directions.next(coder, *value, axis);
        }
        item[1..9].copy_from_slice(&self.offset.to_le_bytes());
        item[9..13].copy_from_slice(&self.size.to_le_bytes());
        for (bytes, value) in item[13..].as_chunks_mut::<4>().0.iter_mut().zip(self.rest) {
            *bytes = value.to_le_bytes();
        }
        item
    }
}
