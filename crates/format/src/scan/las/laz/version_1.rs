//! The items of LASzip 1: simpler predictions than those of version 2.

use super::coder::Coder;
use super::family::BytesFamily;
use super::integer::Integer;
use super::model::{Flags, Multiples, Tiny};
use super::point10::{LEN, Values};

/// Bits of the symbol that says which values differ from those of the point before.
const INTENSITY: usize = 1 << 5;
const RETURNS: usize = 1 << 4;
const CLASS: usize = 1 << 3;
const ANGLE: usize = 1 << 2;
const USER: usize = 1 << 1;
const SOURCE: usize = 1;

/// Decoder of `POINT10`.
#[derive(Debug, Clone)]
pub(super) struct Point10 {
    last: Values,
    /// The last three differences of x and y, and which of them is the oldest.
    differences: [[i32; 3]; 2],
    oldest: usize,
    changes: Flags,
    returns: BytesFamily,
    classes: BytesFamily,
    users: BytesFamily,
    intensity: Integer,
    angle: Integer,
    source: Integer,
    dx: Integer,
    dy: Integer,
    z: Integer,
}

impl Point10 {
    pub(super) fn new() -> Self {
        Self {
            last: Values::default(),
            differences: [[0; 3]; 2],
            oldest: 0,
            changes: Flags::new(64),
            returns: BytesFamily::new(256),
            classes: BytesFamily::new(256),
            users: BytesFamily::new(256),
            intensity: Integer::new(16, 1),
            angle: Integer::new(8, 2),
            source: Integer::new(16, 1),
            dx: Integer::new(32, 1),
            dy: Integer::new(32, 20),
            z: Integer::new(32, 20),
        }
    }

    /// Starts a chunk behind its first point.
    pub(super) fn start(&mut self, first: &[u8; LEN]) {
        self.last = Values::read(first);
        (self.differences, self.oldest) = ([[0; 3]; 2], 0);
        self.changes.reset();
        [&mut self.returns, &mut self.classes, &mut self.users].into_iter().for_each(BytesFamily::reset);
        let integers = [&mut self.intensity, &mut self.angle, &mut self.source];
        integers.into_iter().chain([&mut self.dx, &mut self.dy, &mut self.z]).for_each(Integer::reset);
    }

    pub(super) fn next(&mut self, coder: &mut Coder<'_>) -> Values {
        let [x, y, z] = &mut self.last.xyz;
        let dx = self.dx.next(coder, median(self.differences[0]), 0);
        let dy = self.dy.next(coder, median(self.differences[1]), self.dx.last_bits().min(19));
        let bits = (self.dx.last_bits() + self.dy.last_bits()) / 2;
        (*x, *y) = (x.wrapping_add(dx), y.wrapping_add(dy));
        *z = self.z.next(coder, *z, bits.min(19));
        (self.differences[0][self.oldest], self.differences[1][self.oldest]) = (dx, dy);
        self.oldest = (self.oldest + 1) % 3;
        let changes = coder.symbol(&mut self.changes);
        if changes != 0 {
            self.others(coder, changes, bits);
        }
        self.last
    }

    fn others(&mut self, coder: &mut Coder<'_>, changes: usize, bits: usize) {
        let last = &mut self.last;
        if changes & INTENSITY != 0 {
            last.intensity = self.intensity.next(coder, i32::from(last.intensity), 0) as u16;
        }
        if changes & RETURNS != 0 {
            last.returns = coder.symbol(self.returns.of(last.returns)) as u8;
        }
        if changes & CLASS != 0 {
            last.class = coder.symbol(self.classes.of(last.class)) as u8;
        }
        if changes & ANGLE != 0 {
            last.angle = self.angle.next(coder, i32::from(last.angle), usize::from(bits < 3)) as u8;
        }
        if changes & USER != 0 {
            last.user = coder.symbol(self.users.of(last.user)) as u8;
        }
        if changes & SOURCE != 0 {
            last.source = self.source.next(coder, i32::from(last.source), 0) as u16;
        }
    }
}

fn median([a, b, c]: [i32; 3]) -> i32 {
    a.min(b).max(a.max(b).min(c))
}

/// Symbols of the model of multiples of a time step: above the largest multiple, a time as it is, then the same again.
const LARGEST: usize = 509;
const WHOLE: usize = 510;
/// A step far from the last one is taken over after so many in a row.
const EXTREMES: u8 = 3;

/// Decoder of `GPSTIME11`.
#[derive(Debug, Clone)]
pub(super) struct GpsTime {
    time: i64,
    /// 0: none yet.
    step: i32,
    extremes: u8,
    without_step: Tiny,
    multiples: Multiples,
    corrections: Integer,
}

impl GpsTime {
    pub(super) fn new() -> Self {
        let (without_step, multiples) = (Tiny::new(3), Multiples::new(512));
        Self { time: 0, step: 0, extremes: 0, without_step, multiples, corrections: Integer::new(32, 6) }
    }

    /// Starts a chunk behind its first point.
    pub(super) fn start(&mut self, first: i64) {
        (self.time, self.step, self.extremes) = (first, 0, 0);
        self.without_step.reset();
        self.multiples.reset();
        self.corrections.reset();
    }

    pub(super) fn next(&mut self, coder: &mut Coder<'_>) -> i64 {
        if self.step == 0 {
            match coder.symbol(&mut self.without_step) {
                1 => {
                    self.step = self.corrections.next(coder, 0, 0);
                    self.time = self.time.wrapping_add(i64::from(self.step));
                }
                2 => self.time = coder.bits_64().cast_signed(),
                _ => {}
            }
            return self.time;
        }
        match coder.symbol(&mut self.multiples) {
            multiple @ 0..=LARGEST => self.go_on(coder, multiple),
            WHOLE => self.time = coder.bits_64().cast_signed(),
            _ => {}
        }
        self.time
    }

    fn go_on(&mut self, coder: &mut Coder<'_>, multiple: usize) {
        let (predicted, context) = match multiple {
            0 => (self.step / 4, 2),
            1 => (self.step, 1),
            _ => {
                (self.step.wrapping_mul(multiple as i32), 3 + usize::from(multiple >= 10) + usize::from(multiple >= 50))
            }
        };
        let by = self.corrections.next(coder, predicted, context);
        self.time = self.time.wrapping_add(i64::from(by));
        match multiple {
            1 => (self.step, self.extremes) = (by, 0),
            0 | LARGEST if self.extremes < EXTREMES => self.extremes += 1,
            0 | LARGEST => (self.step, self.extremes) = (by, 0),
            _ => {}
        }
    }
}

/// Decoder of `RGB12`.
#[derive(Debug, Clone)]
pub(super) struct Rgb {
    changes: Flags,
    bytes: Integer,
}

impl Rgb {
    pub(super) fn new() -> Self {
        Self { changes: Flags::new(64), bytes: Integer::new(8, 6) }
    }

    pub(super) fn reset(&mut self) {
        self.changes.reset();
        self.bytes.reset();
    }

    /// The colour behind `last`.
    pub(super) fn next(&mut self, coder: &mut Coder<'_>, last: [u16; 3]) -> [u16; 3] {
        let changes = coder.symbol(&mut self.changes);
        let mut colour = last.map(u16::to_le_bytes);
        for (i, byte) in colour.as_flattened_mut().iter_mut().enumerate() {
            if changes >> i & 1 != 0 {
                *byte = self.bytes.next(coder, i32::from(*byte), i) as u8;
            }
        }
        colour.map(u16::from_le_bytes)
    }
}
