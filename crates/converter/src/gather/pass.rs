//! One pass over the sources, with a lattice and bounds that are believed until they prove wrong.

use std::ops::ControlFlow;

use pointmill_format::{Aabb, Advice, AxisGrid, Lattice, Scratch};

use super::axis::SourceMap;
use super::batch::Worker;
use super::context::{CellPart, CellParts, Context, Demand};
use super::cut::Cut;
use super::lattice::ulp;
use super::origins::Origins;
use super::partition::Partition;
use crate::cloud::{Cell, Cube, Gathered, Intake, JobBounds, JobLattice, RecordFrame, Stats, Store, morton};
use crate::error::ConvertError;
use crate::plan::{OnFault, Plan};
use crate::runtime::Runtime;
use crate::sources::{Fineness, Source, Sources};
use crate::warning::{Warning, reason_of};

/// How a pass over the inputs ended.
pub(super) enum PassEnd {
    /// All points are there.
    Complete(Box<Gathered>),
    /// The bounds or the lattice do not fit the points, whose bounds are known now; nothing else of them is.
    Misled(Box<Stats>),
    /// No point passed the filter (or there was none).
    Empty(Box<Stats>),
}

/// A pass over the sources.
pub(super) struct Pass<'a> {
    context: Context<'a>,
    lattice: &'a JobLattice,
    rt: &'a Runtime<'a>,
}

impl<'a> Pass<'a> {
    /// `hint`: the bounds that are believed; `far_cut`: the box of all points but outliers, which are dropped.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn new(
        plan: &'a Plan,
        sources: &'a Sources,
        intake: &'a Intake,
        demand: Demand,
        lattice: &'a JobLattice,
        hint: Option<JobBounds>,
        far_cut: Option<Aabb>,
        rt: &'a Runtime<'a>,
    ) -> Self {
        let map = |s: &Source| SourceMap::new(s.scan.info().lattice.as_ref(), &lattice.lattice);
        let cuts = |bounds: Option<Aabb>| -> Vec<Option<Cut>> {
            sources.all.iter().map(|s| bounds.map(|b| Cut::new(&b, s.scan.info()))).collect()
        };
        let context = Context {
            plan,
            sources,
            intake,
            maps: sources.all.iter().map(map).collect(),
            claims: sources.all.iter().map(|s| claims(s, &lattice.lattice)).collect(),
            lattice: lattice.lattice,
            far_cuts: cuts(far_cut),
            cuts: cuts(plan.filter.bounds),
            origins: sources.all.iter().map(|s| Origins::of(s.scan.info())).collect(),
            partition: Partition::choose(hint, &lattice.lattice, sources.points_declared),
            store: Store::new(rt.temp.clone(), intake.schema.stride, demand.uses, rt.budget.store_bytes),
            wants_moments: demand.moments,
            misled: false.into(),
        };
        Self { context, lattice, rt }
    }

    /// Reads every point.
    pub(super) fn run(self) -> Result<PassEnd, ConvertError> {
        let (stats, parts) = self.read()?;
        let bounds = stats.bounds;
        if bounds.is_empty() {
            return Ok(PassEnd::Empty(Box::new(stats)));
        }
        let Self { context: Context { partition, store, misled, intake, .. }, lattice, .. } = self;
        let cube = match Cube::around(&bounds, &lattice.lattice) {
            Ok(cube) if !misled.into_inner() && partition.fits(&cube, &bounds) => cube,
            _ => return Ok(PassEnd::Misled(Box::new(stats))),
        };
        let mut cells: Vec<Cell> = parts
            .into_iter()
            .map(|(packed, CellPart { mut segments, moments })| {
                segments.sort();
                let points = segments.points();
                Cell {
                    key: partition.node(packed, &cube),
                    points,
                    segments,
                    is_one_place: false,
                    repeats: 0,
                    bounds: None,
                    moments,
                }
            })
            .collect();
        cells.sort_unstable_by(|a, b| morton::compare(a.xyz(), b.xyz()));
        Ok(PassEnd::Complete(Box::new(Gathered {
            lattice: lattice.clone(),
            is_lossless: is_rounding(&stats, &lattice.lattice),
            frame: RecordFrame { stride: intake.schema.stride, cube, origin: partition.origin() },
            store,
            cells,
            stats,
            shared_places: Vec::new(),
        })))
    }

    fn read(&self) -> Result<(Stats, CellParts), ConvertError> {
        let pieces = |(s, source): (usize, &Source)| (0..source.scan.pieces().len()).map(move |p| (s, p));
        let pieces: Vec<(usize, usize)> = self.context.sources.all.iter().enumerate().flat_map(pieces).collect();
        let parts = self.rt.in_parallel(
            pieces.len(),
            || (Worker::new(&self.context), Scratch::default()),
            |(worker, scratch), unit| {
                let (source, piece) = pieces[unit];
                self.piece(source, piece, worker, scratch)
            },
            |(worker, _)| worker.finish(),
        )?;
        let mut stats = Stats::new(&self.context.intake.schema, self.context.sources.all.len());
        let mut cells = CellParts::default();
        for part in parts {
            let (part, more) = part?;
            stats.merge(&part);
            for (cell, mut more) in more {
                let part: &mut CellPart = cells.entry(cell).or_default();
                part.segments.append(&mut more.segments);
                part.moments.merge(&more.moments);
            }
        }
        Ok((stats, cells))
    }

    /// Decodes one piece; what a broken piece held is counted or is an error, by policy.
    fn piece(
        &self,
        source: usize,
        piece: usize,
        worker: &mut Worker<'_>,
        scratch: &mut Scratch,
    ) -> Result<(), ConvertError> {
        let scan = &self.context.sources.all[source].scan;
        let mut outcome = Ok(());
        let mut points = 0u64;
        let decoded = scan.decode(piece, &self.context.intake.sources[source].wanted, scratch, &mut |batch| {
            outcome = self.rt.check_stop();
            if outcome.is_err() {
                return ControlFlow::Break(());
            }
            points += batch.len() as u64;
            outcome = worker.take(source, batch);
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
                let warning = Warning::PointsSkipped { points: lost, path, error: reason_of(&error) };
                self.rt.warn(&warning);
                worker.stats.unreadable += lost;
                worker.stats.warnings.push(warning);
                Ok(())
            }
            Err(error) if error.advice().is_none() => Err(error.advise(Advice::SkipUnreadable).into()),
            Err(error) => Err(error.into()),
        }
    }
}

/// The axes on which the points of a source have to prove a claim: a lattice that does not hold the claimed grid moves
/// them anyway.
fn claims(source: &Source, lattice: &Lattice) -> [bool; 3] {
    std::array::from_fn(|a| {
        let job = AxisGrid { step: lattice.scale[a], offset: lattice.offset[a] };
        matches!(source.survey.fineness[a], Fineness::Grid { grid, is_claim: true } if job.holds(&grid))
    })
}

/// True if no coordinate moved by more than the rounding of doubles.
fn is_rounding(stats: &Stats, lattice: &Lattice) -> bool {
    let (min, max) = (lattice.world(stats.bounds.min.0), lattice.world(stats.bounds.max.0));
    (0..3).all(|a| {
        let far = min[a].abs().max(max[a].abs()).max(lattice.offset[a].abs());
        stats.change.max[a] <= (8.0 * ulp(far)).max(1e-6 * lattice.scale[a])
    })
}
