//! Units of reading: consecutive pieces of scans, and what is left of them once they are read. Without a job there is one.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::context::{Collected, Context};
use crate::cloud::{SafeBlock, SourceStats, Stats};
use crate::error::ConvertError;
use crate::job::{Job, SharedJob, UnitReader};
use crate::runtime::{Consumer, Reservation, Runtime};
use crate::sources::Sources;
use crate::unit_name::{Stage, UnitName};

/// What the threads have made of a unit.
pub(super) struct Unit {
    pub(super) stats: Stats,
    pub(super) collected: Collected,
    pub(super) room: Reservation,
    /// By source, those that were read; empty without a job.
    pub(super) seen: Vec<(u32, SourceStats)>,
}

/// A unit as a job keeps it.
#[derive(Serialize, Deserialize)]
pub(super) struct Kept {
    /// Of the pairs of pieces.
    pub(super) pairs: Range<usize>,
    pub(super) stats: Stats,
    /// Segments count blocks from the first of the unit.
    pub(super) collected: Collected,
    pub(super) seen: Vec<(u32, SourceStats)>,
    pub(super) blocks: Vec<SafeBlock>,
    /// The pass has been misled, in this unit or before.
    pub(super) misled: bool,
}

/// The same that is written, which needs nothing of its own.
#[derive(Serialize)]
struct Keeping<'a> {
    pairs: Range<usize>,
    stats: &'a Stats,
    collected: &'a Collected,
    seen: &'a [(u32, SourceStats)],
    blocks: Vec<SafeBlock>,
    misled: bool,
}

/// Pairs of pieces with about so many points, as headers say; those of a unit follow one another.
pub(super) fn units(sources: &Sources, points: u64) -> Vec<Range<usize>> {
    let (mut units, mut start, mut sum) = (Vec::new(), 0, 0u64);
    for pair in 0..sources.pairs() {
        sum += sources.pair_points(pair);
        if sum >= points {
            units.push(start..pair + 1);
            (start, sum) = (pair + 1, 0);
        }
    }
    units.extend((start < sources.pairs()).then(|| start..sources.pairs()));
    units
}

/// Puts a unit into the job as soon as its records are safe, which is not waited for.
pub(super) fn keep(
    job: &Job,
    context: &Context<'_>,
    number: u64,
    pairs: Range<usize>,
    first_block: u32,
    unit: &mut Unit,
    rt: &Runtime<'_>,
) -> Result<(), ConvertError> {
    let blocks: Vec<u32> = (first_block..context.store.next_block()?).collect();
    let written = rt.in_parallel(
        blocks.len(),
        Vec::new,
        |safe, i| {
            safe.push((blocks[i], context.store.write_out(blocks[i])?));
            Ok(())
        },
        |safe| safe,
    )?;
    let mut written: Vec<(u32, SafeBlock)> = written.into_iter().flatten().collect();
    written.sort_unstable_by_key(|(block, _)| *block);
    let blocks = written.into_iter().map(|(_, block)| block).collect();
    let file = context.store.file()?;
    keep_by(context, pairs, first_block, blocks, unit, |kept| job.add(context.pass, number, kept, file))
}

/// The same for a job that several processes share; the records are in the file `records`.
pub(super) fn keep_shared(
    job: &SharedJob,
    context: &Context<'_>,
    number: u64,
    pairs: Range<usize>,
    records: &str,
    unit: &mut Unit,
) -> Result<(), ConvertError> {
    let blocks = context.store.secure(0)?;
    keep_by(context, pairs, 0, blocks, unit, |kept| {
        job.keep(name(context.pass, number), |file| {
            file.put(&records)?;
            file.put(kept)
        })
    })
}

fn keep_by(
    context: &Context<'_>,
    pairs: Range<usize>,
    first_block: u32,
    blocks: Vec<SafeBlock>,
    unit: &mut Unit,
    add: impl FnOnce(&Keeping<'_>) -> Result<(), ConvertError>,
) -> Result<(), ConvertError> {
    unit.collected.shift_back(first_block);
    let (stats, collected, seen) = (&unit.stats, &unit.collected, &unit.seen[..]);
    let added = add(&Keeping { pairs, stats, collected, seen, blocks, misled: context.is_misled() });
    unit.collected.shift(first_block);
    added
}

/// What a unit of reading is called.
pub(super) fn name(pass: u32, number: u64) -> UnitName {
    UnitName { stage: Stage::Read { pass }, number }
}

/// What a job has of a unit, its records in the store, which looks at them when they are needed; `None`: nothing.
pub(super) fn recall(
    job: &Job,
    context: &Context<'_>,
    number: u64,
    pairs: &Range<usize>,
) -> Result<Option<Unit>, ConvertError> {
    let Some(kept) = job.unit::<Kept>(context.pass, number)? else { return Ok(None) };
    if !kept.can_be_of(context, pairs) {
        return Err(job.damaged_unit(context.pass, number));
    }
    let first = context.store.adopt(&kept.blocks)?;
    kept.taken(context, first).map(Some)
}

/// The same for a job that several processes share. Its records are not looked at here: the sums of all points tell in the
/// end whether they are as they were.
pub(super) fn recall_shared(
    job: &SharedJob,
    context: &Context<'_>,
    number: u64,
    pairs: &Range<usize>,
) -> Result<Option<Unit>, ConvertError> {
    let unit = name(context.pass, number);
    let read = |file: &UnitReader| {
        let (records, kept) = (file.get::<String>(0)?, file.get::<Kept>(1)?);
        // a name, no path to elsewhere
        let is_sound =
            kept.can_be_of(context, pairs) && records.starts_with(&unit.to_string()) && !records.contains('/');
        if is_sound { Ok((records, kept)) } else { Err(file.damaged(0)) }
    };
    let Some((records, kept)) = job.recall(unit, read)? else { return Ok(None) };
    let first = context.store.adopt_from(job.records(&records), &kept.blocks)?;
    kept.taken(context, first).map(Some)
}

impl Kept {
    /// The unit, whose blocks have got numbers from `first` on.
    fn taken(self, context: &Context<'_>, first: u32) -> Result<Unit, ConvertError> {
        let Self { stats, mut collected, seen, misled, .. } = self;
        collected.shift(first);
        context.note_misled(misled);
        let mut room = Reservation::new(context.memory, Consumer::Cells);
        room.resize(collected.bytes())?;
        Ok(Unit { stats, collected, room, seen })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sources::Source;

    #[test]
    fn units_follow_one_another_and_hold_every_pair() {
        let scans = [(1000, 10), (0, 0), (50, 1), (10_000, 4)];
        let sources = Sources::with_pairs(scans.map(|(points, pieces)| Source::of_pieces(points, pieces)).into());
        assert_eq!(units(&sources, 400), [0..2, 2..4, 4..7, 7..8]);
        let all = 0..8;
        assert_eq!(units(&sources, u64::MAX), [all]);
        assert_eq!(units(&Sources::with_pairs(Vec::new()), 400), []);
    }
}
