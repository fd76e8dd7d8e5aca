//! The Potree 1 octree: a file for each node in nested folders, index files beside them, and `cloud.js`.
//!
//! [`content`] decides what a record is made of, [`column`] fills what follows the colour; [`steps`] turns positions into
//! integers of the box of their node, [`errors`] says how far these are from the lattice. [`files`] is a `NodeSink`.

mod archive;
mod column;
mod content;
mod encoder;
mod errors;
mod files;
mod metadata;
mod notes;
mod settings;
mod steps;

use std::sync::PoisonError;

use pointmill_format::DatasetKind;
use pointmill_format::potree1::{IndexFile, METADATA_FILE, Metadata, NodeCount, encode_index};
use serde_json::{Map, Value};

pub use settings::{Potree1Settings, Potree1Version};

use self::content::{COLOUR_BYTES, Content};
use self::encoder::{Encoding, Tally};
use self::errors::Meter;
use self::files::NodeFiles;
use self::steps::Steps;
use super::attributes::changed;
use super::colour::colour_of;
use super::octrees::{ChosenSpacing, TreeSettings, UNIT_BYTES, tree_report};
use super::output::{DiskSize, OctreeOutput, OctreeWriter, Output, Target, Wants};
use super::staging::StagedDataset;
use crate::cloud::Cloud;
use crate::error::{ConvertError, Unsupported};
use crate::job::Build;
use crate::octree::{self, AnySink, Octree, OctreeSettings};
use crate::plan::{AttributeChoice, Plan, PlanError, PlanFault, Setting};
use crate::report::{self, ChangedAttribute, OutputReport, PlannedChoice};
use crate::runtime::Runtime;
use crate::sources::{POSITION_BYTES, ResolvedCrs, Schema};
use crate::warning::Warning;

/// Bytes that a file takes on a disk beside its contents, on average, and its record in an index.
const NODE_BYTES: u64 = 2048 + 5;

/// The same of a file in an archive: its head and its entry.
const ARCHIVED_BYTES: u64 = 150 + 5;

impl From<Potree1Settings> for Target {
    fn from(settings: Potree1Settings) -> Self {
        Self::new(settings)
    }
}

impl Output for Potree1Settings {
    fn kind(&self) -> DatasetKind {
        DatasetKind::Potree1
    }

    fn check(&self, _: &Plan) -> Result<(), ConvertError> {
        if self.max_node_points == Some(0) {
            return Err(PlanError::new(Setting::MaxNodePoints, PlanFault::Zero).into());
        }
        self.tree().check()
    }

    fn wants(&self, plan: &Plan, all: &Schema) -> Wants {
        let mut wants = Wants::chosen(plan, all, false);
        wants.add(colour_of(all));
        wants
    }

    fn stays_in_place(&self) -> bool {
        false // a file for each node
    }

    fn least_points(&self) -> u64 {
        u64::from(self.capacity())
    }

    fn least_bytes(&self) -> u64 {
        UNIT_BYTES
    }

    fn disk_size(&self, plan: &Plan, schema: &Schema, kept: u64) -> DiskSize {
        let nodes = 3000 / u64::from(self.capacity()).max(1) + 1;
        let colour = schema.rgb().map_or(0, |i| schema.attributes[i].size() as u64);
        let others =
            if plan.attributes == AttributeChoice::Usual { plan.derive.bytes() } else { kept.saturating_sub(colour) };
        let per_point = (POSITION_BYTES + COLOUR_BYTES) as u64 + others;
        DiskSize { per_point, per_1000_points: nodes * if self.archive { ARCHIVED_BYTES } else { NODE_BYTES } }
    }

    fn describe_settings(&self, settings: &mut Map<String, Value>) {
        self.tree().describe(settings);
        settings.insert("potree1-version".into(), self.version.name().into());
        if self.archive {
            settings.insert("archive".into(), true.into());
        }
        if let Some(most) = self.max_node_points {
            settings.insert("max-node-points".into(), most.into());
        }
    }

    fn choices(&self, _: &Plan) -> Vec<PlannedChoice> {
        let mut choices = self.tree().choices(Self::default().leaf_capacity);
        choices.push(PlannedChoice::or_default("version", self.version.name(), Self::default().version.name()));
        choices
    }

    fn foresee(&self, _: &Schema, _: &[usize], crs: &ResolvedCrs) -> Vec<Warning> {
        notes::foresee(self.version, crs)
    }

    fn octree(&self) -> Option<&dyn OctreeOutput> {
        Some(self)
    }
}

impl OctreeOutput for Potree1Settings {
    fn tree(&self) -> TreeSettings {
        let Self { sampling, spacing, max_node_points, .. } = *self;
        let most_points = max_node_points.unwrap_or(u32::MAX);
        TreeSettings { sampling, spacing, leaf_capacity: self.capacity(), most_points }
    }

    fn begin<'a>(
        &'a self,
        cloud: &'a Cloud<'a>,
        rt: &'a Runtime<'a>,
        spacing: ChosenSpacing,
        to: &'a StagedDataset,
    ) -> Result<Box<dyn OctreeWriter + 'a>, ConvertError> {
        let content = Content::choose(cloud, self.version)?;
        let steps = Steps::new(&cloud.frame, &cloud.lattice.lattice);
        if let Some((axis, step)) = steps.finer_axis(&cloud.lattice.lattice) {
            let (kind, least) = (self.kind(), steps.scale);
            return Err(Unsupported::FineAxis { kind, axis, step, least }.into());
        }
        let metadata = metadata::metadata(cloud, self, &spacing, &content, &steps);
        let meter = Meter::new(cloud, &steps);
        let mut encoding = Encoding::new(content, steps, cloud.frame.stride, meter, rt.events());
        encoding.archived = self.archive.then(|| metadata.clone());
        let files = NodeFiles::new(encoding, metadata, to, rt)?;
        Ok(Box::new(Writer { settings: self, cloud, rt, to, spacing, files }))
    }
}

/// A dataset while its nodes are made.
struct Writer<'a> {
    settings: &'a Potree1Settings,
    cloud: &'a Cloud<'a>,
    rt: &'a Runtime<'a>,
    to: &'a StagedDataset,
    spacing: ChosenSpacing,
    files: NodeFiles<'a>,
}

impl OctreeWriter for Writer<'_> {
    fn sink(&self) -> &dyn AnySink {
        &self.files
    }

    fn build(&self, build: Build<'_>, settings: OctreeSettings) -> Result<Octree, ConvertError> {
        octree::build(build, settings, &self.files)
    }

    fn finish(self: Box<Self>, tree: Octree) -> Result<OutputReport, ConvertError> {
        let Self { settings, cloud, rt, to, spacing, files } = *self;
        let indexes = indexes(&tree, files.metadata())?;
        if !settings.archive {
            write_index(&tree, &indexes, to, &files, rt)?;
        }
        let (Encoding { content, steps, tally, .. }, mut metadata, archive) = files.into_parts();
        metadata.points = Some(tree.ledger.points());
        let bytes = match archive {
            Some(archive) => archive.finish(&tree.nodes, tree.bytes, &indexes, &metadata, rt)?,
            None => {
                let json = metadata.to_json();
                to.write(METADATA_FILE, json.as_bytes())?;
                tree.bytes + indexes.iter().map(|index| index.bytes.len() as u64).sum::<u64>() + json.len() as u64
            }
        };

        let tally = tally.into_inner().unwrap_or_else(PoisonError::into_inner);
        let (attributes_changed, changes) = settings.changes(cloud, &content, &tally);
        let mut warnings = settings.foresee(cloud.schema(), &content.kept, &cloud.facts.crs);
        warnings.extend(content.warnings);
        warnings.extend(changes);
        warnings.extend(notes::crowded(&tree.nodes, settings.max_node_points));
        let errors = errors::errors(cloud, &steps, &tree.nodes, &tally.positions);
        Ok(OutputReport {
            points: tree.ledger.points(),
            duplicates_dropped: tree.ledger.duplicates_dropped(),
            accuracy: report::accuracy(cloud, tree.ledger.points(), errors),
            attributes: cloud.names(content.kept.iter().copied()),
            attributes_dropped: content.dropped,
            attributes_changed,
            attributes_renamed: content.renamed,
            warnings,
            bytes,
            checksum: tree.ledger.unaltered().to_string(),
            tree: tree_report(&tree),
            details: settings.details(&spacing, &metadata),
            ..OutputReport::default()
        })
    }
}

impl Potree1Settings {
    /// Points of a leaf, at most.
    fn capacity(&self) -> u32 {
        self.leaf_capacity.min(self.max_node_points.unwrap_or(u32::MAX))
    }

    /// Attributes whose values the dataset cannot hold as they were read.
    fn changes(&self, cloud: &Cloud<'_>, content: &Content, tally: &Tally) -> (Vec<ChangedAttribute>, Vec<Warning>) {
        let schema = cloud.schema();
        let columns = content.columns.iter().zip(&tally.changes);
        let each = columns.flat_map(|(column, of_column)| {
            column.indices.iter().filter_map(move |&i| {
                let doubled = cloud.stats.doubled.get(i).filter(|_| column.source.doubles());
                changed(self.kind(), &schema.attributes[i], column.stored_as, doubled.unwrap_or(of_column))
            })
        });
        each.unzip()
    }

    /// What is particular to the format, for the report.
    fn details(&self, spacing: &ChosenSpacing, metadata: &Metadata) -> Map<String, Value> {
        let mut details = Map::new();
        details.insert("spacing".into(), spacing.describe());
        details.insert("step".into(), metadata.scale.into());
        details.insert("version".into(), self.version.name().into());
        details
    }
}

/// The index files.
fn indexes(tree: &Octree, metadata: &Metadata) -> Result<Vec<IndexFile>, ConvertError> {
    let mut counts: Vec<NodeCount> =
        tree.nodes.iter().map(|node| NodeCount { key: node.key, points: node.points }).collect();
    encode_index(&mut counts, metadata.step)
        .map_err(|e| ConvertError::Internal(format!("the index of the octree: {e}")))
}

/// Writes the index files, and syncs all that was written.
fn write_index(
    tree: &Octree,
    indexes: &[IndexFile],
    to: &StagedDataset,
    files: &NodeFiles<'_>,
    rt: &Runtime<'_>,
) -> Result<(), ConvertError> {
    for index in indexes {
        rt.check_stop()?;
        to.create(&files.metadata().index_file(index.root))?.write_at(&index.bytes, 0, "writing the index")?;
    }
    let roots: Vec<_> = indexes.iter().map(|index| index.root).collect();
    files.sync(&tree.nodes, &roots, rt)
}
