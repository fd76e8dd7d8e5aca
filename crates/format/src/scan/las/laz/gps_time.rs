//! GPS times: `GPSTIME11` version 2, and the layer of formats 6–10.
//!
//! Up to four sequences of times go on side by side, each with its last step. A time is a multiple of that step and a
//! correction, or a jump that begins a sequence, or a change to another sequence, which then gives the time.

use std::array::from_mut;

use super::coder::{Coder, by_copy};
use super::in_turn::in_turn;
use super::integer::Integer;
use super::model::{Multiples, Tiny};

/// Multiples above are taken for this one; those from here on are negative, down to −10.
const LARGEST: usize = 500;
const SMALLEST: i32 = -10;
/// Symbols of the model of multiples in the item; the layer lacks `SAME`.
const SAME: usize = 511;
const JUMP: usize = 512;

/// An encoder changes the sequence at most once a time; damaged data change it without end.
const MOST_CHANGES: usize = 4;

/// A sequence takes over a step that was far from its own after so many in a row.
const EXTREMES: u8 = 3;

/// Contexts of the corrections.
const FIRST_STEP: usize = 0;
const ONE_STEP: usize = 1;
const FEW_STEPS: usize = 2;
const MANY_STEPS: usize = 3;
const MOST_STEPS: usize = 4;
const BACK: usize = 5;
const MOST_BACK: usize = 6;
const NO_STEP: usize = 7;
const UPPER_HALF: usize = 8;

#[derive(Debug, Clone, Copy, Default)]
struct Sequence {
    time: i64,
    /// 0: none yet.
    step: i32,
    /// Steps far from `step`, since the last one that was not.
    extremes: u8,
}

/// Decoder of GPS times as 64-bit patterns.
#[derive(Debug, Clone)]
pub(super) struct GpsTime {
    sequences: [Sequence; 4],
    /// The one that gave the last time, and the one begun last.
    current: usize,
    newest: usize,
    /// The layer has no symbol for a time that stays the same, which is known before.
    has_same: bool,
    without_step: Tiny,
    multiples: Multiples,
    corrections: Integer,
}

impl GpsTime {
    /// `has_same`: for the item of formats 1, 3, 4 and 5.
    pub(super) fn new(has_same: bool) -> Self {
        Self {
            sequences: [Sequence::default(); 4],
            current: 0,
            newest: 0,
            has_same,
            without_step: Tiny::new(5 + usize::from(has_same)),
            multiples: Multiples::new(515 + usize::from(has_same)),
            corrections: Integer::new(32, 9),
        }
    }

    /// Starts behind a first time.
    pub(super) fn start(&mut self, first: i64) {
        self.sequences = [Sequence::default(); 4];
        self.sequences[0].time = first;
        (self.current, self.newest) = (0, 0);
        self.without_step.reset();
        self.multiples.reset();
        self.corrections.reset();
    }

    /// The last time.
    pub(super) fn time(&self) -> i64 {
        self.sequences[self.current].time
    }

    /// The next time.
    #[inline(always)]
    pub(super) fn next(&mut self, coder: &mut Coder<'_>) -> i64 {
        let [time] = Self::next_of(from_mut(self), from_mut(coder));
        time
    }

    /// The next times of several decoders, in turn.
    #[inline(always)]
    pub(super) fn next_of<const L: usize>(all: &mut [Self; L], coders: &mut [Coder<'_>; L]) -> [i64; L] {
        let (mut symbols, mut times) = ([JUMP; L], [0; L]);
        in_turn!(|l| {
            if all[l].has_step() {
                symbols[l] = all[l].multiple(&mut coders[l]);
            }
        });
        in_turn!(|l| {
            if symbols[l] < SAME {
                all[l].step(&mut coders[l], symbols[l]);
            } else if symbols[l] > SAME {
                by_copy(&mut coders[l], |coder| all[l].seldom(coder, symbols[l]));
            }
            times[l] = all[l].time();
        });
        times
    }

    #[inline(always)]
    fn has_step(&self) -> bool {
        self.sequences[self.current].step != 0
    }

    /// The symbol of the model of multiples, numbered as in the item.
    #[inline(always)]
    fn multiple(&mut self, coder: &mut Coder<'_>) -> usize {
        let symbol = coder.symbol(&mut self.multiples);
        symbol + usize::from(!self.has_same && symbol >= SAME)
    }

    /// A jump, a change of the sequence, or a sequence that has no step yet; `symbol` is worth nothing there.
    #[inline(never)]
    fn seldom(&mut self, coder: &mut Coder<'_>, symbol: usize) {
        let mut change = match self.has_step() {
            true => self.beyond(coder, symbol),
            false => self.step_first(coder),
        };
        for _ in 0..MOST_CHANGES {
            if change == 0 {
                return;
            }
            self.current = (self.current + change) & 3;
            change = match self.has_step() {
                false => self.step_first(coder),
                true => match self.multiple(coder) {
                    symbol @ 0..SAME => {
                        self.step(coder, symbol);
                        0
                    }
                    symbol => self.beyond(coder, symbol),
                },
            };
        }
        if change != 0 {
            coder.fail();
        }
    }

    /// What the symbols from [`SAME`] on say: how many sequences further the time is to be found; 0: it is here.
    fn beyond(&mut self, coder: &mut Coder<'_>, symbol: usize) -> usize {
        match symbol {
            JUMP => self.jump(coder),
            further => further.saturating_sub(JUMP),
        }
    }

    /// As [`Self::beyond`], for a sequence that has no step.
    fn step_first(&mut self, coder: &mut Coder<'_>) -> usize {
        let symbol = coder.symbol(&mut self.without_step) + usize::from(!self.has_same);
        let sequence = &mut self.sequences[self.current];
        match symbol {
            0 => 0,
            1 => {
                sequence.step = self.corrections.next(coder, 0, FIRST_STEP);
                sequence.time = sequence.time.wrapping_add(i64::from(sequence.step));
                sequence.extremes = 0;
                0
            }
            2 => self.jump(coder),
            further => further - 2,
        }
    }

    /// Goes on by a multiple of the step, and a correction.
    #[inline(always)]
    fn step(&mut self, coder: &mut Coder<'_>, symbol: usize) {
        let (multiple, context) = match symbol {
            0 => (0, NO_STEP),
            1 => (1, ONE_STEP),
            2..10 => (symbol as i32, FEW_STEPS),
            10..LARGEST => (symbol as i32, MANY_STEPS),
            LARGEST => (LARGEST as i32, MOST_STEPS),
            _ => match LARGEST as i32 - symbol as i32 {
                SMALLEST => (SMALLEST, MOST_BACK),
                multiple => (multiple, BACK),
            },
        };
        let sequence = &mut self.sequences[self.current];
        let by = self.corrections.next(coder, sequence.step.wrapping_mul(multiple), context);
        sequence.time = sequence.time.wrapping_add(i64::from(by));
        match context {
            ONE_STEP => sequence.extremes = 0,
            NO_STEP | MOST_STEPS | MOST_BACK if sequence.extremes < EXTREMES => sequence.extremes += 1,
            NO_STEP | MOST_STEPS | MOST_BACK => (sequence.step, sequence.extremes) = (by, 0),
            _ => {}
        }
    }

    /// Begins a sequence.
    fn jump(&mut self, coder: &mut Coder<'_>) -> usize {
        let upper = (self.sequences[self.current].time >> 32) as i32;
        let upper = i64::from(self.corrections.next(coder, upper, UPPER_HALF));
        let time = upper << 32 | i64::from(coder.bits(32));
        self.newest = (self.newest + 1) & 3;
        self.current = self.newest;
        self.sequences[self.current] = Sequence { time, ..Sequence::default() };
        0
    }
}
