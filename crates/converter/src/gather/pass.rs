//! One pass over the sources, with a lattice and bounds that are believed until they prove wrong.

use std::collections::HashMap;
use std::ops::{ControlFlow, Range};
use std::sync::Arc;

use pointmill_format::{Aabb, Advice, Lattice, NodeKey, Scratch};

use super::batch::Worker;
use super::context::{CellPart, Collected, Context, Demand};
use super::lattice::ulp;
use super::loose::Grouper;
use super::partition::{Hint, Partition};
use super::read_unit::{self, Unit};
use super::visit::{Reading, Visit};
use crate::cloud::{
    Cell, Census, CensusCell, Cube, Gathered, Intake, JobLattice, RecordFrame, SourceStats, Stats, Store, morton, node,
    xyz,
};
use crate::error::{ConvertError, JobFault};
use crate::job::{Keeper, SharedJob, settled};
use crate::plan::{OnFault, Plan};
use crate::runtime::{Consumer, DiskFile, Evict, Reservation, Runtime};
use crate::sources::Sources;
use crate::warning::{SkippedPoints, reason_of};

/// The level of cells by which records are grouped that came in no order of space: of a volume there are 512 then.
const LOOSE_LEVEL: u8 = 3;

/// The same where others came in order, so that their cells are wide, too.
const MIXED_LEVEL: u8 = 5;

/// How a pass over the inputs ended.
pub(super) enum PassEnd {
    /// All points are there.
    Complete(Box<Gathered>),
    /// The points cannot be stored with these bounds or on this lattice; their bounds are known now, and nothing else of them.
    Misled(Box<Stats>),
    /// No point passed the filter (or there was none).
    Empty(Box<Stats>),
}

/// A pass over the sources.
pub(super) struct Pass<'a> {
    context: Context<'a>,
    lattice: &'a JobLattice,
    keeper: Option<Keeper<'a>>,
    rt: &'a Runtime<'a>,
    /// To read a unit of a job that several processes share, apart from the others.
    start: Start<'a>,
}

/// What a pass begins with.
#[derive(Clone)]
struct Start<'a> {
    plan: &'a Plan,
    sources: &'a Sources,
    intake: &'a Intake,
    demand: Demand,
    hint: Option<Hint>,
    far_cut: Option<Aabb>,
    number: u32,
}

impl<'a> Pass<'a> {
    /// `number`: its number, from 1 on; `hint`: where the points are thought to be; `far_cut`: the box of all points but outliers, which
    /// are dropped.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn new(
        plan: &'a Plan,
        sources: &'a Sources,
        intake: &'a Intake,
        demand: Demand,
        lattice: &'a JobLattice,
        hint: Option<Hint>,
        far_cut: Option<Aabb>,
        number: u32,
        keeper: Option<Keeper<'a>>,
        rt: &'a Runtime<'a>,
    ) -> Result<Self, ConvertError> {
        let file = match keeper {
            Some(Keeper::Own(job)) => Some(job.records(number, &rt.temp)?),
            Some(Keeper::Shared(job)) => job.settle_records(number, &rt.temp)?,
            None => None,
        };
        let start = Start { plan, sources, intake, demand, hint, far_cut, number };
        Ok(Self::on(file, start, lattice, keeper, rt))
    }

    /// With a file for records that outlives the process.
    fn on(
        file: Option<DiskFile>,
        start: Start<'a>,
        lattice: &'a JobLattice,
        keeper: Option<Keeper<'a>>,
        rt: &'a Runtime<'a>,
    ) -> Self {
        let Start { plan, sources, intake, demand, hint, far_cut, number } = start.clone();
        let is_own = matches!(keeper, Some(Keeper::Own(_)));
        let is_for_others = file.is_some() && !is_own;
        let store = Store::on(file, is_for_others, rt.temp.clone(), intake.schema.stride, demand.uses, &rt.memory);
        let evict: Arc<dyn Evict> = Arc::clone(&store) as _;
        rt.memory.evict_from(Arc::downgrade(&evict));
        let context = Context {
            reading: Reading::new(plan, sources, intake, far_cut, lattice.lattice),
            partition: Partition::choose(hint, &lattice.lattice, sources.points_declared),
            store,
            memory: &rt.memory,
            wants_moments: demand.moments,
            pass: number,
            misled: false.into(),
        };
        Self { context, lattice, keeper, rt, start }
    }

    /// Reads every point.
    pub(super) fn run(self) -> Result<PassEnd, ConvertError> {
        let (stats, collected, mut room) = self.read()?;
        let bounds = stats.bounds;
        if bounds.is_empty() {
            return Ok(PassEnd::Empty(Box::new(stats)));
        }
        let Self {
            context: Context { partition, store, misled, reading, wants_moments, pass, .. }, lattice, rt, ..
        } = self;
        let intake = reading.intake;
        let cube = match Cube::around(&bounds, &lattice.lattice) {
            Ok(cube) if !misled.into_inner() && partition.holds(&bounds) => cube,
            _ => return Ok(PassEnd::Misled(Box::new(stats))),
        };
        let frame = RecordFrame { stride: intake.schema.stride, cube, origin: partition.origin() };
        let is_of_others = self.keeper.is_some_and(Keeper::is_of_others);
        if is_of_others {
            store.expect_within([bounds.min, bounds.max].map(|corner| frame.origin.stored(corner)));
        }
        let grouper = Grouper { store: &store, frame: &frame, wants_moments, rt };
        let group = || group(&grouper, &partition, collected, stats.points, &mut room);
        self.keeper.and_then(Keeper::shared).map_or(Ok(()), |job| job.enter(pass, stats.points))?;
        let (cells, counted) = settled(self.keeper, "cells", &store, |_| true, group)?;
        // whoever has made them: what they were made from may lie, too
        if is_of_others {
            let is_cell = |cell: &Cell| {
                let own = frame.cube.bounds_of(cell.key);
                let meets = (0..3).all(|a| own.min[a] <= bounds.max[a] && bounds.min[a] <= own.max[a]);
                meets && (!wants_moments || cell.moments.can_be_of(cell.points, &bounds))
            };
            let can_be = Cell::can_be_of(&cells, stats.points) && CensusCell::can_be_of(&counted, stats.points);
            if !can_be || !cells.iter().all(is_cell) {
                return Err(ConvertError::Internal("cells that are none of the cloud".into()));
            }
        }
        let census = Census { cells: counted, bounds: HashMap::new() };
        let of_cells = cells.iter().map(|cell| size_of::<Cell>() as u64 + cell.segments.bytes()).sum::<u64>();
        room.resize(of_cells + (census.cells.capacity() * size_of::<CensusCell>()) as u64)?;
        Ok(PassEnd::Complete(Box::new(Gathered {
            lattice: lattice.clone(),
            is_lossless: is_rounding(&stats, &lattice.lattice),
            frame,
            store,
            cells,
            census,
            room,
            stats,
            shared_places: Vec::new(),
        })))
    }

    fn read(&self) -> Result<(Stats, Collected, Reservation), ConvertError> {
        let sources = self.context.sources;
        let units = match self.keeper {
            Some(_) => read_unit::units(sources, self.context.plan.checkpoint_points),
            None => std::iter::once(0..sources.pairs()).collect(),
        };
        let mut stats = Stats::new(&self.context.intake.schema);
        // what a job keeps is taken from the threads unit by unit
        let mut seen = vec![SourceStats::default(); self.keeper.map_or(0, |_| sources.all.len())];
        let mut collected = Collected::default();
        let mut room = Reservation::new(&self.rt.memory, Consumer::Cells);
        if let Some(Keeper::Shared(job)) = self.keeper {
            self.share(job, &units)?;
        }
        for (number, pairs) in units.into_iter().enumerate() {
            let unit = self.unit(number as u64, pairs)?;
            stats.merge(&unit.stats);
            unit.seen.iter().for_each(|(source, more)| seen[*source as usize].merge(more));
            collected.merge(unit.collected);
            room.merge(unit.room);
        }
        stats.sources = if self.keeper.is_some() { seen } else { self.context.take_seen()? };
        Ok((stats, collected, room))
    }

    /// A unit: what another run has left of it, or read now.
    fn unit(&self, number: u64, pairs: Range<usize>) -> Result<Unit, ConvertError> {
        let job = match self.keeper {
            Some(Keeper::Own(job)) => job,
            Some(Keeper::Shared(job)) => {
                let unit = read_unit::recall_shared(job, &self.context, number, &pairs)?;
                let points = pairs.map(|pair| self.context.sources.pair_points(pair)).sum();
                let listed = || job.listed(read_unit::name(self.context.pass, number), points, Vec::new());
                return unit.ok_or_else(|| JobFault::Unfinished { units: vec![listed()] }.into());
            }
            None => return self.read_pairs(&pairs),
        };
        if let Some(unit) = read_unit::recall(job, &self.context, number, &pairs)? {
            let points = unit.seen.iter().map(|(_, seen)| seen.read).sum();
            self.rt.advance(points);
            job.count_recalled(points);
            return Ok(unit);
        }
        let first_block = self.context.store.next_block()?;
        let mut unit = self.read_pairs(&pairs)?;
        unit.seen = self.context.take_touched()?;
        read_unit::keep(job, &self.context, number, pairs, first_block, &mut unit, self.rt)?;
        if job.is_safe() {
            self.rt.events().checkpoint(Some(job.folder()));
        }
        Ok(unit)
    }

    /// Reads the units that are to be read here.
    ///
    /// # Errors
    /// Some of the pass are not done, here or elsewhere.
    fn share(&self, job: &SharedJob, units: &[Range<usize>]) -> Result<(), ConvertError> {
        let name = |number: usize| read_unit::name(self.context.pass, number as u64);
        for (number, pairs) in units.iter().enumerate().filter(|(number, _)| job.wants(name(*number))) {
            let (file, records) = job.new_records(name(number), &self.rt.temp)?;
            let alone = Pass::on(Some(file), self.start.clone(), self.lattice, None, self.rt);
            let mut unit = alone.read_pairs(pairs)?;
            unit.seen = alone.context.take_touched()?;
            read_unit::keep_shared(job, &alone.context, number as u64, pairs.clone(), &records, &mut unit)?;
        }
        if (0..units.len()).all(|number| job.is_done(name(number))) {
            return Ok(());
        }
        let points = |pairs: &Range<usize>| pairs.clone().map(|pair| self.context.sources.pair_points(pair)).sum();
        let listed = units.iter().enumerate().map(|(n, pairs)| job.listed(name(n), points(pairs), Vec::new()));
        Err(JobFault::Unfinished { units: listed.collect() }.into())
    }

    fn read_pairs(&self, pairs: &Range<usize>) -> Result<Unit, ConvertError> {
        let sources = self.context.sources;
        let parts = self.rt.in_parallel(
            pairs.len(),
            || Reader { worker: Worker::new(&self.context), visit: None, scratch: Scratch::default() },
            |reader, i| {
                let (source, pieces) = sources.pair(pairs.start + i);
                for piece in pieces.clone() {
                    reader.scratch.next_piece = Some(piece + 1).filter(|next| pieces.contains(next));
                    self.piece(source, piece, reader)?;
                }
                Ok(())
            },
            |reader| reader.finish(&self.context),
        )?;
        let mut stats = Stats::new(&self.context.intake.schema);
        let mut collected = Collected::default();
        let mut room = Reservation::new(&self.rt.memory, Consumer::Cells);
        for part in parts {
            let (part, more, taken) = part?;
            stats.merge(&part);
            collected.merge(more);
            room.merge(taken);
        }
        Ok(Unit { stats, collected, room, seen: Vec::new() })
    }

    /// Decodes one piece; what a broken piece held is counted or is an error, by policy.
    fn piece<'s>(&'s self, source: usize, piece: usize, reader: &mut Reader<'s>) -> Result<(), ConvertError> {
        let Reader { worker, visit, scratch } = reader;
        if let Some(left) = visit.take_if(|visit| visit.index != source) {
            left.end(&self.context)?;
        }
        let visit = match visit {
            Some(visit) => visit,
            None => visit.insert(Visit::begin(&self.context, source)?),
        };
        let scan = Arc::clone(&visit.scan);
        let mut outcome = Ok(());
        let mut points = 0u64;
        let decoded = scan.decode(piece, &visit.intake.wanted, scratch, &mut |batch| {
            outcome = self.rt.check_stop();
            if outcome.is_err() {
                return ControlFlow::Break(());
            }
            points += batch.len() as u64;
            outcome = worker.take(visit, batch);
            self.rt.advance(batch.len() as u64);
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
            Err(error) if self.context.plan.unreadable == OnFault::Skip => {
                let path = scan.info().path.clone();
                let skipped = SkippedPoints { path, error: reason_of(&error), points: lost };
                self.rt.warn(&skipped.clone().into());
                worker.stats.unreadable += lost;
                worker.stats.skipped.push(skipped);
                Ok(())
            }
            Err(error) if error.advice().is_none() => Err(error.advise(Advice::SkipUnreadable).into()),
            Err(error) => Err(error.into()),
        }
    }
}

/// Cells of the octree from what was read, those that came in no order of space put in order; and how many points there are
/// where.
fn group(
    grouper: &Grouper<'_>,
    partition: &Partition,
    mut collected: Collected,
    points: u64,
    room: &mut Reservation,
) -> Result<(Vec<Cell>, Vec<CensusCell>), ConvertError> {
    let level = partition.level;
    if !partition.is_of(&grouper.frame.cube) {
        let all = collected.everything();
        room.resize(all.bytes())?;
        let sifted = grouper.sift(&all, level)?;
        (collected, *room) = sifted;
    }
    let Collected { cells, loose, census, .. } = collected;
    let counted = census.finish(level);
    let mut nodes: Vec<(NodeKey, CellPart)> = cells.into_iter().map(|(code, part)| (node(code, level), part)).collect();
    if !loose.is_empty() {
        let level = level_of_loose(&nodes, loose.points(), points);
        nodes = widened(nodes, level);
        nodes.extend(grouper.group(&loose, u32::from(level))?);
    }
    grouper.store.drop_spare(u64::MAX)?;
    Ok((finished(nodes), counted))
}

/// What a thread works with.
struct Reader<'a> {
    worker: Worker<'a>,
    /// The source that was read last: the next piece may be one of it.
    visit: Option<Visit<'a>>,
    scratch: Scratch,
}

impl Reader<'_> {
    /// Hands over everything that was gathered and measured.
    fn finish(self, pass: &Context<'_>) -> Result<(Stats, Collected, Reservation), ConvertError> {
        self.visit.map_or(Ok(()), |visit| visit.end(pass))?;
        self.worker.finish()
    }
}

/// The level of cells by which loose records are grouped, beside cells of one level.
fn level_of_loose(cells: &[(NodeKey, CellPart)], loose: u64, points: u64) -> u8 {
    match cells.first() {
        None => LOOSE_LEVEL,
        // a few batches do not make all cells wide
        Some((key, _)) if loose <= points / 16 => key.level,
        Some((key, _)) => MIXED_LEVEL.min(key.level),
    }
}

/// Cells below `level` become the one that they lie in.
fn widened(cells: Vec<(NodeKey, CellPart)>, level: u8) -> Vec<(NodeKey, CellPart)> {
    let mut wide: HashMap<NodeKey, CellPart> = HashMap::new();
    for (key, part) in cells {
        wide.entry(key.ancestor(level).unwrap_or(key)).or_default().merge(part);
    }
    wide.into_iter().collect()
}

/// One cell for each node, in Morton order.
fn finished(mut nodes: Vec<(NodeKey, CellPart)>) -> Vec<Cell> {
    nodes.sort_unstable_by(|(a, _), (b, _)| morton::compare(xyz(*a), xyz(*b)));
    nodes.dedup_by(|(key, next), (previous, part)| {
        let is_same = key == previous;
        if is_same {
            part.merge(std::mem::take(next));
        }
        is_same
    });
    let cell = |(key, mut part): (NodeKey, CellPart)| {
        part.segments.sort();
        Cell::new(key, part.segments, part.moments)
    };
    nodes.into_iter().map(cell).collect()
}

/// True if no coordinate moved by more than the rounding of doubles.
fn is_rounding(stats: &Stats, lattice: &Lattice) -> bool {
    let (min, max) = (lattice.world(stats.bounds.min.0), lattice.world(stats.bounds.max.0));
    (0..3).all(|a| {
        let far = min[a].abs().max(max[a].abs()).max(lattice.offset[a].abs());
        stats.change.max[a] <= (8.0 * ulp(far)).max(1e-6 * lattice.scale[a])
    })
}
