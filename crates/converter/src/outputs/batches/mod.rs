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

use pointmill_format::DatasetKind;
use pointmill_format::batches::Layout;
use serde_json::{Map, Value};

pub use settings::BatchesSettings;

use super::colour::colour_of;
use super::output::{DiskSize, Output, Target, Wants};
use super::recovery::Recovery;
use super::staging::StagedDataset;
use crate::cloud::{Cloud, Store};
use crate::error::{ConvertError, Unsupported};
use crate::job::GroupUnits;
use crate::plan::{AttributeChoice, Duplicates, Plan, PlanError, PlanFault, ScaleChoice, Setting};
use crate::report::{self, ChoiceReason, OutputReport, PlannedChoice, SavedBytes};
use crate::runtime::{Consumer, Reservation, Runtime};
use crate::sources::Schema;
use buckets::Task;
use content::Content;
use finish::finish;
use frame::{Frame, refused};
use large::WORD_BYTES;
use output::{BatchFile, ORIGINAL_BYTES};
use task::{TaskResults, Worker, Workshop, bytes_per_point};

/// Tasks per thread, so that threads end together; their sizes. Small ones share too much with each other, large ones
/// leave the caches.
const TASKS_PER_THREAD: u64 = 6;
const MAX_TASK_POINTS: u64 = 800_000;
const MIN_TASK_POINTS: u64 = 50_000;

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
        let extras = if is_usual { 0 } else { kept.saturating_sub(colour) };
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

    fn write(
        &self,
        cloud: &Cloud<'_>,
        rt: &Runtime<'_>,
        to: &StagedDataset,
        _units: Option<GroupUnits<'_>>,
    ) -> Result<OutputReport, ConvertError> {
        let (points, per_point) = (cloud.points(), bytes_per_point(cloud.frame.stride));
        let most = rt.budget.task_points(per_point, MAX_TASK_POINTS);
        let task_points = (points / (rt.threads as u64 * TASKS_PER_THREAD)).max(MIN_TASK_POINTS).min(most);
        let content = Content::choose(cloud);
        let frame = Frame::new(cloud, self.lod_cell)?;
        let attributes: Vec<_> = content.extras.iter().map(|e| e.attribute.clone()).collect();
        let layout = Layout::new(points, &attributes, planes::at_most(cloud, &frame, self.planes)).map_err(refused)?;
        let tasks = buckets::tasks(cloud, rt, &frame, task_points)?;
        let sorted = Store::new(rt.temp.clone(), cloud.frame.stride + WORD_BYTES, 1, &rt.memory);
        let mut room = Reservation::new(&rt.memory, Consumer::Cells);
        room.resize(tasks.iter().map(|task| task.segments.bytes() + size_of::<Task>() as u64).sum())?;
        let tasks = large::cut(tasks, cloud, rt, (&frame, &content), &sorted, task_points)?;
        let file = to.create(self.kind().marker_file())?;
        // what is compressed is written raw first, elsewhere
        let raw = self.zstd_level.map(|_| rt.temp.make()).transpose()?;
        let originals = Store::new(rt.temp.clone(), ORIGINAL_BYTES, 1, &rt.memory);
        let output =
            BatchFile::new(raw.as_ref().unwrap_or(&file), &layout, originals, Recovery::new(cloud), frame.grid.origin);
        let shop = Workshop {
            frame: &frame,
            content: &content,
            store: &cloud.store,
            sorted: &sorted,
            stride: cloud.frame.stride,
            output: &output,
            keeps_originals: self.originals,
            usual_points: task_points.min(points),
        };
        let results = encode(rt, &shop, &tasks)?;
        results.ledger.check(&cloud.stats.checksum)?;
        let mut finished = finish(cloud, self, &frame, &content, &output, &results)?;
        if let (Some(raw), Some(level)) = (&raw, self.zstd_level) {
            compress::compress(rt, raw, &file, level, &mut finished)?;
        }
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
    let mut all = TaskResults::default();
    for mut results in each {
        all.ledger.merge(&results.ledger);
        all.lod_points.iter_mut().zip(results.lod_points).for_each(|(a, b)| *a += b);
        all.changed += results.changed;
        all.edges.append(&mut results.edges);
    }
    all.edges.sort_unstable_by_key(|(index, _)| *index);
    Ok(all)
}
