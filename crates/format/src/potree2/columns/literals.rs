//! Bytes that are stored as they are: by what stands before them, they are given one of a few prefix codes.

use super::bits::BitWriter;
use super::contexts::{CONTEXTS, Mode};
use super::logs::{BIT, weighted_log};
use super::prefix::PrefixCode;

/// There are no more codes than this.
const MAX_CODES: usize = 24;

/// About what the description of another code costs, beside that of each symbol.
const CODE_COST: u64 = 60 * BIT;
const SYMBOL_COST: u64 = 5 * BIT;

/// The bytes of a meta-block that are stored as they are.
#[derive(Debug)]
pub(super) struct Literals {
    /// Each with its context from bit 8 on.
    stored: Vec<u16>,
    mode: Mode,
    counts: Vec<[u32; 256]>,
    /// The code of each context.
    map: [u8; CONTEXTS],
    codes: Vec<PrefixCode>,
    groups: Vec<Group>,
    /// Bytes of a context with their counts.
    used: Vec<(usize, u32)>,
}

/// Bytes that share a code.
#[derive(Debug)]
struct Group {
    total: u32,
    counts: [u32; 256],
}

impl Default for Group {
    fn default() -> Self {
        Self { total: 0, counts: [0; 256] }
    }
}

impl Group {
    /// What it costs, in parts of a bit, to take in `used`, `total` bytes in all.
    fn cost_of(&self, total: u32, used: &[(usize, u32)]) -> u64 {
        let (mut saved, mut new) = (0, 0);
        for (byte, count) in used {
            let there = self.counts[*byte];
            saved += weighted_log(there + count) - weighted_log(there);
            new += u64::from(there == 0);
        }
        (weighted_log(self.total + total) - weighted_log(self.total)).saturating_sub(saved) + SYMBOL_COST * new
    }

    fn add(&mut self, total: u32, used: &[(usize, u32)]) {
        self.total += total;
        used.iter().for_each(|(byte, count)| self.counts[*byte] += count);
    }
}

impl Default for Literals {
    fn default() -> Self {
        let (counts, map) = (vec![[0; 256]; CONTEXTS], [0; CONTEXTS]);
        let (stored, mode, codes, groups, used) = Default::default();
        Self { stored, mode, counts, map, codes, groups, used }
    }
}

impl Literals {
    pub(super) fn start(&mut self, mode: Mode) {
        self.mode = mode;
        self.stored.clear();
        self.counts.fill([0; 256]);
    }

    /// Adds bytes that follow `before`.
    #[inline]
    pub(super) fn add(&mut self, bytes: &[u8], before: [u8; 2]) {
        let Self { stored, mode, counts, .. } = self;
        mode.each(bytes, before, |byte, context| {
            stored.push((context as u16) << 8 | u16::from(byte));
            counts[context][usize::from(byte)] += 1;
        });
    }

    /// Chooses codes: the contexts with the most bytes begin, each joins those before it or starts another code,
    /// whichever costs less.
    pub(super) fn group(&mut self) {
        self.groups.clear();
        self.map = [0; CONTEXTS];
        let mut contexts = [(0, 0); CONTEXTS];
        for (context, counts) in self.counts.iter().enumerate() {
            contexts[context] = (counts.iter().sum::<u32>(), context);
        }
        contexts.sort_unstable_by_key(|(total, context)| (u32::MAX - total, *context));
        for &(total, context) in contexts.iter().take_while(|(total, _)| *total > 0) {
            let used = self.counts[context].iter().enumerate().filter(|(_, count)| **count > 0);
            self.used.clear();
            self.used.extend(used.map(|(byte, count)| (byte, *count)));
            let costs = self.groups.iter().map(|group| group.cost_of(total, &self.used));
            let cheapest = costs.enumerate().min_by_key(|(_, cost)| *cost);
            let alone = CODE_COST + Group::default().cost_of(total, &self.used);
            let group = match cheapest {
                Some((group, cost)) if cost <= alone || self.groups.len() == MAX_CODES => group,
                _ => {
                    self.groups.push(Group::default());
                    self.groups.len() - 1
                }
            };
            self.map[context] = group as u8;
            self.groups[group].add(total, &self.used);
        }
        if self.groups.is_empty() {
            self.groups.push(Group::default());
        }
    }

    /// How bytes before make contexts.
    pub(super) fn mode(&self) -> Mode {
        self.mode
    }

    /// How many codes there are.
    pub(super) fn codes(&self) -> usize {
        self.groups.len()
    }

    /// Writes which code each context has; only for several codes.
    pub(super) fn write_map(&self, map_code: &mut PrefixCode, bits: &mut BitWriter<'_>) {
        let mut counts = vec![0; self.groups.len()];
        self.map.iter().for_each(|group| counts[usize::from(*group)] += 1);
        bits.write(0, 1); // no runs
        map_code.write_description(&counts, bits);
        self.map.iter().for_each(|group| map_code.write(usize::from(*group), bits));
        bits.write(0, 1); // as they are, not as ranks
    }

    pub(super) fn write_descriptions(&mut self, bits: &mut BitWriter<'_>) {
        if self.codes.len() < self.groups.len() {
            self.codes.resize_with(self.groups.len(), PrefixCode::default);
        }
        self.codes.iter_mut().zip(&self.groups).for_each(|(code, group)| code.write_description(&group.counts, bits));
    }

    /// Writes the bytes in `range` behind `waiting`, up to 32 bits that are not written yet; returns what then waits.
    #[inline]
    pub(super) fn write(
        &self,
        range: std::ops::Range<usize>,
        mut waiting: (u64, u32),
        bits: &mut BitWriter<'_>,
    ) -> (u64, u32) {
        for stored in &self.stored[range] {
            let code = &self.codes[usize::from(self.map[usize::from(stored >> 8) % CONTEXTS])];
            let (more, len) = code.code(usize::from(stored & 0xff));
            waiting = (waiting.0 | more << waiting.1, waiting.1 + len);
            if waiting.1 > 32 {
                bits.write(waiting.0, waiting.1);
                waiting = (0, 0);
            }
        }
        waiting
    }
}
