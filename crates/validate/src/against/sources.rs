//! The scans a dataset was made from, read as blocks of records in the dataset's terms.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex};

use pointmill_format::{Attribute, AttributeType, OpenOptions, ReadError, Scratch};
use rayon::prelude::*;

use super::block::{BLOCK_POINTS, Block};
use super::opened::{Common, Look, Opened};
use super::rules::Rules;
use super::shelf::{Gathered, PIECES_TOGETHER, Shelf, Source};
use crate::options::{Progress, ProgressFn};

/// All scans.
pub(crate) struct Sources {
    pub(crate) list: Vec<Source>,
    /// (source, first piece) of all that a thread decodes together.
    pairs: Vec<(u32, u32)>,
    pub(crate) points: u64,
    shelf: Shelf,
    common: Common,
    /// Names of columns that the dataset does not have, sorted.
    not_in_dataset: Vec<String>,
    /// What a thread takes to decode a piece, at most.
    decode_bytes: u64,
}

impl Sources {
    /// Looks at the files, in parallel; decodes nothing, and leaves few of them open.
    pub(crate) fn open(paths: &[PathBuf], options: &OpenOptions, rules: &Rules) -> Result<Self, ReadError> {
        let shelf = Shelf::new(options);
        let looks: Vec<Result<Look, ReadError>> = paths
            .par_iter()
            .enumerate()
            .map(|(at, path)| shelf.get(at, path, rules).map(|open| open.look(rules)))
            .collect();
        let all = Gathered::of(paths, looks, rules)?;
        let rounds = |(types, a): (Vec<AttributeType>, &Attribute)| {
            a.ty == AttributeType::Float64 && (rules.has_no_wide_integers || types.len() > 1)
        };
        Ok(Self {
            list: all.list,
            pairs: all.pairs,
            points: all.points,
            shelf,
            common: Common {
                rounds: all.types.into_iter().zip(&rules.attributes).map(rounds).collect(),
                is_marked: all.may_move,
                deviating: rules.constants.iter().map(|_| AtomicU64::new(0)).collect(),
                not_following: rules.follows.iter().map(|_| AtomicU64::new(0)).collect(),
            },
            not_in_dataset: all.names.into_iter().collect(),
            decode_bytes: all.decode_bytes,
        })
    }

    /// Names of columns of the scans that the dataset does not have, sorted.
    pub(crate) fn not_in_dataset(&self) -> Vec<String> {
        self.not_in_dataset.clone()
    }

    /// What a thread takes to decode a piece and to hold a block of it, bytes.
    pub(crate) fn thread_bytes(&self) -> u64 {
        const BLOCK: u64 = 4 << 20;
        BLOCK + self.decode_bytes
    }

    /// Attributes that were not written for a reason that does not hold: name, the reason, points that differ.
    pub(crate) fn deviating(&self, rules: &Rules) -> Vec<(String, &'static str, u64)> {
        let constant = "one value throughout, as stated in attributesDropped";
        let follows = "values that follow from another attribute, as stated in attributesOmitted";
        let constants = rules.constants.iter().map(|(name, _)| (name, constant)).zip(&self.common.deviating);
        let followers = rules.follows.iter().map(|rule| (&rule.name, follows)).zip(&self.common.not_following);
        let counts = constants.chain(followers);
        let counts = counts.map(|((name, expected), count)| (name.clone(), expected, count.load(Relaxed)));
        counts.filter(|(_, _, count)| *count > 0).collect()
    }

    /// Decodes everything in parallel and hands it over in blocks, with the index of the source and whether the block
    /// has a colour value above 255. `work` is called from many threads.
    pub(crate) fn each_block(
        &self,
        rules: &Rules,
        progress: &ProgressFn<'_>,
        phase: &'static str,
        work: impl Fn(&mut Block, usize) + Sync,
    ) -> Result<(), ReadError> {
        let idle: Mutex<Vec<(Scratch, Block)>> = Mutex::default();
        let done = AtomicU64::new(0);
        let failed = AtomicBool::new(false);
        let counts = self.common.deviating.iter().chain(&self.common.not_following);
        counts.for_each(|count| count.store(0, Relaxed));
        self.pairs.par_iter().with_max_len(1).try_for_each(|&(at, first)| {
            if failed.load(Relaxed) {
                return Ok(()); // another piece brings the error
            }
            let (at, first) = (at as usize, first as usize);
            let source = self.open_again(at, rules)?;
            let pop = idle.lock().map_or(None, |mut idle| idle.pop());
            let (mut scratch, mut block) = pop.unwrap_or_default();
            let wanted = source.wanted();
            let pieces = first..(first + PIECES_TOGETHER as usize).min(self.list[at].pieces);
            let result = pieces.clone().try_for_each(|piece| {
                scratch.next_piece = Some(piece + 1).filter(|next| pieces.contains(next));
                source.scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
                    for start in (0..batch.len()).step_by(BLOCK_POINTS) {
                        let points = (batch.len() - start).min(BLOCK_POINTS);
                        source.fill(batch, start, points, (&self.common, rules), &mut block);
                        work(&mut block, at);
                    }
                    let batch_points = batch.len() as u64;
                    let done = done.fetch_add(batch_points, Relaxed) + batch_points;
                    progress(Progress { phase, done, total: self.points });
                    ControlFlow::Continue(())
                })
            });
            if let Ok(mut idle) = idle.lock() {
                idle.push((scratch, block));
            }
            if result.is_err() {
                failed.store(true, Relaxed);
            }
            result
        })
    }
}

impl Sources {
    fn open_again(&self, at: usize, rules: &Rules) -> Result<Arc<Opened>, ReadError> {
        let path = &self.list[at].path;
        let source = self.shelf.get(at, path, rules)?;
        match source.scan.pieces().len() == self.list[at].pieces {
            true => Ok(source),
            false => Err(ReadError::broken(path, None, "has changed since it was opened first")),
        }
    }
}
