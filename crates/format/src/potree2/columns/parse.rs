//! Finds what of a column is a copy of what was before.
//!
//! Values are stored from their lowest byte on, and neighbours differ in low bytes first: a value is compared with the one
//! before it, and where order does not say more, with others (`numbers.rs`).

use super::commands::Commands;
use super::contexts::{CONTEXTS, Counts, MAX_SIZE, Mode, weigh};
use super::logs::BIT;
use super::numbers::{COMMAND_COST, Numbers, element};

/// What a run costs beside its first byte.
const RUN_COST: u32 = 6 * BIT as u32;

/// A byte as it is costs at least that.
const MIN_LITERAL_COST: u32 = 2 * BIT as u32;

/// Some values of a column.
#[derive(Debug, Clone, Copy)]
pub(super) struct Part {
    /// Bytes of all of them.
    pub(super) len: usize,
    /// Bytes of an element.
    pub(super) size: usize,
    pub(super) kind: Kind,
}

/// Where bytes of an element may have been before.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// All elements are the same.
    Constant,
    /// Elements of one byte.
    Bytes,
    /// No element, of up to 16 bytes, has more in common with an earlier one than with the one before.
    Sorted,
    /// Elements of up to 8 bytes. Their bytes often equal those `inner` back in the same element; 0: they do not.
    Numbers { inner: usize },
}

/// Memory for the search, kept from column to column.
#[derive(Debug)]
pub(super) struct Search {
    numbers: Numbers,
    /// What a byte costs as it is, by its place in the element.
    costs: [u32; MAX_SIZE],
    counts: Box<Counts>,
}

impl Default for Search {
    fn default() -> Self {
        let (numbers, costs) = Default::default();
        Self { numbers, costs, counts: Box::new([[0; 256]; CONTEXTS]) }
    }
}

impl Search {
    /// Turns `parts`, which make up `bytes`, into commands; tells which contexts serve the bytes of the first.
    pub(super) fn run(&mut self, bytes: &[u8], parts: &[Part], commands: &mut Commands) -> Mode {
        commands.clear();
        let (mut mode, mut rest) = (Mode::Classes, bytes);
        for (number, part) in parts.iter().enumerate() {
            let (column, after) = rest.split_at(part.len);
            rest = after;
            if part.kind == Kind::Constant {
                constant(column.len(), part.size, commands);
                continue;
            }
            let (its_mode, costs) = weigh(column, part.size, &mut self.counts);
            self.costs = costs.map(|cost| cost.max(MIN_LITERAL_COST));
            if number == 0 {
                mode = its_mode;
            }
            match part.kind {
                Kind::Constant => {}
                Kind::Bytes => self.by_runs(column, commands),
                Kind::Sorted => self.by_neighbours(column, part.size, commands),
                Kind::Numbers { inner } => self.numbers.run(column, part.size, inner, &self.costs, commands),
            }
        }
        mode
    }

    /// Looks for runs of equal bytes.
    fn by_runs(&self, column: &[u8], commands: &mut Commands) {
        for run in column.chunk_by(|a, b| a == b) {
            let again = run.len() as u32 - 1;
            if again >= 2 && again.saturating_mul(self.costs[0]) > RUN_COST {
                commands.insert(1);
                commands.copy(again, 1);
            } else {
                commands.insert(again + 1);
            }
        }
    }

    /// Compares elements of up to 16 bytes with those before them.
    fn by_neighbours(&self, column: &[u8], size: usize, commands: &mut Commands) {
        let mut last = 0;
        for number in 0..column.len() / size {
            let value: u128 = u128::from_le_bytes(element(column, number, size));
            let differing = value ^ last;
            last = value;
            let mut at = 0;
            while at < size {
                let equal = if number == 0 {
                    0
                } else {
                    ((differing >> (8 * at)).trailing_zeros() as usize / 8).min(size - at)
                };
                if equal > 0 && self.pays(at, equal, size, commands) {
                    commands.copy(equal as u32, size as u32);
                    at += equal;
                } else {
                    let count = (equal + 1).min(size - at);
                    commands.insert(count as u32);
                    at += count;
                }
            }
        }
    }

    /// True if `equal` bytes from `at` on are cheaper as a copy.
    #[inline]
    fn pays(&self, at: usize, equal: usize, size: usize, commands: &Commands) -> bool {
        commands.continued() == Some(size as u32)
            || equal >= 2 && (at + equal == size || self.costs[at..at + equal].iter().sum::<u32>() > COMMAND_COST)
    }
}

/// An element and its repetitions.
fn constant(len: usize, size: usize, commands: &mut Commands) {
    let copied = if len >= size + 2 { len - size } else { 0 };
    commands.insert((len - copied) as u32);
    if copied > 0 {
        commands.copy(copied as u32, size as u32);
    }
}
