//! From scans and datasets to one file of points: streamed, never gathered.
//!
//! Headers choose the lattice of the file before the first point is read. Where the points prove them wrong (positions do not
//! fit, colours are deeper than a sample of them), the pass is repeated with what is known then.

mod crs;
mod csv;
mod encoder;
mod fields;
mod grid;
mod las;
mod order;
mod pass;
mod ply;
mod report;
mod room;
mod rows;
mod sample;
mod units;

use std::sync::Arc;

use pointmill_format::scan::las::write::CrsRecords;

use crate::cloud::{Intake, JobLattice};
use crate::error::{ConvertError, InputFault, Unsupported};
use crate::gather::{Reading, nothing_to_convert};
use crate::memory::peak_resident_bytes;
use crate::outputs::{StagedFile, named_attributes};
use crate::plan::{ExportFormat, Plan};
use crate::runtime::{Clock, Disk, DiskFile, Events, Phase, SystemDisk, Workers};
use crate::sources::{ResolvedCrs, Sources};
use crate::warning::Warning;
use encoder::Encoder;
use fields::Depth;
use order::Order;
use pass::{Counted, Pass};
pub use report::{ExportReport, ExportedAttribute, ExportedPoints, PositionChange};
use room::Room;
use rows::Target;

/// Headers may mislead about the bounds, and colours be deeper than a sample of them.
const MAX_PASSES: usize = 5;

/// Writes the points of the inputs of `plan` to its output, a file.
///
/// Of the plan count inputs, attributes (all, or a list), step, filter, policies, coordinate reference system, memory and
/// threads.
///
/// # Errors
/// See [`ConvertError`]; the output is then as it was before.
pub fn export(plan: &Plan, format: ExportFormat, events: &dyn Events) -> Result<ExportReport, ConvertError> {
    export_on(Arc::new(SystemDisk), plan, format, events)
}

/// [`export`] on another disk, such as one that fails.
///
/// # Errors
/// As [`export`].
pub fn export_on(
    disk: Arc<dyn Disk>,
    plan: &Plan,
    format: ExportFormat,
    events: &dyn Events,
) -> Result<ExportReport, ConvertError> {
    let mut clock = Clock::start(events);
    clock.begin(Phase::Probe, plan.inputs.len() as u64);
    plan.check()?;
    let staged = StagedFile::new(&plan.output, plan.overwrite, disk, events)?;
    staged.warnings.iter().for_each(|w| events.warning(w));
    let written = write(plan, format, events, &staged, &mut clock);
    events.settling();
    match written {
        Ok(report) => {
            staged.finish()?;
            Ok(report)
        }
        Err(error) => {
            events.phase(Phase::CleanUp, 0);
            drop(staged);
            Err(error)
        }
    }
}

/// Everything that is known before the first point is read.
struct Job<'a> {
    plan: &'a Plan,
    format: ExportFormat,
    sources: &'a Sources,
    intake: &'a Intake,
    crs: ResolvedCrs,
    records: CrsRecords,
    room: Room,
}

/// All passes, up to a file that is complete but for its name.
fn write(
    plan: &Plan,
    format: ExportFormat,
    events: &dyn Events,
    staged: &StagedFile,
    clock: &mut Clock<'_>,
) -> Result<ExportReport, ConvertError> {
    let mut sources = Sources::open(plan, events)?;
    let mut warnings = std::mem::take(&mut sources.warnings);
    warnings.extend(staged.warnings.iter().cloned());
    let needed = named_attributes(plan, &sources.attributes)?;
    let intake = Intake::new(plan, &sources, &needed, false);
    let decode_bytes = sources.decode_bytes(|source| &intake.of(source).wanted)?;
    let room = Room::new(plan, format, 24 + intake.schema.stride as u64, decode_bytes, sources.bytes)?;
    let known = warnings.len();
    let wants_wkt = format.has_lattice() && las::wants_wkt(&intake.schema);
    let (crs, records) = crs::of(plan, format, wants_wkt, &sources, &mut warnings)?;
    warnings[known..].iter().for_each(|w| events.warning(w));
    let workers = Workers::start(plan.threads, events)?;
    let job = Job { plan, format, sources: &sources, intake: &intake, crs, records, room };
    let file = staged.create()?;
    let Written { counted, encoder, target, bytes } = job.write(&workers, &file, clock)?;
    clock.begin(Phase::Finish, 0);
    workers.check_stop()?;
    file.sync("syncing the output")?;
    workers.check_stop()?;
    let points = report::points(&counted.stats, counted.tally.points())?;
    warnings.extend(counted.stats.skipped.iter().cloned().map(Warning::from));
    let lattice = match target {
        Target::Lattice(lattice) => Some(lattice),
        Target::World => None,
    };
    let has = |source: usize, attribute: usize| intake.of(&sources.all[source]).has(Some(attribute));
    Ok(ExportReport {
        output: plan.output.clone(),
        format: encoder.describe(),
        bytes,
        inputs: sources.all.len() as u64,
        points,
        scale: lattice.map(|lattice| lattice.scale),
        offset: lattice.map(|lattice| lattice.offset),
        positions: report::positions(&counted.stats),
        attributes: report::attributes(&intake.schema, &encoder.places(), &counted, has),
        crs: job.crs.label.clone(),
        warnings,
        seconds: clock.seconds(),
        memory_bytes: peak_resident_bytes(),
    })
}

/// What a pass made that succeeded.
struct Written {
    counted: Counted,
    encoder: Box<dyn Encoder>,
    target: Target,
    bytes: u64,
}

impl Job<'_> {
    /// Passes over the points until one succeeds.
    fn write(&self, workers: &Workers<'_>, file: &DiskFile, clock: &mut Clock<'_>) -> Result<Written, ConvertError> {
        let Self { plan, sources, intake, .. } = *self;
        let mut lattice = grid::before_reading(plan, sources)?;
        let mut depth = sample::colour_depth(self.format, sources, intake)?;
        for _ in 0..MAX_PASSES {
            clock.begin(Phase::Read, sources.points_declared);
            let (encoder, target) = self.encoder(&lattice, depth)?;
            let start = encoder.start()?;
            file.set_len(0, "making the file empty")?;
            let order = Order::new(file, start, self.room.window);
            let reading = Reading::new(plan, sources, intake, None, lattice.lattice);
            let counted = Pass::new(&reading, &*encoder, target, &order, workers, self.room).run()?;
            let (end, parts) = order.end();
            if !counted.is_misled {
                if counted.stats.points == 0 {
                    return Err(nothing_to_convert(sources, &counted.stats));
                }
                let bytes = encoder.finish(file, &counted.tally, &parts, end)?;
                return Ok(Written { counted, encoder, target, bytes });
            }
            workers.warn(&Warning::ReadAgain);
            match target {
                Target::World => depth = Depth::Sixteen,
                Target::Lattice(_) => {
                    let next = grid::after_reading(plan, sources, &lattice, &counted.stats);
                    lattice = next.ok_or_else(|| self.too_far(&lattice, &counted))?;
                }
            }
        }
        Err(Unsupported::TooFarApart.into())
    }

    fn encoder(&self, lattice: &JobLattice, depth: Depth) -> Result<(Box<dyn Encoder>, Target), ConvertError> {
        let schema = &self.intake.schema;
        if self.format.has_lattice() {
            let (lattice, most) = (lattice.lattice, self.sources.points_declared);
            let file = las::LasFile::new(self.format, schema, lattice, self.records.clone(), most)?;
            return Ok((Box::new(file), Target::Lattice(lattice)));
        }
        let file: Box<dyn Encoder> = match self.format {
            ExportFormat::Ply => Box::new(ply::PlyFile::new(schema, depth, &self.crs.label)),
            _ => Box::new(csv::CsvFile::new(schema, self.sources)),
        };
        Ok((file, Target::World))
    }

    fn too_far(&self, lattice: &JobLattice, counted: &Counted) -> ConvertError {
        let (min, max) = (counted.stats.bounds.min.0, counted.stats.bounds.max.0);
        InputFault::FarPoints { min: lattice.lattice.world(min), max: lattice.lattice.world(max) }.into()
    }
}
