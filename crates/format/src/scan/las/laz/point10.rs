//! `POINT10` version 2: the first 20 bytes of formats 0–5.

use super::coder::Coder;
use super::integer::Integer;
use super::median::Median;
use super::model::{Bytes, BytesFamily, Flags};
use super::returns::{context_8, level};

/// Bytes of the item.
pub(super) const LEN: usize = 20;

/// Bits of the symbol that says which values differ from those of the point before.
const RETURNS: usize = 1 << 5;
const INTENSITY: usize = 1 << 4;
const CLASS: usize = 1 << 3;
const ANGLE: usize = 1 << 2;
const USER: usize = 1 << 1;
const SOURCE: usize = 1;

/// Values of a point.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Values {
    pub(super) xyz: [i32; 3],
    pub(super) intensity: u16,
    /// Number of the return (three bits), of returns (three), scan direction, edge of the flight line.
    pub(super) returns: u8,
    pub(super) class: u8,
    pub(super) angle: u8,
    pub(super) user: u8,
    pub(super) source: u16,
}

impl Values {
    pub(super) fn read(item: &[u8; LEN]) -> Self {
        let int = |at: usize| i32::from_le_bytes([item[at], item[at + 1], item[at + 2], item[at + 3]]);
        Self {
            xyz: [int(0), int(4), int(8)],
            intensity: u16::from_le_bytes([item[12], item[13]]),
            returns: item[14],
            class: item[15],
            angle: item[16],
            user: item[17],
            source: u16::from_le_bytes([item[18], item[19]]),
        }
    }

    #[inline(always)]
    pub(super) fn write(&self, item: &mut [u8; LEN]) {
        for (bytes, value) in item.as_chunks_mut::<4>().0.iter_mut().zip(self.xyz) {
            *bytes = value.to_le_bytes();
        }
        [item[12], item[13]] = self.intensity.to_le_bytes();
        [item[14], item[15], item[16], item[17]] = [self.returns, self.class, self.angle, self.user];
        [item[18], item[19]] = self.source.to_le_bytes();
    }
}

/// Decoder of the item.
#[derive(Debug, Clone)]
pub(super) struct Point10 {
    last: Values,
    changes: Flags,
    returns: BytesFamily,
    classes: BytesFamily,
    users: BytesFamily,
    angles: [Bytes; 2],
    intensity: Integer,
    source: Integer,
    dx: Integer,
    dy: Integer,
    z: Integer,
    /// By the context of the return.
    intensities: [u16; 16],
    medians: [[Median; 2]; 16],
    /// By the level of the return.
    heights: [i32; 8],
}

impl Point10 {
    pub(super) fn new() -> Self {
        Self {
            last: Values::default(),
            changes: Flags::new(64),
            returns: BytesFamily::new(256),
            classes: BytesFamily::new(256),
            users: BytesFamily::new(256),
            angles: [256; 2].map(Bytes::new),
            intensity: Integer::new(16, 4),
            source: Integer::new(16, 1),
            dx: Integer::new(32, 2),
            dy: Integer::new(32, 22),
            z: Integer::new(32, 20),
            intensities: [0; 16],
            medians: [[Median::new(); 2]; 16],
            heights: [0; 8],
        }
    }

    /// Starts a chunk behind its first point.
    pub(super) fn start(&mut self, first: &[u8; LEN]) {
        // the first intensity is predicted from nothing
        self.last = Values { intensity: 0, ..Values::read(first) };
        self.changes.reset();
        [&mut self.returns, &mut self.classes, &mut self.users].into_iter().for_each(BytesFamily::reset);
        self.angles.iter_mut().for_each(Bytes::reset);
        [&mut self.intensity, &mut self.source, &mut self.dx, &mut self.dy, &mut self.z]
            .into_iter()
            .for_each(Integer::reset);
        self.intensities = [0; 16];
        self.medians = [[Median::new(); 2]; 16];
        self.heights = [0; 8];
    }

    #[inline(always)]
    pub(super) fn next(&mut self, coder: &mut Coder<'_>, item: &mut [u8; LEN]) {
        let changes = coder.symbol(&mut self.changes);
        if changes & RETURNS != 0 {
            self.last.returns = coder.symbol(self.returns.of(self.last.returns)) as u8;
        }
        let (number, returns) = (self.last.returns & 7, self.last.returns >> 3 & 7);
        let context = context_8(returns, number);
        if changes != 0 {
            self.others(coder, changes, context);
        }
        self.position(coder, context, returns, number);
        self.last.write(item);
    }

    #[inline(always)]
    fn others(&mut self, coder: &mut Coder<'_>, changes: usize, context: usize) {
        let last = &mut self.last;
        if changes & INTENSITY != 0 {
            let predicted = i32::from(self.intensities[context]);
            self.intensities[context] = self.intensity.next(coder, predicted, context.min(3)) as u16;
        }
        last.intensity = self.intensities[context];
        if changes & CLASS != 0 {
            last.class = coder.symbol(self.classes.of(last.class)) as u8;
        }
        if changes & ANGLE != 0 {
            let direction = usize::from(last.returns >> 6 & 1);
            last.angle = last.angle.wrapping_add(coder.symbol(&mut self.angles[direction]) as u8);
        }
        if changes & USER != 0 {
            last.user = coder.symbol(self.users.of(last.user)) as u8;
        }
        if changes & SOURCE != 0 {
            last.source = self.source.next(coder, i32::from(last.source), 0) as u16;
        }
    }

    #[inline(always)]
    fn position(&mut self, coder: &mut Coder<'_>, context: usize, returns: u8, number: u8) {
        let single = usize::from(returns == 1);
        let [x_median, y_median] = &mut self.medians[context];
        let [x, y, z] = &mut self.last.xyz;

        let dx = self.dx.next(coder, x_median.get(), single);
        *x = x.wrapping_add(dx);
        x_median.add(dx);

        let y_context = single + (self.dx.last_bits() & !1).min(20);
        let dy = self.dy.next(coder, y_median.get(), y_context);
        *y = y.wrapping_add(dy);
        y_median.add(dy);

        let bits = (self.dx.last_bits() + self.dy.last_bits()) / 2;
        let z_context = single + (bits & !1).min(18);
        let height = &mut self.heights[level(returns, number)];
        *height = self.z.next(coder, *height, z_context);
        *z = *height;
    }
}
