//! The one pass over the inputs: every point decoded once, put on the job lattice, and kept in blocks of records that
//! are grouped by the cells of a coarse grid, in memory or in one spill file.

mod batch;
mod columns;
pub(crate) mod load;
mod moments;
pub(crate) mod outliers;
mod partition;
mod stats;
mod store;

use std::collections::HashMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use pointmill_format::{Advice, NodeKey, Scratch};

pub(crate) use batch::{Grouping, is_eight_bit};
pub(crate) use moments::Moments;
pub(crate) use partition::Partition;
pub(crate) use stats::{Range, Stats};
pub(crate) use store::{Segment, Store};

use crate::error::ConvertError;
use crate::events::Events;
use crate::grid::{Cube, LatticeBounds};
use crate::job::Job;
use crate::plan::{OnFault, Plan, Target};

/// All points of the job.
pub(crate) struct Gathered {
    pub(crate) store: Store,
    /// Every occupied cell of the octree level (or levels) of the partition, in Morton order.
    pub(crate) cells: Vec<Cell>,
    pub(crate) stats: Stats,
    pub(crate) cube: Cube,
    /// Added to the `i32` of a record it gives the job lattice coordinate.
    pub(crate) base: [i64; 3],
}

/// The points of one octree cell, wherever they are stored.
#[derive(Debug, Clone)]
pub(crate) struct Cell {
    pub(crate) key: NodeKey,
    pub(crate) points: u64,
    pub(crate) segments: Vec<Segment>,
    /// All points share one place (known only for cells that had to be looked into).
    pub(crate) is_one_place: bool,
    /// Sums and extremes of the positions, if some output needs them.
    pub(crate) moments: Moments,
}

/// How a pass over the inputs ended.
pub(crate) enum Outcome {
    /// All points are there.
    Complete(Box<Gathered>),
    /// The headers misled us; these are the true bounds (empty: no points at all). Try again with them.
    Retry(LatticeBounds),
    /// No point passed the filter (or there was none).
    Empty(Box<Stats>),
}

pub(crate) struct Pass<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) job: &'a Job,
    pub(crate) partition: Partition,
    pub(crate) store: Store,
    /// Some output needs the moments of the cells.
    wants_moments: bool,
    /// True once a point did not fit the partition: from then on only bounds are wanted.
    pub(crate) misled: AtomicBool,
}

/// Where a batch of points puts its cells, by packed cell.
type Segments = HashMap<u64, CellPart, batch::CellHash>;

/// One thread's part of a cell.
#[derive(Debug, Default)]
struct CellPart {
    segments: Vec<Segment>,
    moments: Moments,
}

/// Runs the pass with bounds that are believed until they prove wrong.
pub(crate) fn gather(
    plan: &Plan,
    job: &Job,
    hint: Option<LatticeBounds>,
    temp_dir: &Path,
    store_bytes: u64,
    pool: &rayon::ThreadPool,
    events: &dyn Events,
) -> Result<Outcome, ConvertError> {
    let partition = Partition::choose(hint, &job.lattice, job.points_declared);
    let pass = Pass {
        plan,
        job,
        partition,
        store: Store::new(temp_dir, job.schema.stride, plan.targets.len() as u32, store_bytes),
        wants_moments: plan.targets.iter().any(|t| matches!(t, Target::Bintree(_))),
        misled: false.into(),
    };
    let (stats, segments) = pass.run(pool, events)?;
    let Pass { partition, store, misled, .. } = pass;
    if stats.bounds.is_empty() {
        return Ok(Outcome::Empty(Box::new(stats)));
    }
    let Ok(cube) = Cube::around(&stats.bounds, &job.lattice) else {
        return Ok(Outcome::Retry(stats.bounds));
    };
    if misled.into_inner() || !partition.fits(&cube, &stats.bounds) {
        return Ok(Outcome::Retry(stats.bounds));
    }
    let mut cells: Vec<Cell> = segments
        .into_iter()
        .map(|(packed, CellPart { mut segments, moments })| {
            segments.sort_unstable_by_key(|s| (s.block, s.start));
            let points = segments.iter().map(|s| u64::from(s.count)).sum();
            Cell { key: partition.node(packed, &cube), points, segments, is_one_place: false, moments }
        })
        .collect();
    cells.sort_unstable_by(|a, b| crate::morton::compare(cell_xyz(&a.key), cell_xyz(&b.key)));
    let base = partition.base();
    Ok(Outcome::Complete(Box::new(Gathered { store, cells, stats, cube, base })))
}

fn cell_xyz(key: &NodeKey) -> [u32; 3] {
    [key.x, key.y, key.z]
}

impl Pass<'_> {
    fn run(&self, pool: &rayon::ThreadPool, events: &dyn Events) -> Result<(Stats, Segments), ConvertError> {
        let tasks: Vec<(usize, usize)> = self
            .job
            .sources
            .iter()
            .enumerate()
            .flat_map(|(s, source)| (0..source.scan.pieces().len()).map(move |p| (s, p)))
            .collect();
        let next = AtomicUsize::new(0);
        let failed: Mutex<Option<(usize, ConvertError)>> = Mutex::new(None);
        let parts = pool.broadcast(|_| {
            let mut worker = batch::Worker::new(self);
            let mut scratch = Scratch::default();
            loop {
                let task = next.fetch_add(1, Ordering::Relaxed);
                let Some(&(source, piece)) = tasks.get(task) else { break };
                if failed.lock().is_ok_and(|f| f.as_ref().is_some_and(|(t, _)| *t < task)) {
                    break;
                }
                if let Err(error) = self.piece(source, piece, &mut worker, &mut scratch, events) {
                    if let Ok(mut failed) = failed.lock()
                        && failed.as_ref().is_none_or(|(t, _)| task < *t)
                    {
                        *failed = Some((task, error));
                    }
                    break;
                }
            }
            worker.finish()
        });
        if let Ok(Some((_, error))) = failed.into_inner() {
            return Err(error);
        }
        let mut stats = Stats::new(&self.job.schema, self.job.sources.len());
        let mut segments = Segments::default();
        for part in parts {
            let (part, cells) = part?;
            stats.merge(&part);
            for (cell, mut more) in cells {
                let part: &mut CellPart = segments.entry(cell).or_default();
                part.segments.append(&mut more.segments);
                part.moments.merge(&more.moments);
            }
        }
        Ok((stats, segments))
    }

    /// Decodes one piece; what a broken piece held is counted or is an error, by policy.
    fn piece(
        &self,
        source: usize,
        piece: usize,
        worker: &mut batch::Worker,
        scratch: &mut Scratch,
        events: &dyn Events,
    ) -> Result<(), ConvertError> {
        let scan = &self.job.sources[source].scan;
        let mut outcome = Ok(());
        let mut points = 0u64;
        let decoded = scan.decode(piece, &self.job.sources[source].wanted, scratch, &mut |batch| {
            if events.stop_requested() {
                outcome = Err(ConvertError::Interrupted);
                return ControlFlow::Break(());
            }
            points += batch.len() as u64;
            outcome = worker.take(source, batch);
            events.advance(batch.len() as u64);
            if outcome.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        outcome?;
        let lost = scan.pieces()[piece].points.saturating_sub(points);
        match decoded {
            Ok(()) if lost == 0 => Ok(()),
            Ok(()) => Err(ConvertError::Internal(format!(
                "{}: a piece of {} points gave {points}",
                scan.info().path.display(),
                scan.pieces()[piece].points
            ))),
            Err(error) if self.plan.unreadable == OnFault::Skip => {
                events.warning(&format!("left out {lost} points: {error}"));
                worker.stats.unreadable += lost;
                worker.stats.warnings.push(format!("left out {lost} points: {error}"));
                Ok(())
            }
            Err(error) if error.advice().is_none() => Err(error.advise(Advice::SkipUnreadable).into()),
            Err(error) => Err(error.into()),
        }
    }
}
