//! The mean-split binary tree: upper splits from exact sums of cells, everything below in memory, leaves where they belong.
//!
//! 1. [`upper`] splits nodes that are too large for memory. A node is a list of cells whose sums and extremes are known
//!    from the one pass over the inputs, so axis and plane are exact without reading a point; only cells that the plane
//!    crosses are read, and divided.
//! 2. [`subtree`] takes what is small enough into memory, and partitions it down to leaves, one subtree per thread.
//! 3. [`leaf`] puts the points of a leaf in order and encodes them; [`files`] puts the bytes at their place, which is
//!    known from the number of points before them.
//!
//! Planes come from exact integers, so the tree is the same for any order of points, number of threads and memory.

mod assemble;
mod extent;
mod files;
mod item;
mod large;
mod leaf;
mod order;
mod rule;
mod settings;
mod subtree;
mod unit_check;
mod upper;

use std::io::BufWriter;
use std::sync::{Mutex, PoisonError};

use pointmill_format::bintree::{CORE_BYTES, Header, INDEX_FILE, IndexWriter, Layout, Node};
use pointmill_format::{AttributeType, DatasetKind, Deviations};
use serde_json::{Map, Value};

pub use self::settings::BintreeSettings;

use self::assemble::{assemble, figures};
use self::files::{Leaves, Place};
use self::leaf::Columns;
use self::settings::{RGBA, class_of};
use self::subtree::{Builder, Built, Room};
use self::unit_check::can_be_of;
use super::attributes::changed;
use super::origin::own_key;
use super::output::{DiskSize, Output, Target, Wants};
use super::recovery::Lost;
use super::staging::StagedDataset;
use crate::cloud::{Cloud, Ledger};
use crate::error::{ConvertError, Unsupported};
use crate::job::{self, Build, GroupUnits, InPlace, UnitLog, make_units, put_back};
use crate::plan::{AttributeChoice, Duplicates, Plan, PlanError, PlanFault, Setting};
use crate::report::{self, FormatErrors, OutputReport, PlannedChoice};
use crate::runtime::{Consumer, Reservation, Runtime, Sequential};
use crate::sources::Schema;
use crate::warning::Warning;

/// Tasks of this size keep all threads busy to the end, and few cells are cut above them.
const MAX_TASK_POINTS: u64 = 2_000_000;

/// The same of a job that several processes share, whatever memory they have.
const SHARED_TASK_POINTS: u64 = 500_000;

/// This many files are slow to write, to copy and to list.
const MANY_FILES: usize = 20_000;

/// Bytes of a node in the index, at most: 194 to 208 were measured.
const INDEX_NODE_BYTES: u64 = 220;

impl From<BintreeSettings> for Target {
    fn from(settings: BintreeSettings) -> Self {
        Self::new(settings)
    }
}

impl Output for BintreeSettings {
    fn kind(&self) -> DatasetKind {
        DatasetKind::Bintree
    }

    fn check(&self, plan: &Plan) -> Result<(), ConvertError> {
        if plan.duplicates == Duplicates::Drop {
            return Err(Unsupported::DropDuplicates(self.kind()).into());
        }
        match self.capacity {
            0 => Err(PlanError::new(Setting::Capacity, PlanFault::Zero).into()),
            _ => Ok(()),
        }
    }

    fn wants(&self, plan: &Plan, all: &Schema) -> Wants {
        let mut wants = Wants::chosen(plan, all, false);
        wants.add(class_of(all));
        wants.moments = true;
        if let Some(rgb) = all.rgb() {
            wants.other_names = &[RGBA];
            if matches!(&plan.attributes, AttributeChoice::List(names) if names.iter().any(|n| n == RGBA)) {
                wants.add(Some(rgb));
            }
        }
        wants
    }

    fn disk_size(&self, plan: &Plan, schema: &Schema, kept: u64) -> DiskSize {
        // Leaves are two thirds full, and there is an inner node for each.
        let nodes = 3000 / u64::from(self.capacity).max(1) + 1;
        let class = class_of(schema).map_or(0, |i| schema.attributes[i].size() as u64);
        let is_usual = plan.attributes == AttributeChoice::Usual;
        let extras = if is_usual { plan.derive.bytes() } else { kept.saturating_sub(class).next_multiple_of(4) };
        DiskSize { per_point: CORE_BYTES as u64 + extras, per_1000_points: nodes * INDEX_NODE_BYTES }
    }

    fn describe_settings(&self, settings: &mut Map<String, Value>) {
        settings.insert("capacity".into(), self.capacity.into());
        settings.insert("split".into(), self.split.name().into());
        settings.insert("layout".into(), self.layout.name().into());
    }

    fn choices(&self, _: &Plan) -> Vec<PlannedChoice> {
        let default = Self::default();
        vec![
            PlannedChoice::or_default("points of a leaf, at most", self.capacity, default.capacity),
            PlannedChoice::or_default("split", self.split.name(), default.split.name()),
            PlannedChoice::or_default("layout", self.layout.name(), default.layout.name()),
        ]
    }

    fn write(&self, build: Build<'_>, to: &StagedDataset) -> Result<OutputReport, ConvertError> {
        let Build { cloud, rt, units } = build;
        let columns = Columns::choose(cloud)?;
        let bytes_per_point = Builder::bytes_per_point(cloud.frame.stride, &columns.record, self.capacity);
        let task_points = rt.budget.task_points(bytes_per_point, MAX_TASK_POINTS);
        let task_points = if build.is_shared() { SHARED_TASK_POINTS } else { task_points };
        let can_be = |upper: &upper::Upper| upper.can_be_of(cloud.points());
        let upper = build.divided(can_be, || upper::split(cloud, rt, self, task_points))?;
        let mut room = Reservation::new(&rt.memory, Consumer::Cells);
        room.resize(upper.tasks.iter().map(upper::Task::bytes).sum())?;
        let division: Vec<_> = upper.tasks.iter().map(|task| (task.start, task.points())).collect();
        let units = units.map(|units| units.divided(cloud, &division)).transpose()?;
        let make = Make { cloud, rt, settings: self, columns: &columns, tasks: &upper.tasks, task_points };
        let leaves = Leaves::new(self.layout, columns.record.stride(), to)?;
        if let Some(units) = units {
            make.units(units, leaves.in_place())?;
        }
        let (built, _known) = make.all(units, &leaves)?;
        let leaf_bytes = leaves.finish(rt)?;

        let mut ledger = Ledger::default();
        let (mut deviations, mut lost) = (Deviations::default(), Lost::default());
        for subtree in &built {
            ledger.merge(&subtree.ledger);
            deviations.merge(&subtree.deviations);
            lost.merge(subtree.lost);
        }
        ledger.check(&cloud.stats.checksum)?;
        let nodes = assemble(&upper, built);
        let index_bytes = write_index(cloud, self, &columns, &nodes, to)?;
        let (tree, details) = figures(&nodes);
        let leaves = nodes.iter().filter(|n| n.is_leaf()).count();
        let odd = class_of(cloud.schema()).and_then(|class| {
            let (attribute, changes) = (&cloud.schema().attributes[class], &cloud.stats.odd_classes);
            changed(self.kind(), attribute, AttributeType::Float32, changes)
        });
        let (attributes_changed, mut warnings): (Vec<_>, Vec<_>) = odd.into_iter().unzip();
        let is_many = self.layout == Layout::Files && leaves > MANY_FILES;
        warnings.extend(is_many.then_some(Warning::ManyFiles { leaves }));
        Ok(OutputReport {
            points: ledger.points(),
            accuracy: report::accuracy(
                cloud,
                ledger.points(),
                FormatErrors::measured(&deviations, lost.points, lost.merged),
            ),
            attributes: columns.names(),
            attributes_dropped: columns.dropped,
            bytes: leaf_bytes + index_bytes,
            checksum: ledger.unaltered().to_string(),
            tree,
            details,
            attributes_changed,
            warnings,
            ..OutputReport::default()
        })
    }
}

/// What all tasks share.
struct Make<'a> {
    cloud: &'a Cloud<'a>,
    rt: &'a Runtime<'a>,
    settings: &'a BintreeSettings,
    columns: &'a Columns,
    tasks: &'a [upper::Task],
    /// A task of more points is built on the disk.
    task_points: u64,
}

impl Make<'_> {
    /// Builds the subtrees of a job that are to be built here, each into a file of its own; their leaves into the output if a job
    /// has it.
    fn units(&self, units: GroupUnits<'_>, output: Option<&dyn InPlace<Place>>) -> Result<(), ConvertError> {
        let points: Vec<u64> = self.tasks.iter().map(upper::Task::points).collect();
        let (layout, stride) = (self.settings.layout, self.columns.record.stride());
        let is_packed = layout == Layout::Packed;
        let can_be = |index: usize, said: &_| can_be_of(said, &self.tasks[index], stride as u64, is_packed);
        // memory of units that are done, for the next
        let rooms: Mutex<Vec<Room>> = Mutex::default();
        make_units(units, &points, output, self.rt, can_be, |index, file| {
            let log = UnitLog::begin(file, output);
            let built = {
                let put = |place: Place, records: &[u8]| log.put(place, records);
                let leaves = Leaves::of_unit(layout, stride, &put);
                let room = rooms.lock().unwrap_or_else(PoisonError::into_inner).pop().unwrap_or_default();
                let mut builder = Builder::new(self.cloud, self.settings, self.columns, &leaves, room);
                let built = self.one(&mut builder, index)?;
                rooms.lock().unwrap_or_else(PoisonError::into_inner).push(builder.room);
                built
            };
            log.end(&built)
        })
    }

    /// Builds all subtrees, in parallel, or takes them from the files of `units`; they come back in order, with what their nodes
    /// take.
    fn all<'l>(
        &'l self,
        units: Option<GroupUnits<'_>>,
        leaves: &'l Leaves<'l>,
    ) -> Result<(Vec<Built>, Vec<Reservation>), ConvertError> {
        let Self { cloud, rt, settings, columns, tasks, .. } = *self;
        let done = rt.in_parallel(
            tasks.len(),
            || {
                (
                    Builder::new(cloud, settings, columns, leaves, Room::default()),
                    Vec::new(),
                    Reservation::new(&rt.memory, Consumer::Nodes),
                )
            },
            |(builder, built, known), index| {
                let subtree = match units {
                    Some(units) => recalled(units, index, &tasks[index], leaves)?,
                    None => self.one(builder, index)?,
                };
                // they are copied once, when all are put together
                known.resize(known.bytes() + 2 * (subtree.nodes.len() * size_of::<Node>()) as u64)?;
                built.push((index, subtree));
                if units.is_none() {
                    rt.advance(tasks[index].points());
                }
                Ok(())
            },
            |(_, built, known)| (built, known),
        )?;
        let (built, known): (Vec<_>, Vec<Reservation>) = done.into_iter().unzip();
        let mut built: Vec<(usize, Built)> = built.into_iter().flatten().collect();
        built.sort_unstable_by_key(|(index, _)| *index);
        Ok((built.into_iter().map(|(_, built)| built).collect(), known))
    }

    fn one(&self, builder: &mut Builder<'_>, index: usize) -> Result<Built, ConvertError> {
        let task = &self.tasks[index];
        if task.points() > self.task_points {
            return builder.build_large(task, self.rt, self.rt.budget.chunk_bytes());
        }
        builder.build(task)
    }
}

/// A subtree that a unit has built, its leaves put where they belong.
fn recalled(
    units: GroupUnits<'_>,
    index: usize,
    task: &upper::Task,
    leaves: &Leaves<'_>,
) -> Result<Built, ConvertError> {
    let mut there = Vec::new();
    let put = |place: &Place, byte: u64, records: &[u8]| leaves.put_back(place, byte, records);
    let can_be = |said: &_| can_be_of(said, task, leaves.stride(), leaves.is_packed());
    let note = |place: Place, at: job::Place| there.push((place, at.offset, at.bytes));
    let built = units.recall(index, |unit| put_back(unit, leaves.stride(), can_be, put, note))?;
    let built = built.ok_or_else(|| units.gone(index))?;
    leaves.take(&there)?;
    Ok(built)
}

fn write_index(
    cloud: &Cloud<'_>,
    settings: &BintreeSettings,
    columns: &Columns,
    nodes: &[Node],
    staged: &StagedDataset,
) -> Result<u64, ConvertError> {
    let mut header = Header::new(cloud.lattice.lattice, u64::from(settings.capacity), settings.layout);
    header.generator = format!("pointmill {}", env!("CARGO_PKG_VERSION"));
    header.name = cloud.plan.cloud_name();
    header.points = nodes.first().map_or(0, |root| root.count);
    header.split = settings.split;
    header.origin = nodes.first().map_or([0.0; 3], |root| root.bounds.min.map(f64::floor));
    header.projection.clone_from(&cloud.facts.crs.projection);
    header.pointmill = own_key(cloud, &columns.dropped);
    header.record = columns.record.clone();
    let file = staged.create(INDEX_FILE)?;
    let fail = |e| file.failed("writing the index", e);
    let mut index = IndexWriter::new(BufWriter::with_capacity(1 << 20, Sequential::new(&file)), &header)
        .map_err(|e| fail(e.into()))?;
    for node in nodes {
        index.node(node).map_err(|e| fail(e.into()))?;
    }
    let written = index.finish().map_err(|e| fail(e.into()))?.into_inner().map_err(|e| fail(e.into_error()))?;
    file.sync("writing the index")?;
    Ok(written.len())
}
