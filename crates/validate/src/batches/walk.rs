//! All batches, once, in Morton order: windows of batches are examined in parallel while the window before is put
//! together, which is the one thing that goes point by point from end to end.

use pointmill_format::ReadError;
use rayon::prelude::*;

use super::batch::Raw;
use super::blocks::{Cache, Reported};
use super::examine::{Seen, examine};
use super::figures::Errors;
use super::formulas::BATCH;
use super::levels::Levels;
use super::order::Key;
use super::ranges::Ranges;
use super::records::fill;
use super::task::{Task, slot_of};
use crate::check::Check;
use crate::finding::Finding;
use crate::options::Progress;
use crate::place::Place;

/// Results of all batches together.
#[derive(Debug, Default)]
pub(crate) struct Walked {
    /// Batches that could not be read.
    pub(crate) unreadable: u64,
    /// Points that are no lattice points.
    pub(crate) foreign: u64,
    /// Points whose lattice integers the planes do not determine.
    pub(crate) uncertain: u64,
    /// Cells of all levels that were not judged.
    pub(crate) uncertain_cells: u64,
    /// Least and greatest world coordinate of each axis.
    pub(crate) world: Option<[[f64; 2]; 3]>,
    pub(crate) errors: Errors,
    pub(crate) ranges: Ranges,
}

/// A batch after the parallel part; `None` if it could not be read.
type Examined = Option<(Seen, Ranges)>;

/// Walks all batches.
///
/// # Errors
/// The operating system cannot read the file.
pub(crate) fn walk(task: &Task<'_>) -> Result<Walked, ReadError> {
    let batches = task.header.batches;
    let window = task.window;
    let mut state = State::new(task);
    let mut cache = Cache::default();
    let reported = Reported::new(task.findings);
    let mut ready: Vec<Examined> = Vec::new();
    let mut first = 0;
    while first < batches {
        let last = (first + window).min(batches);
        let slots: Vec<(u64, u64)> = (first..last).map(|m| (m, slot_of(task.header, m))).collect();
        let before = std::mem::take(&mut ready);
        let (_, examined) = rayon::join(
            || state.add(before),
            || {
                let numbers: Vec<u64> = slots.iter().map(|s| s.1).collect();
                cache.prepare(task.bytes, task.header, task.columns, &numbers, &reported)?;
                slots.par_iter().map(|&(m, slot)| look(task, &cache, m, slot)).collect::<Result<Vec<_>, ReadError>>()
            },
        );
        ready = examined?;
        first = last;
        let done = (BATCH * last).min(task.header.points);
        (task.progress)(Progress { phase: "points", done, total: task.header.points });
    }
    state.add(ready);
    Ok(state.finish())
}

fn look(task: &Task<'_>, cache: &Cache, number: u64, slot: u64) -> Result<Examined, ReadError> {
    let Some(raw) = Raw::read(task, cache, number, slot)? else { return Ok(None) };
    let (seen, points) = examine(task, &raw);
    if let Some(sums) = task.sums {
        let rules = sums.rules();
        sums.add(|block, sink| fill(&raw, &points, &seen.original, rules, block, sink));
    }
    Ok(Some((seen, Ranges::of(task.description, &raw))))
}

/// The pass in Morton order.
struct State<'a, 'b> {
    task: &'a Task<'b>,
    levels: Option<Levels>,
    /// Key of the point before.
    last: Option<Key>,
    walked: Walked,
}

impl<'a, 'b> State<'a, 'b> {
    fn new(task: &'a Task<'b>) -> Self {
        let levels = task.header.levels().then(|| Levels::new(task.header.averaged()));
        Self { task, levels, last: None, walked: Walked::default() }
    }

    fn add(&mut self, batches: Vec<Examined>) {
        for batch in batches {
            match batch {
                Some((seen, ranges)) => self.add_batch(seen, ranges),
                None => {
                    self.walked.unreadable += 1;
                    self.last = None;
                    if let Some(levels) = &mut self.levels {
                        levels.gap(self.task.findings);
                    }
                }
            }
        }
    }

    fn add_batch(&mut self, mut seen: Seen, ranges: Ranges) {
        if let Some(levels) = &mut self.levels {
            levels.add(&seen, self.task.findings);
        }
        if let Some([first, last]) = seen.ends.take()
            && let Some(before) = self.last.replace(last)
            && before.is_behind(&first)
        {
            let subject = format!("place of point {}", first.index);
            let expected = format!("behind {}", before.describe());
            let finding = Finding::new(Check::StorageOrder, subject, expected, first.describe());
            self.task.findings.push(finding.points(1).at(Place::Batch(seen.number as u32)));
        }
        let walked = &mut self.walked;
        walked.foreign += seen.foreign;
        walked.uncertain += seen.uncertain;
        walked.errors.merge(&seen.errors);
        walked.ranges.merge(ranges);
        let world = walked.world.get_or_insert(seen.world);
        for (all, batch) in world.iter_mut().zip(seen.world) {
            *all = [all[0].min(batch[0]), all[1].max(batch[1])];
        }
    }

    fn finish(mut self) -> Walked {
        if let Some(levels) = &mut self.levels {
            levels.finish(self.task.findings);
            self.walked.uncertain_cells = levels.uncertain_cells;
        }
        self.walked
    }
}
