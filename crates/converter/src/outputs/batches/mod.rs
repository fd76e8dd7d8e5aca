//! Quantised batches: the cloud is cut into runs of the batches' Morton order, which threads sort and encode one by
//! one. Batches and cells that two runs share are put together by whoever comes last, and at the end.

mod buckets;
mod compress;
mod content;
mod density;
mod figures;
mod finish;
mod frame;
mod large;
mod lod;
mod order;
mod output;
mod planes;
mod settings;
mod task;
#[cfg(test)]
mod tests;
mod unit_check;

use std::sync::Arc;

use pointmill_format::DatasetKind;
use pointmill_format::batches::Layout;
use serde_json::{Map, Value};

pub use settings::BatchesSettings;

use super::colour::colour_of;
use super::output::{DiskSize, Output, Target, Wants};
use super::recovery::Recovery;
use super::staging::{OutputFile, StagedDataset};
use crate::cloud::{Cloud, Store};
use crate::error::{ConvertError, Unsupported};
use crate::job::{Build, GroupUnits, InPlace, KeptFile, UnitLog, make_units, put_back};
use crate::plan::{AttributeChoice, Duplicates, Plan, PlanError, PlanFault, ScaleChoice, Setting};
use crate::report::{self, ChoiceReason, OutputReport, PlannedChoice, SavedBytes};
use crate::runtime::{Consumer, Reservation, Runtime};
use crate::sources::Schema;
use buckets::Task;
use content::Content;
use finish::finish;
use frame::{Frame, refused};
use large::WORD_BYTES;
use output::{BatchFile, Encoder, ORIGINAL_BYTES, To};
use task::{TaskResults, Worker, Workshop, bytes_per_point};
use unit_check::{CameTo, can_be_of};

/// Tasks per thread, so that threads end together; their sizes. Small ones share too much with each other, large ones
/// leave the caches.
const TASKS_PER_THREAD: u64 = 6;
const MAX_TASK_POINTS: u64 = 800_000;
const MIN_TASK_POINTS: u64 = 50_000;

/// The same of a job that several processes share.
const SHARED_TASK_POINTS: u64 = 400_000;

/// Bytes of the record of a batch.
const BATCH_BYTES: u64 = 32;

impl From<BatchesSettings> for Target {
    fn from(settings: BatchesSettings) -> Self {
        Self::new(settings)
    }
}

impl Output for BatchesSettings {
    fn kind(&self) -> DatasetKind {
        DatasetKind::Batches
    }

    fn check(&self, plan: &Plan) -> Result<(), ConvertError> {
        let refuse = |setting, fault| Err(PlanError::new(setting, fault).into());
        if plan.duplicates == Duplicates::Drop {
            return Err(Unsupported::DropDuplicates(self.kind()).into());
        }
        if self.lod_cell.is_some_and(|c| !(c.is_finite() && c > 0.0)) {
            return refuse(Setting::LodCell, PlanFault::NotPositive);
        }
        if self.planes.is_some_and(|p| !(1..=3).contains(&p)) {
            return refuse(Setting::Planes, PlanFault::NotOneOf("1 to 3"));
        }
        Ok(())
    }

    fn wants(&self, plan: &Plan, all: &Schema) -> Wants {
        let mut wants = Wants::chosen(plan, all, false);
        wants.add(colour_of(all));
        wants
    }

    fn disk_size(&self, plan: &Plan, schema: &Schema, kept: u64) -> DiskSize {
        let colour = colour_of(schema).map_or(0, |i| schema.attributes[i].size() as u64);
        let is_usual = plan.attributes == AttributeChoice::Usual;
        let extras = if is_usual { plan.derive.bytes() } else { kept.saturating_sub(colour) };
        let planes = u64::from(self.planes.unwrap_or(3));
        // Colour word, and at most an index and word of an original.
        let originals = if self.originals { 8 } else { 0 };
        DiskSize { per_point: 4 * planes + 4 + originals + extras, per_1000_points: BATCH_BYTES }
    }

    fn describe_settings(&self, settings: &mut Map<String, Value>) {
        settings.insert("lod-cell".into(), self.lod_cell.map_or("auto".into(), Value::from));
        settings.insert("planes".into(), self.planes.map_or("auto".into(), |p| (u32::from(p) * 10).into()));
        settings.insert("originals".into(), self.originals.into());
        if let Some(level) = self.zstd_level {
            settings.insert("zstd-level".into(), level.into());
        }
    }

    fn choices(&self, plan: &Plan) -> Vec<PlannedChoice> {
        let by = match plan.scale {
            ScaleChoice::Within(_) => ChoiceReason::Precision,
            ScaleChoice::Auto | ScaleChoice::Fixed(_) => ChoiceReason::Step,
        };
        let sections = self.zstd_level.map_or("not compressed".to_owned(), |level| format!("zstd, level {level}"));
        vec![
            PlannedChoice::or_chosen("cell of the coarsest level of detail", self.lod_cell, ChoiceReason::CellPoints),
            PlannedChoice::or_chosen("bits of a coordinate", self.planes.map(|p| 10 * u32::from(p)), by),
            PlannedChoice::or_default("sections", sections.as_str(), "not compressed"),
        ]
    }

    fn saved_bytes(&self) -> SavedBytes {
        SavedBytes::NoPlane // the finished file tells
    }

    fn write(&self, build: Build<'_>, to: &StagedDataset) -> Result<OutputReport, ConvertError> {
        let Build { cloud, rt, units } = build;
        let (points, per_point) = (cloud.points(), bytes_per_point(cloud.frame.stride));
        let most = rt.budget.task_points(per_point, MAX_TASK_POINTS);
        let task_points = (points / (rt.threads as u64 * TASKS_PER_THREAD)).max(MIN_TASK_POINTS).min(most);
        let task_points = if build.is_shared() { SHARED_TASK_POINTS } else { task_points };
        let content = Content::choose(cloud);
        let frame = Frame::new(cloud, self.lod_cell)?;
        let attributes: Vec<_> = content.extras.iter().map(|e| e.attribute.clone()).collect();
        let layout = Layout::new(points, &attributes, planes::at_most(cloud, &frame, self.planes)).map_err(refused)?;
        let job = units.and_then(|units| Some((units, units.shared()?)));
        let records = job.map(|(_, job)| job.more_records(&rt.temp)).transpose()?.flatten();
        let (records, records_name) = records.unzip();
        let sorted = Store::on(records, false, rt.temp.clone(), cloud.frame.stride + WORD_BYTES, 1, &rt.memory);
        let can_be = |tasks: &Vec<Task>| Task::can_be_of(tasks, points);
        let tasks = build.divided(can_be, || buckets::tasks(cloud, rt, &frame, task_points))?;
        let cut = || large::cut(tasks, cloud, rt, (&frame, &content), &sorted, task_points);
        let tasks = match job {
            Some((units, job)) => {
                job.settled_in(&format!("{}, cut", units.division()), &sorted, records_name, can_be, cut)?
            }
            None => cut()?,
        };
        let mut room = Reservation::new(&rt.memory, Consumer::Cells);
        room.resize(tasks.iter().map(|task| task.segments.bytes() + size_of::<Task>() as u64).sum())?;
        let means = Means {
            cloud,
            rt,
            frame: &frame,
            content: &content,
            layout: &layout,
            sorted: &sorted,
            keeps_originals: self.originals,
            usual_points: task_points.min(points),
        };
        let division: Vec<_> = tasks.iter().map(|task| (task.first_point, task.points, task.start)).collect();
        let units = units.map(|units| units.divided(cloud, &division)).transpose()?;
        let name = self.kind().marker_file();
        // what is compressed is written raw first, elsewhere
        let (made, raw) = match self.zstd_level {
            None => (to.create_kept(name)?, None),
            Some(_) => (OutputFile::new(to.create(name)?), Some(rt.temp.make()?)),
        };
        let made = to.past_cache(name, made);
        if let Some(units) = units {
            means.units(units, &tasks, made.kept(0))?;
        }
        let file = &made.file;
        let output = BatchFile::new(
            To::File(raw.as_ref().unwrap_or(file)),
            &layout,
            means.originals(),
            Recovery::new(cloud),
            frame.grid.origin,
        );
        let results = match units {
            Some(units) => means.recall(units, &tasks, &output)?,
            None => encode(rt, &means.shop(&output), &tasks)?,
        };
        results.ledger.check(&cloud.stats.checksum)?;
        let mut finished = finish(cloud, self, &frame, &content, &output, &results)?;
        if let (Some(raw), Some(level)) = (&raw, self.zstd_level) {
            compress::compress(rt, raw, file, level, &mut finished)?;
        }
        file.set_len(finished.bytes, "ending the batches")?;
        file.sync("syncing the batches")?;
        Ok(OutputReport {
            points: results.ledger.points(),
            accuracy: report::accuracy(cloud, results.ledger.points(), finished.format_errors()),
            attributes: cloud.names(content.kept.iter().copied()),
            attributes_dropped: content.dropped,
            bytes: finished.bytes,
            checksum: results.ledger.unaltered().to_string(),
            saved: Some(finished.saved()),
            details: figures::details(&frame, &finished, self),
            warnings: content.warnings,
            ..OutputReport::default()
        })
    }
}

/// What tasks are encoded with.
struct Means<'a> {
    cloud: &'a Cloud<'a>,
    rt: &'a Runtime<'a>,
    frame: &'a Frame,
    content: &'a Content,
    layout: &'a Layout,
    sorted: &'a Store,
    keeps_originals: bool,
    usual_points: u64,
}

impl Means<'_> {
    fn originals(&self) -> Arc<Store> {
        Store::new(self.rt.temp.clone(), ORIGINAL_BYTES, 1, &self.rt.memory)
    }

    fn shop<'s>(&'s self, output: &'s BatchFile<'s>) -> Workshop<'s> {
        Workshop {
            frame: self.frame,
            content: self.content,
            store: &self.cloud.store,
            sorted: self.sorted,
            stride: self.cloud.frame.stride,
            output,
            keeps_originals: self.keeps_originals,
            usual_points: self.usual_points,
        }
    }

    /// Encodes the tasks of a job that are to be encoded here, each into a file of its own, or into the output if a job has it.
    fn units(&self, units: GroupUnits<'_>, tasks: &[Task], kept: Option<KeptFile<'_>>) -> Result<(), ConvertError> {
        let points: Vec<u64> = tasks.iter().map(|task| task.points).collect();
        let output = kept.as_ref().map(|kept| kept as &dyn InPlace<u64>);
        let can_be = |index: usize, said: &_| can_be_of(said, index, &tasks[index], self.layout);
        make_units(units, &points, output, self.rt, can_be, |index, file| {
            let log = UnitLog::begin(file, output);
            let came_to: CameTo = {
                let put = |offset: u64, bytes: &[u8]| log.put(offset, bytes);
                let (recovery, origin) = (Recovery::new(self.cloud), self.frame.grid.origin);
                let output = BatchFile::new(To::Unit(&put), self.layout, self.originals(), recovery, origin);
                let shop = self.shop(&output);
                let mut worker = Worker::new(&shop);
                worker.run(index, &tasks[index])?;
                let results = worker.finish();
                let (part, originals) = output.take_part()?;
                (results, part, originals)
            };
            log.end(&came_to)
        })
    }

    /// Takes what all units of a job came to.
    fn recall(
        &self,
        units: GroupUnits<'_>,
        tasks: &[Task],
        output: &BatchFile<'_>,
    ) -> Result<TaskResults, ConvertError> {
        let each = self.rt.in_parallel(
            tasks.len(),
            || (Encoder::default(), Vec::new()),
            |(encoder, all), index| {
                let put = |at: &u64, from: u64, bytes: &[u8]| output.write(bytes, at + from);
                let can_be = |said: &_| can_be_of(said, index, &tasks[index], self.layout);
                let unit = units.recall(index, |unit| put_back(unit, 1, can_be, put, |_, _| ()))?;
                let came_to: CameTo = unit.ok_or_else(|| units.gone(index))?;
                let (results, part, originals) = came_to;
                output.add_part(part, originals, encoder)?;
                all.push(results);
                Ok(())
            },
            |(_, all)| all,
        )?;
        Ok(TaskResults::of_all(each.into_iter().flatten()))
    }
}

/// Encodes all tasks; edges come back in the order of the tasks.
fn encode(rt: &Runtime<'_>, shop: &Workshop<'_>, tasks: &[Task]) -> Result<TaskResults, ConvertError> {
    let each = rt.in_parallel(
        tasks.len(),
        || Worker::new(shop),
        |worker, index| {
            worker.run(index, &tasks[index])?;
            rt.advance(tasks[index].points);
            Ok(())
        },
        Worker::finish,
    )?;
    Ok(TaskResults::of_all(each.into_iter()))
}
