//! `POINT10` version 2: the first 20 bytes of formats 0–5.

use super::coder::{Coder, by_copy};
use super::family::BytesFamily;
use super::in_turn::in_turn;
use super::integer::Integer;
use super::median::Median;
use super::model::{Bytes, Flags};
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

    /// The number of the return, and of returns.
    #[inline(always)]
    fn number_of(&self) -> (u8, u8) {
        (self.returns & 7, self.returns >> 3 & 7)
    }

    #[inline(always)]
    pub(super) fn to_bytes(self) -> [u8; LEN] {
        let mut item = [0; LEN];
        for (bytes, value) in item.as_chunks_mut::<4>().0.iter_mut().zip(self.xyz) {
            *bytes = value.to_le_bytes();
        }
        [item[12], item[13]] = self.intensity.to_le_bytes();
        [item[14], item[15], item[16], item[17]] = [self.returns, self.class, self.angle, self.user];
        [item[18], item[19]] = self.source.to_le_bytes();
        item
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

    /// The next points of several decoders, in turn, so that none waits for itself.
    #[inline(always)]
    pub(super) fn next_of<const L: usize>(points: &mut [Self; L], coders: &mut [Coder<'_>; L]) -> [Values; L] {
        let (mut changes, mut contexts) = ([0; L], [0; L]);
        in_turn!(|l| changes[l] = coders[l].symbol(&mut points[l].changes));
        in_turn!(|l| contexts[l] = points[l].returns(&mut coders[l], changes[l]));
        Self::intensities(points, coders, changes, contexts);
        in_turn!(|l| {
            if changes[l] != 0 {
                points[l].last.intensity = points[l].intensities[contexts[l]];
            }
            if changes[l] & (CLASS | ANGLE | USER | SOURCE) != 0 {
                by_copy(&mut coders[l], |coder| points[l].others(coder, changes[l]));
            }
        });
        Self::positions(points, coders, contexts);
        points.each_ref().map(|point| point.last)
    }

    /// The context of the return.
    #[inline(always)]
    fn returns(&mut self, coder: &mut Coder<'_>, changes: usize) -> usize {
        if changes & RETURNS != 0 {
            self.last.returns = by_copy(coder, |coder| coder.symbol(self.returns.of(self.last.returns))) as u8;
        }
        let (number, returns) = self.last.number_of();
        context_8(returns, number)
    }

    #[inline(always)]
    fn intensities<const L: usize>(
        points: &mut [Self; L],
        coders: &mut [Coder<'_>; L],
        changes: [usize; L],
        contexts: [usize; L],
    ) {
        if changes.iter().all(|changes| changes & INTENSITY != 0) {
            let mut predicted = [0; L];
            in_turn!(|l| predicted[l] = i32::from(points[l].intensities[contexts[l]]));
            let models = points.each_mut().map(|point| &mut point.intensity);
            let values = Integer::next_of(models, coders, predicted, contexts.map(|context| context.min(3)));
            in_turn!(|l| points[l].intensities[contexts[l]] = values[l] as u16);
        } else if L > 1 {
            in_turn!(|l| {
                if changes[l] & INTENSITY != 0 {
                    by_copy(&mut coders[l], |coder| points[l].intensity(coder, contexts[l]));
                }
            });
        }
    }

    #[inline(never)]
    fn intensity(&mut self, coder: &mut Coder<'_>, context: usize) {
        let predicted = i32::from(self.intensities[context]);
        self.intensities[context] = self.intensity.next(coder, predicted, context.min(3)) as u16;
    }

    /// What seldom changes.
    #[inline(never)]
    fn others(&mut self, coder: &mut Coder<'_>, changes: usize) {
        let last = &mut self.last;
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
    fn positions<const L: usize>(points: &mut [Self; L], coders: &mut [Coder<'_>; L], contexts: [usize; L]) {
        let (mut singles, mut levels) = ([0; L], [0; L]);
        in_turn!(|l| {
            let (number, returns) = points[l].last.number_of();
            (singles[l], levels[l]) = (usize::from(returns == 1), level(returns, number));
        });
        let mut predicted = [0; L];
        in_turn!(|l| predicted[l] = points[l].medians[contexts[l]][0].get());
        let by = Integer::next_of(points.each_mut().map(|point| &mut point.dx), coders, predicted, singles);
        in_turn!(|l| points[l].advance(0, by[l], contexts[l]));

        let mut of_dx = [0; L];
        in_turn!(|l| predicted[l] = points[l].medians[contexts[l]][1].get());
        in_turn!(|l| of_dx[l] = singles[l] + (points[l].dx.last_bits() & !1).min(20));
        let by = Integer::next_of(points.each_mut().map(|point| &mut point.dy), coders, predicted, of_dx);
        in_turn!(|l| points[l].advance(1, by[l], contexts[l]));

        let mut of_both = [0; L];
        in_turn!(|l| {
            let bits = (points[l].dx.last_bits() + points[l].dy.last_bits()) / 2;
            of_both[l] = singles[l] + (bits & !1).min(18);
        });
        in_turn!(|l| predicted[l] = points[l].heights[levels[l]]);
        let heights = Integer::next_of(points.each_mut().map(|point| &mut point.z), coders, predicted, of_both);
        in_turn!(|l| {
            points[l].heights[levels[l]] = heights[l];
            points[l].last.xyz[2] = heights[l];
        });
    }

    /// Moves x or y.
    #[inline(always)]
    fn advance(&mut self, axis: usize, by: i32, context: usize) {
        self.last.xyz[axis] = self.last.xyz[axis].wrapping_add(by);
        self.medians[context][axis].add(by);
    }
}
