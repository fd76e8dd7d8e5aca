//! One pass over the sources: decoded, filtered, encoded and written by all threads, in the order of their pieces.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use pointmill_format::scan::las::write::Tally;
use pointmill_format::{Advice, Changes, PointBatch, Scratch};

use super::encoder::Encoder;
use super::order::{Order, Part};
use super::room::Room;
use super::rows::{Block, Target};
use super::units::Units;
use crate::cloud::Stats;
use crate::error::ConvertError;
use crate::gather::{Reading, Rows, Visit, select, stored_columns};
use crate::plan::OnFault;
use crate::runtime::Workers;
use crate::warning::{SkippedPoints, reason_of};

/// What a pass over all points has found.
pub(super) struct Counted {
    pub(super) stats: Stats,
    pub(super) tally: Tally,
    /// By attribute of the schema: values that the file cannot hold.
    pub(super) changes: Vec<Changes>,
    /// A position does not fit the integers of the file, or a value what its header says: the file is worth nothing.
    pub(super) is_misled: bool,
}

/// A pass over the sources.
pub(super) struct Pass<'a> {
    pub(super) reading: &'a Reading<'a>,
    pub(super) encoder: &'a dyn Encoder,
    pub(super) target: Target,
    pub(super) order: &'a Order<'a>,
    pub(super) workers: &'a Workers<'a>,
    room: Room,
    is_misled: AtomicBool,
}

/// What a thread works with.
struct Worker<'a> {
    visit: Option<Visit<'a>>,
    scratch: Scratch,
    selection: Vec<u32>,
    block: Block,
    parts: Vec<Part>,
    stats: Stats,
    tally: Tally,
    changes: Vec<Changes>,
}

impl<'a> Pass<'a> {
    pub(super) fn new(
        reading: &'a Reading<'a>,
        encoder: &'a dyn Encoder,
        target: Target,
        order: &'a Order<'a>,
        workers: &'a Workers<'a>,
        room: Room,
    ) -> Self {
        Self { reading, encoder, target, order, workers, room, is_misled: AtomicBool::new(false) }
    }

    /// Reads every point.
    pub(super) fn run(&self) -> Result<Counted, ConvertError> {
        let Reading { sources, intake, .. } = *self.reading;
        let units = Units::of(sources);
        let parts = self.workers.in_parallel_or(
            units.count(),
            || Worker {
                visit: None,
                scratch: Scratch::default(),
                selection: Vec::new(),
                block: Block::new(self.target, &intake.schema),
                parts: Vec::new(),
                stats: Stats::new(&intake.schema),
                tally: Tally::default(),
                changes: vec![Changes::default(); intake.schema.attributes.len()],
            },
            |worker, unit| {
                if !self.order.admit(unit) {
                    return Ok(());
                }
                let (source, pieces) = units.get(unit, sources);
                for piece in pieces.clone() {
                    worker.scratch.next_piece = Some(piece + 1).filter(|next| pieces.contains(next));
                    self.piece(unit, source, piece, worker)?;
                }
                self.encode(worker)?;
                self.order.finish(unit, std::mem::take(&mut worker.parts))
            },
            |worker| {
                worker.visit.map_or(Ok(()), |visit| visit.end(self.reading))?;
                Ok::<_, ConvertError>((worker.stats, worker.tally, worker.changes))
            },
            |unit| self.order.stop_above(unit),
        )?;
        let mut counted = Counted {
            stats: Stats::new(&intake.schema),
            tally: Tally::default(),
            changes: vec![Changes::default(); intake.schema.attributes.len()],
            is_misled: self.is_misled.load(Ordering::Relaxed),
        };
        for part in parts {
            let (stats, tally, changes) = part?;
            counted.stats.merge(&stats);
            counted.tally.merge(&tally);
            counted.changes.iter_mut().zip(&changes).for_each(|(all, some)| all.merge(some));
        }
        counted.stats.sources = self.reading.take_seen()?;
        Ok(counted)
    }

    /// Decodes one piece; what a broken piece held is counted or is an error, by policy.
    fn piece(&self, unit: usize, source: usize, piece: usize, worker: &mut Worker<'a>) -> Result<(), ConvertError> {
        if let Some(left) = worker.visit.take_if(|visit| visit.index != source) {
            left.end(self.reading)?;
        }
        let mut visit = match worker.visit.take() {
            Some(visit) => visit,
            None => Visit::begin(self.reading, source)?,
        };
        let scan = Arc::clone(&visit.scan);
        let mut scratch = std::mem::take(&mut worker.scratch);
        let (mut outcome, mut points) = (Ok(()), 0u64);
        let decoded = scan.decode(piece, &visit.intake.wanted, &mut scratch, &mut |batch| {
            outcome = self.workers.check_stop();
            if outcome.is_err() {
                return ControlFlow::Break(());
            }
            points += batch.len() as u64;
            outcome = self.take(unit, &mut visit, batch, worker);
            self.workers.advance(batch.len() as u64);
            if outcome.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        });
        (worker.visit, worker.scratch) = (Some(visit), scratch);
        outcome?;
        let lost = scan.pieces()[piece].points.saturating_sub(points);
        match decoded {
            Ok(()) if lost == 0 => Ok(()),
            Ok(()) => {
                let path = scan.info().path.display().to_string();
                Err(ConvertError::Internal(format!("{path}: a piece gave {lost} points less than it has")))
            }
            Err(error) if self.reading.plan.unreadable == OnFault::Skip => {
                let path = scan.info().path.clone();
                let skipped = SkippedPoints { path, error: reason_of(&error), points: lost };
                self.workers.warn(&skipped.clone().into());
                worker.stats.unreadable += lost;
                worker.stats.skipped.push(skipped);
                Ok(())
            }
            Err(error) if error.advice().is_none() => Err(error.advise(Advice::SkipUnreadable).into()),
            Err(error) => Err(error.into()),
        }
    }

    /// Takes the points of a batch that pass the filter.
    fn take(
        &self,
        unit: usize,
        visit: &mut Visit<'_>,
        batch: &PointBatch,
        worker: &mut Worker<'_>,
    ) -> Result<(), ConvertError> {
        let Worker { stats, selection, .. } = worker;
        let filtered = select(self.reading.plan, visit, batch, stats, selection)?;
        visit.seen.read += batch.len() as u64;
        visit.note_changes(batch);
        let recast = visit.recast(batch);
        let columns = stored_columns(batch, &recast);
        let selection = std::mem::take(&mut worker.selection);
        let kept = if filtered { selection.len() } else { batch.len() };
        visit.seen.kept += kept as u64;
        worker.stats.points += kept as u64;
        let all = if filtered { Rows::Selected(&selection) } else { Rows::Consecutive(0..batch.len()) };
        let mut start = 0;
        while start < kept {
            let end = kept.min(start + self.room.part_points - worker.block.len().min(self.room.part_points - 1));
            self.add(visit, batch, &columns, &all.slice(start..end), worker);
            start = end;
            if worker.block.len() >= self.room.part_points {
                self.encode(worker)?;
                if worker.parts.len() >= self.room.parts_kept {
                    self.order.write(unit, std::mem::take(&mut worker.parts))?;
                }
            }
        }
        worker.selection = selection;
        Ok(())
    }

    fn add(
        &self,
        visit: &mut Visit<'_>,
        batch: &PointBatch,
        columns: &[&pointmill_format::Column],
        rows: &Rows<'_>,
        worker: &mut Worker<'_>,
    ) {
        let schema = &self.reading.intake.schema;
        if !worker.block.add(visit, batch, columns, rows, schema, &mut worker.stats) {
            self.is_misled.store(true, Ordering::Relaxed);
            worker.block.clear();
        }
    }

    /// Encodes what the block holds.
    fn encode(&self, worker: &mut Worker<'_>) -> Result<(), ConvertError> {
        // a file that is worth nothing grows no more
        if worker.block.len() > 0 && !self.is_misled.load(Ordering::Relaxed) {
            let schema = &self.reading.intake.schema;
            match self.encoder.encode(&worker.block, schema, &mut worker.tally, &mut worker.changes)? {
                Some(bytes) => worker.parts.push(Part { points: worker.block.len() as u32, bytes }),
                None => self.is_misled.store(true, Ordering::Relaxed),
            }
        }
        worker.block.clear();
        Ok(())
    }
}
