//! Numbers of up to 8 bytes: a value may begin with the same bytes as an earlier one, or be the same from some byte on. The
//! last such is found by its bytes, and the cheapest way through an element is taken.

use super::commands::Commands;
use super::logs::{BIT, log2};

/// Elements have no more bytes than this.
pub(super) const MAX_NUMBER: usize = 8;

/// What a command costs beside its bytes.
pub(super) const COMMAND_COST: u32 = 2 * BIT as u32;

/// What a distance costs, beside the logarithm of how many elements it goes back.
const DISTANCE_COST: u32 = 3 * BIT as u32;

/// What the distance of one element costs.
const NEAR_COST: u32 = BIT as u32;

/// Tables have up to 2^this places.
const MAX_TABLE_BITS: u32 = 14;

/// After so many elements, tables that did not serve one of [`SERVES`] elements are given up.
const TRIALS: [usize; 2] = [2048, 8192];
const SERVES: u32 = 64;

/// Bytes of a short match.
const SHORT: usize = 3;

/// Where some bytes of elements were last.
#[derive(Debug, Clone, Copy)]
struct Table {
    /// Where in an element the bytes begin.
    start: u8,
    /// Bits of an element before and behind them.
    before: u8,
    behind: u8,
    /// Where its places begin.
    at: usize,
    /// How many elements it served.
    served: u32,
}

/// How the cheapest way comes to a byte of an element.
#[derive(Debug, Clone, Copy, Default)]
struct Step {
    cost: u32,
    /// Where the step begins.
    from: u8,
    /// The table that served, plus one.
    table: u8,
    /// The distance; 0: a byte as it is.
    distance: u32,
}

/// An element on its way.
struct Way<'a> {
    column: &'a [u8],
    number: usize,
    value: u64,
    /// Its bits that are not those of the element before.
    differing: u64,
    size: usize,
    inner: usize,
    costs: &'a [u32],
}

/// Memory for the search, kept from column to column.
#[derive(Debug, Default)]
pub(super) struct Numbers {
    tables: Vec<Table>,
    /// Numbers of elements, plus `base`.
    places: Vec<u32>,
    /// Numbers below are of earlier columns.
    base: u32,
    steps: [Step; MAX_NUMBER + 1],
}

impl Numbers {
    /// Turns a column into commands. `inner`: bytes often equal those so far back in the same element; 0: they do not.
    /// `costs`: what a byte costs as it is, by its place in the element, in parts of a bit.
    pub(super) fn run(&mut self, column: &[u8], size: usize, inner: usize, costs: &[u32], commands: &mut Commands) {
        let count = column.len() / size;
        let table_bits = (count.max(2) as u32).ilog2().clamp(8, MAX_TABLE_BITS);
        self.prepare(size, table_bits);
        let mut last = 0;
        for number in 0..count {
            let value = u64::from_le_bytes(element(column, number, size));
            let differing = value ^ last;
            last = value;
            if number == 0 {
                commands.insert(size as u32);
            } else if differing == 0 {
                commands.copy(size as u32, size as u32);
                continue;
            } else {
                let way = Way { column, number, value, differing, size, inner, costs };
                self.find_way(&way, table_bits, commands);
                self.take_way(size, commands);
            }
            for table in &self.tables {
                self.places[table.slot(value, table_bits)] = self.base + number as u32;
            }
            if TRIALS.contains(&number) {
                self.tables.retain(|table| table.served * SERVES > number as u32);
            }
        }
    }

    /// The cheapest way through an element that differs from the one before.
    fn find_way(&mut self, way: &Way<'_>, table_bits: u32, commands: &Commands) {
        let Way { size, value, differing, costs, .. } = *way;
        let Self { tables, places, base, steps } = self;
        steps[1..=size].fill(Step { cost: u32::MAX, ..Step::default() });
        let mut table = 0;
        for from in 0..size {
            let cost = steps[from].cost;
            let step = |steps: &mut [Step], to: usize, cost: u32, table: usize, distance: u32| {
                if cost < steps[to].cost {
                    steps[to] = Step { cost, from: from as u8, table: table as u8, distance };
                }
            };
            step(steps, from + 1, cost + costs[from], 0, 0);
            let equal = equal_bytes(differing, from, size);
            if from == 0 && equal > 0 && commands.continued() == Some(size as u32) {
                step(steps, equal, 0, 0, size as u32);
            } else if equal >= 2 {
                step(steps, from + equal, cost + COMMAND_COST + NEAR_COST, 0, size as u32);
            }
            if from == way.inner && from > 0 {
                let same = equal_bytes(value ^ value << (8 * from), from, size);
                if same >= 2 {
                    step(steps, from + same, cost + COMMAND_COST + NEAR_COST, 0, from as u32);
                }
            }
            if from + equal >= size {
                break;
            }
            while table < tables.len() && usize::from(tables[table].start) == from {
                let seen = places[tables[table].slot(value, table_bits)];
                table += 1;
                if seen < *base {
                    continue;
                }
                let back = way.number as u32 - (seen - *base);
                let price = cost + COMMAND_COST + DISTANCE_COST + log2(back) as u32;
                if price >= steps[size].cost {
                    continue;
                }
                let there = u64::from_le_bytes(element(way.column, way.number - back as usize, size));
                let same = equal_bytes(there ^ value, from, size);
                if same >= 2 {
                    step(steps, from + same, price, table, back * size as u32);
                }
            }
        }
    }

    /// Tells the steps of the cheapest way.
    fn take_way(&mut self, size: usize, commands: &mut Commands) {
        let (mut way, mut len, mut to) = ([0; MAX_NUMBER], 0, size);
        while to > 0 {
            way[len] = to;
            len += 1;
            to = usize::from(self.steps[to].from);
        }
        for to in way[..len].iter().rev() {
            let step = self.steps[*to];
            let count = (*to - usize::from(step.from)) as u32;
            if step.distance == 0 {
                commands.insert(count);
            } else {
                commands.copy(count, step.distance);
            }
            if step.table > 0 {
                self.tables[usize::from(step.table) - 1].served += 1;
            }
        }
    }

    /// Tables for a column; what they held is forgotten.
    fn prepare(&mut self, size: usize, table_bits: u32) {
        self.tables.clear();
        for start in 0..(size + 1).saturating_sub(SHORT).max(1) {
            let tail = size - start;
            for len in [tail, SHORT.min(tail)].into_iter().skip(usize::from(tail <= SHORT)) {
                let (before, behind) = (8 * start as u8, 64 - 8 * (start + len) as u8);
                let at = self.tables.len() << table_bits;
                self.tables.push(Table { start: start as u8, before, behind, at, served: 0 });
            }
        }
        let len = self.tables.len() << table_bits;
        if self.places.len() < len {
            self.places.resize(len, 0);
        }
        self.base = self.base.saturating_add(1 << 22);
        if self.base > u32::MAX - (1 << 23) {
            self.places.fill(0);
            self.base = 1;
        }
    }
}

impl Table {
    /// The place of the bytes of an element.
    #[inline]
    fn slot(&self, value: u64, table_bits: u32) -> usize {
        let bytes = value << self.behind >> self.behind >> self.before;
        self.at + (bytes.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> (64 - table_bits)) as usize
    }
}

/// How many bytes from `at` on do not differ.
#[inline]
fn equal_bytes(differing: u64, at: usize, size: usize) -> usize {
    ((differing >> (8 * at)).trailing_zeros() as usize / 8).min(size - at)
}

/// An element, the bytes behind it zero.
#[inline]
pub(super) fn element<const N: usize>(column: &[u8], number: usize, size: usize) -> [u8; N] {
    let at = number * size;
    let mut whole = [0; N];
    if size == N {
        whole.copy_from_slice(&column[at..at + N]);
    } else {
        whole[..size].copy_from_slice(&column[at..at + size]);
    }
    whole
}
