//! The two sides of the comparison, and what walkers of a dataset hand to it.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

use pointmill_format::{OpenOptions, ReadError};

use super::block::Block;
use super::measured::Measured;
use super::rules::Rules;
use super::sources::Sources;
use crate::finding::Findings;
use crate::memory::Budget;
use crate::options::ProgressFn;
use crate::place::Place;

/// How colours are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Colour {
    AsIs,
    Times257,
}

pub(super) const COLOURS: [Colour; 2] = [Colour::AsIs, Colour::Times257];

impl Colour {
    #[inline]
    pub(super) fn apply(self, rgb: [u64; 3], rules: &Rules) -> [u64; 3] {
        let wide = match self {
            Self::AsIs => rgb,
            Self::Times257 => rgb.map(|v| v.min(255) * 257),
        };
        let wide = if rules.rounds_dark { wide.map(rounded_dark) } else { wide };
        wide.map(|v| rules.channels.of(v))
    }
}

/// A channel of 16 bits as viewers show it, where they would take it for 8.
const fn rounded_dark(v: u64) -> u64 {
    match v {
        0..=127 => 0,
        128..=255 => 256,
        _ => v,
    }
}

/// Count and sum of hashes of records.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Sum {
    pub(super) count: u64,
    pub(super) hash: u128,
}

impl Sum {
    pub(super) fn add(&mut self, other: Self) {
        self.count += other.count;
        self.hash = self.hash.wrapping_add(other.hash);
    }
}

/// What a walker of a dataset hands its blocks of records to. Blocks are its to change.
pub(crate) type Sink<'a> = dyn FnMut(&mut Block) + 'a;

/// The side of the dataset, filled while its nodes are walked.
pub(crate) struct Sums {
    pub(super) rules: Rules,
    total: Mutex<(Sum, Block)>,
    blocks: Mutex<Vec<Block>>,
}

impl Sums {
    /// The sum so far.
    pub(super) fn total(&self) -> Sum {
        self.total.lock().map_or_else(|e| e.into_inner().0, |t| t.0)
    }

    /// What records are, for who fills blocks.
    pub(crate) fn rules(&self) -> &Rules {
        &self.rules
    }

    /// Leaves positions out of the comparison, before anything was taken in.
    pub(crate) fn ignore_positions(&mut self) {
        self.rules.compare_positions = false;
    }

    /// Takes in records, a node's or a batch's: `fill` gets a block to fill as often as it likes ([`Block::reset`]
    /// first), and hands each over to the sink.
    pub(crate) fn add(&self, fill: impl FnOnce(&mut Block, &mut Sink<'_>)) {
        let mut block = self.blocks.lock().map_or(None, |mut b| b.pop()).unwrap_or_default();
        let mut sum = Sum::default();
        fill(&mut block, &mut |block| {
            self.rules.mask(block);
            block.start_hashes(&self.rules.attributes, self.rules.rgb);
            for i in 0..block.len() {
                let hash = block.hash(i, rgb_of(block, &self.rules, i), block.position(i));
                sum.add(Sum { count: 1, hash });
            }
        });
        if let Ok(mut total) = self.total.lock() {
            total.0.add(sum);
        }
        if let Ok(mut blocks) = self.blocks.lock() {
            blocks.push(block);
        }
    }
}

/// The colour of a record, if the dataset has one.
#[inline]
pub(super) fn rgb_of(block: &Block, rules: &Rules, i: usize) -> Option<[u64; 3]> {
    let words = &block.words[rules.rgb?];
    words.get(3 * i..3 * i + 3)?.try_into().ok()
}

/// A dataset whose records can be read again, to look for those that differ.
pub(crate) trait Records: Sync {
    /// Hands over every readable record, in blocks and with its place, in parallel; in any order. Broken payloads are
    /// skipped: the walk has reported them.
    ///
    /// # Errors
    /// The operating system could not read.
    fn each_block(&self, rules: &Rules, work: &(dyn Fn(&mut Block, Place) + Sync)) -> Result<(), ReadError>;
}

/// Both sides, ready to be compared.
pub(crate) struct Against {
    pub(super) sources: Sources,
    pub(crate) sums: Sums,
    pub(super) measured: Mutex<Option<Measured>>,
}

/// Where the comparison reads the dataset again.
pub(crate) struct Context<'a> {
    pub(crate) records: &'a dyn Records,
    pub(crate) findings: &'a Findings,
    pub(crate) progress: &'a ProgressFn<'a>,
    /// What is left for the comparison.
    pub(crate) budget: &'a Budget,
}

impl Against {
    /// What was measured during [`Self::compare`].
    pub(crate) fn measured(&self) -> Option<Measured> {
        self.measured.lock().map_or(None, |measured| *measured)
    }

    /// Opens the sources.
    ///
    /// # Errors
    /// A file that cannot be opened or is not a scan.
    pub(crate) fn open(paths: &[PathBuf], options: &OpenOptions, rules: Rules) -> Result<Self, ReadError> {
        let sources = Sources::open(paths, options, &rules)?;
        Ok(Self {
            sources,
            sums: Sums { rules, total: Mutex::default(), blocks: Mutex::default() },
            measured: Mutex::default(),
        })
    }

    /// True if a scan has the attribute `name`, which is one of those that the conversion has computed.
    pub(crate) fn have_derived(&self, name: &str) -> bool {
        self.sources.not_in_dataset().iter().any(|n| n == name)
    }

    /// Integer positions of all points of the sources that take part, in any order; `None` if that is not `count`.
    ///
    /// # Errors
    /// A source that cannot be decoded to its end.
    pub(crate) fn positions(&self, count: u64, progress: &ProgressFn<'_>) -> Result<Option<Vec<[i64; 3]>>, ReadError> {
        let mut room = Vec::new();
        if room.try_reserve_exact(usize::try_from(count).unwrap_or(usize::MAX)).is_err() {
            return Ok(None);
        }
        let all: Mutex<Vec<[i64; 3]>> = Mutex::new(room);
        let more = AtomicBool::new(false);
        self.sources.each_block(&self.sums.rules, progress, "sources", |block, _| {
            if let Ok(mut all) = all.lock() {
                let mut kept = (0..block.len()).filter(|i| block.keep[*i]).map(|i| block.position(i));
                let room = (count as usize).saturating_sub(all.len());
                all.extend(kept.by_ref().take(room));
                more.fetch_or(kept.next().is_some(), Relaxed);
            }
        })?;
        let all = all.into_inner().unwrap_or_default();
        Ok((all.len() as u64 == count && !more.into_inner()).then_some(all))
    }
}
