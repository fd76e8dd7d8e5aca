//! The Potree 2.0 octree: payloads behind one another in `octree.bin`, and the two files around them.

mod earlier;
mod layout;
mod metadata;
mod names;
mod notes;
mod payload;
mod settings;
mod watch;

use std::sync::{Mutex, PoisonError};

use pointmill_format::DatasetKind;
use pointmill_format::potree2::{CHUNK_RECORDS, NodeEntry, encode_hierarchy};
use serde_json::{Map, Value};

pub(crate) use layout::OutputLayout;
pub(super) use layout::viewable;
pub(super) use names::Names;
pub(crate) use payload::PayloadEncoder;
pub use settings::{DarkColours, Encoding, Potree2Settings};

use self::earlier::EarlierDataset;
use self::watch::{AllSeen, Watch};
use super::attributes::{Choice, changed, choose};
use super::octrees::{ChosenSpacing, TreeSettings, UNIT_BYTES, errors, tree_report};
use super::output::{DiskSize, OctreeOutput, OctreeWriter, Output, Target, Wants};
use super::staging::{OutputFile, StagedDataset};
use crate::cloud::Cloud;
use crate::error::{ConvertError, Unsupported};
use crate::job::{Build, KeptFile, decode};
use crate::octree::{self, AnySink, EarlierTree, FinishedNode, NodeSink, Octree, OctreeSettings};
use crate::plan::{Plan, PlanError, PlanFault, Setting};
use crate::reason::BuiltAnew;
use crate::report::{self, OutputReport, PlannedChoice, SavedBytes, TakenOver};
use crate::runtime::{Events, Runtime};
use crate::sources::{POSITION_BYTES, ResolvedCrs, Schema};
use crate::warning::Warning;

/// Elements of an attribute that readers of the format accept.
pub(super) const MAX_ELEMENTS: usize = 16;

/// The file of the nodes.
const PAYLOADS: &str = "octree.bin";

/// Bytes of a hierarchy record.
const NODE_BYTES: u64 = 22;

impl From<Potree2Settings> for Target {
    fn from(settings: Potree2Settings) -> Self {
        Self::new(settings)
    }
}

impl Output for Potree2Settings {
    fn kind(&self) -> DatasetKind {
        DatasetKind::Potree2
    }

    fn check(&self, _: &Plan) -> Result<(), ConvertError> {
        self.tree().check()?;
        match self.encoding {
            Encoding::Brotli { quality } if quality > 11 => {
                Err(PlanError::new(Setting::BrotliQuality, PlanFault::NotOneOf("0 to 11")).into())
            }
            _ => Ok(()),
        }
    }

    fn wants(&self, plan: &Plan, all: &Schema) -> Wants {
        Wants::chosen(plan, all, true)
    }

    fn least_points(&self) -> u64 {
        u64::from(self.leaf_capacity)
    }

    fn least_bytes(&self) -> u64 {
        UNIT_BYTES
    }

    fn disk_size(&self, _: &Plan, _: &Schema, kept: u64) -> DiskSize {
        let nodes = 3000 / u64::from(self.leaf_capacity).max(1) + 1;
        DiskSize { per_point: POSITION_BYTES as u64 + kept, per_1000_points: nodes * NODE_BYTES }
    }

    fn describe_settings(&self, settings: &mut Map<String, Value>) {
        self.tree().describe(settings);
        let encoding = match self.encoding {
            Encoding::Default => "default",
            Encoding::Brotli { quality } => {
                settings.insert("brotli-quality".into(), quality.into());
                "brotli"
            }
        };
        settings.insert("encoding".into(), encoding.into());
        settings.insert("dark-colours".into(), self.dark_colours.name().into());
    }

    fn choices(&self, _: &Plan) -> Vec<PlannedChoice> {
        let encoding = match self.encoding {
            Encoding::Default => "default".to_owned(),
            Encoding::Brotli { quality } => format!("brotli, quality {quality}"),
        };
        let mut choices = self.tree().choices(Self::default().leaf_capacity);
        choices.push(PlannedChoice::or_default("encoding", encoding.as_str(), "default"));
        choices
    }

    fn foresee(&self, schema: &Schema, kept: &[usize], crs: &ResolvedCrs) -> Vec<Warning> {
        notes::foresee(self, schema, kept, crs)
    }

    fn keeps_lattice(&self) -> bool {
        true
    }

    fn saved_bytes(&self) -> SavedBytes {
        match self.encoding {
            Encoding::Brotli { .. } => SavedBytes::Compressed,
            Encoding::Default => SavedBytes::FixedRecords,
        }
    }

    fn octree(&self) -> Option<&dyn OctreeOutput> {
        Some(self)
    }
}

impl OctreeOutput for Potree2Settings {
    fn tree(&self) -> TreeSettings {
        let Self { sampling, spacing, leaf_capacity, .. } = *self;
        TreeSettings { sampling, spacing, leaf_capacity, most_points: u32::MAX }
    }

    fn begin<'a>(
        &'a self,
        cloud: &'a Cloud<'a>,
        rt: &'a Runtime<'a>,
        spacing: ChosenSpacing,
        to: &'a StagedDataset,
    ) -> Result<Box<dyn OctreeWriter + 'a>, ConvertError> {
        let schema = cloud.schema();
        let choice = choose(cloud.plan, schema, &cloud.intake.unread, &cloud.facts.ranges, &cloud.facts.relations);
        if let Some(wide) = choice.kept.iter().map(|&i| &schema.attributes[i]).find(|a| a.elements > MAX_ELEMENTS) {
            let (kind, name, elements) = (self.kind(), wide.name.clone(), wide.elements);
            return Err(Unsupported::WideAttribute { kind, name, elements, max: MAX_ELEMENTS }.into());
        }
        let layout = OutputLayout::new(schema, &choice.kept, &cloud.frame);
        let earlier = cloud.plan.append.then(|| {
            let names = Names::of(&notes::attributes(schema, &choice.kept)).stored;
            EarlierDataset::open(cloud, rt, self, &spacing, &layout, &names)
        });
        Ok(Box::new(Payloads {
            file: to.past_cache(PAYLOADS, to.create_kept(PAYLOADS)?),
            turn: Mutex::default(),
            layout,
            earlier,
            events: rt.events(),
            watch: self.watch(cloud, &choice.kept),
            seen: AllSeen::default(),
            settings: self,
            cloud,
            spacing,
            choice,
            to,
        }))
    }
}

impl Potree2Settings {
    /// What to look for in the points.
    fn watch(&self, cloud: &Cloud<'_>, kept: &[usize]) -> Watch {
        let (schema, facts) = (cloud.schema(), &cloud.facts);
        let is_deep = (0..cloud.sources.all.len()).any(|source| !facts.widening.is_narrow(source));
        let attributes = kept.iter().map(|&i| (&schema.attributes[i], &facts.ranges[i]));
        Watch::new(attributes, is_deep, self.dark_colours)
    }
}

fn entry(node: &FinishedNode) -> NodeEntry {
    let FinishedNode { key, points, byte_offset, byte_size } = *node;
    NodeEntry::new(key, points, byte_offset, byte_size)
}

/// A dataset while its nodes are made.
struct Payloads<'a> {
    /// `octree.bin`
    file: OutputFile,
    /// Whose turn it is to write: threads that wait for the lock of a file in the kernel do not sleep.
    turn: Mutex<()>,
    layout: OutputLayout,
    /// The dataset that scans are added to, or why nothing can be taken from it.
    earlier: Option<Result<EarlierDataset, BuiltAnew>>,
    events: &'a dyn Events,
    watch: Watch,
    seen: AllSeen,
    settings: &'a Potree2Settings,
    cloud: &'a Cloud<'a>,
    spacing: ChosenSpacing,
    choice: Choice,
    to: &'a StagedDataset,
}

impl NodeSink for Payloads<'_> {
    type Encoder<'s>
        = PayloadEncoder<'s>
    where
        Self: 's;

    fn encoder(&self) -> PayloadEncoder<'_> {
        PayloadEncoder::new(self.layout.clone(), self.settings.encoding, self.events)
            .watching(self.watch.clone(), &self.seen)
    }

    fn write(&self, _: &[FinishedNode], bytes: &[u8], offset: u64) -> Result<(), ConvertError> {
        let turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        self.file.file.write_at(bytes, offset, "writing node payloads")?;
        drop(turn);
        self.file.file.start_write_back(offset, bytes.len());
        Ok(())
    }

    fn add_notes(&self, notes: &[u8]) -> Result<(), ConvertError> {
        self.seen.add(&decode(notes)?);
        Ok(())
    }

    fn kept(&self) -> Option<KeptFile<'_>> {
        self.file.kept(0)
    }

    fn earlier(&self) -> Option<&dyn EarlierTree> {
        self.earlier.as_ref()?.as_ref().ok().map(|earlier| earlier as &dyn EarlierTree)
    }

    fn write_part(&self, node: &FinishedNode, bytes: &[u8], at: u64) -> Result<(), ConvertError> {
        self.write(&[], bytes, node.byte_offset + at)
    }
}

impl OctreeWriter for Payloads<'_> {
    fn sink(&self) -> &dyn AnySink {
        self
    }

    fn build(&self, build: Build<'_>, settings: OctreeSettings) -> Result<Octree, ConvertError> {
        octree::build(build, settings, self)
    }

    fn finish(self: Box<Self>, tree: Octree) -> Result<OutputReport, ConvertError> {
        let file = &self.file.file;
        file.set_len(tree.bytes, "ending the payloads")?;
        file.sync("syncing the payloads")?;
        let Self { seen, settings, cloud, spacing, choice, to, earlier, .. } = *self;
        let (kind, schema) = (settings.kind(), cloud.schema());
        let mut nodes: Vec<NodeEntry> = tree.nodes.iter().map(entry).collect();
        let hierarchy = encode_hierarchy(&mut nodes, CHUNK_RECORDS);
        let names = Names::of(&notes::attributes(schema, &choice.kept));
        let metadata = metadata::metadata(cloud, settings, &spacing, &choice, &names, &tree.ledger, &hierarchy);
        to.write("hierarchy.bin", &hierarchy.bytes)?;
        let json = metadata.to_json();
        to.write("metadata.json", json.as_bytes())?;
        let seen = seen.total();
        let doubled = choice.kept.iter().filter_map(|&i| {
            let (attribute, changes) = (&schema.attributes[i], cloud.stats.doubled.get(i)?);
            changed(kind, attribute, viewable(attribute.ty), changes)
        });
        let rounded = schema.rgb().and_then(|i| {
            let attribute = &schema.attributes[i];
            changed(kind, attribute, attribute.ty, &seen.rounded)
        });
        let (attributes_changed, changes): (_, Vec<_>) = doubled.chain(rounded).unzip();
        let mut warnings = settings.foresee(schema, &choice.kept, &cloud.facts.crs);
        warnings.extend(notes::seen(settings, &seen, tree.ledger.points()));
        warnings.extend(changes);
        Ok(OutputReport {
            points: tree.ledger.points(),
            duplicates_dropped: tree.ledger.duplicates_dropped(),
            accuracy: report::accuracy(
                cloud,
                tree.ledger.points(),
                errors(cloud, cloud.frame.cube.min.0, metadata.lattice.offset),
            ),
            attributes: cloud.names(choice.kept.iter().copied()),
            attributes_dropped: choice.dropped,
            attributes_changed,
            attributes_renamed: names.renamed,
            warnings,
            bytes: tree.bytes + (hierarchy.bytes.len() + json.len()) as u64,
            checksum: tree.ledger.unaltered().to_string(),
            tree: tree_report(&tree),
            taken_over: earlier.map(|earlier| earlier.map_or_else(TakenOver::nothing, |_| tree.taken_over)),
            details: [("spacing".to_owned(), spacing.describe())].into_iter().chain(notes::details(&seen)).collect(),
            ..OutputReport::default()
        })
    }
}
