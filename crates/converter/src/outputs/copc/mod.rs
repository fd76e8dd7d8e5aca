//! COPC: a LAZ file whose chunks are the nodes of an octree.
//!
//! [`content`] decides what a record is made of, [`encoder`] makes the chunks of nodes, which stand in the file in the order
//! of the tree. What is around them is written at the end.

mod content;
mod encoder;
mod notes;
mod settings;

use std::borrow::Cow;
use std::sync::{Mutex, PoisonError};

use pointmill_format::copc::{Heading, Info};
use pointmill_format::potree2::NodeEntry;
use pointmill_format::scan::las::write::ChunkEncoder;
use pointmill_format::{Changes, DatasetKind, WriteError};
use serde_json::{Map, Value};

pub use settings::CopcSettings;

use self::content::Content;
use self::encoder::{ChunkMaker, Counted, Encoding};
use super::attributes::changed;
use super::octrees::{self, ChosenSpacing, TreeSettings, UNIT_BYTES, tree_report};
use super::origin::own_key;
use super::output::{DiskSize, OctreeOutput, OctreeWriter, Output, Target, Wants};
use super::staging::{OutputFile, StagedDataset};
use crate::cloud::Cloud;
use crate::error::{ConvertError, Unsupported};
use crate::job::{Build, KeptFile, decode};
use crate::octree::{self, AnySink, FinishedNode, NodeSink, Octree, OctreeSettings};
use crate::plan::Plan;
use crate::report::{self, OutputReport, PlannedChoice, SavedBytes};
use crate::runtime::Runtime;
use crate::sources::{ResolvedCrs, Schema};
use crate::warning::Warning;

/// Bytes of an entry of the hierarchy, one of the chunk table, and the head of a chunk.
const NODE_BYTES: u64 = 32 + 8 + 100;

/// Bytes of a LAS record without extra bytes, at most.
const LAS_BYTES: u64 = 38;

const WRITING: &str = "writing a node";

impl From<CopcSettings> for Target {
    fn from(settings: CopcSettings) -> Self {
        Self::new(settings)
    }
}

impl Output for CopcSettings {
    fn kind(&self) -> DatasetKind {
        DatasetKind::Copc
    }

    fn check(&self, _: &Plan) -> Result<(), ConvertError> {
        self.tree().check()
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
        DiskSize { per_point: LAS_BYTES + kept, per_1000_points: nodes * NODE_BYTES }
    }

    fn describe_settings(&self, settings: &mut Map<String, Value>) {
        self.tree().describe(settings);
    }

    fn choices(&self, _: &Plan) -> Vec<PlannedChoice> {
        self.tree().choices(Self::default().leaf_capacity)
    }

    fn foresee(&self, _: &Schema, _: &[usize], crs: &ResolvedCrs) -> Vec<Warning> {
        notes::foresee(crs)
    }

    fn keeps_lattice(&self) -> bool {
        true
    }

    fn saved_bytes(&self) -> SavedBytes {
        SavedBytes::Compressed
    }

    fn octree(&self) -> Option<&dyn OctreeOutput> {
        Some(self)
    }
}

impl OctreeOutput for CopcSettings {
    fn tree(&self) -> TreeSettings {
        let Self { sampling, spacing, leaf_capacity } = *self;
        TreeSettings { sampling, spacing, leaf_capacity, most_points: u32::MAX }
    }

    fn begin<'a>(
        &'a self,
        cloud: &'a Cloud<'a>,
        rt: &'a Runtime<'a>,
        spacing: ChosenSpacing,
        to: &'a StagedDataset,
    ) -> Result<Box<dyn OctreeWriter + 'a>, ConvertError> {
        let content = Content::choose(cloud)?;
        let mut heading = Heading::new(content.layout.point_format(), content.lattice).map_err(|e| failed(&e))?;
        heading.extra_bytes = content.layout.extra_bytes().to_vec();
        heading.wkt = cloud.facts.crs.wkt_text().map(Cow::into_owned);
        let chunks_start = heading.chunks_start().map_err(|e| failed(&e))?;
        let chunks = ChunkEncoder::new(&content.layout).map_err(|e| failed(&e))?;
        let name = self.kind().marker_file();
        let file = to.past_cache(name, to.create_kept(name)?);
        let encoding = Encoding { content, chunks, counted: Mutex::default(), events: rt.events() };
        Ok(Box::new(Writer {
            settings: self,
            cloud,
            spacing,
            heading,
            chunks_start,
            file,
            turn: Mutex::default(),
            encoding,
        }))
    }
}

impl CopcSettings {
    /// What the file says of its making.
    fn making(&self, cloud: &Cloud<'_>, content: &Content, changes: &[Changes]) -> String {
        let mut own = own_key(cloud, &content.choice.dropped);
        own.remove("wkt"); // it has a record of its own
        let renamed = content.renamed(cloud.schema());
        if !renamed.is_empty() {
            let renamed = renamed.into_iter().map(|r| (r.stored_as, r.name.into()));
            own.insert("attributesRenamed".into(), renamed.collect::<Map<_, _>>().into());
        }
        own.insert("attributes".into(), content.written(cloud.schema(), changes).into());
        own.insert("sampling".into(), self.sampling.name().into());
        own.insert("leafCapacity".into(), self.leaf_capacity.into());
        Value::from(own).to_string()
    }
}

/// A file while its chunks are made.
struct Writer<'a> {
    settings: &'a CopcSettings,
    cloud: &'a Cloud<'a>,
    spacing: ChosenSpacing,
    heading: Heading,
    chunks_start: u64,
    file: OutputFile,
    /// Whose turn it is to write: threads that wait for the lock of a file in the kernel do not sleep.
    turn: Mutex<()>,
    encoding: Encoding<'a>,
}

impl NodeSink for Writer<'_> {
    type Encoder<'s>
        = ChunkMaker<'s>
    where
        Self: 's;

    fn encoder(&self) -> ChunkMaker<'_> {
        ChunkMaker::new(&self.encoding)
    }

    fn write(&self, _: &[FinishedNode], bytes: &[u8], offset: u64) -> Result<(), ConvertError> {
        let at = self.chunks_start + offset;
        let turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        self.file.file.write_at(bytes, at, WRITING)?;
        drop(turn);
        self.file.file.start_write_back(at, bytes.len());
        Ok(())
    }

    fn add_notes(&self, notes: &[u8]) -> Result<(), ConvertError> {
        let notes = decode(notes)?;
        self.encoding.counted.lock().unwrap_or_else(PoisonError::into_inner).merge(&notes);
        Ok(())
    }

    fn kept(&self) -> Option<KeptFile<'_>> {
        self.file.kept(self.chunks_start)
    }

    fn write_part(&self, node: &FinishedNode, bytes: &[u8], at: u64) -> Result<(), ConvertError> {
        self.write(&[], bytes, node.byte_offset + at)
    }
}

impl OctreeWriter for Writer<'_> {
    fn sink(&self) -> &dyn AnySink {
        self
    }

    fn build(&self, build: Build<'_>, settings: OctreeSettings) -> Result<Octree, ConvertError> {
        octree::build(build, settings, self)
    }

    fn finish(self: Box<Self>, tree: Octree) -> Result<OutputReport, ConvertError> {
        let Self {
            settings, cloud, spacing, mut heading, chunks_start, file: OutputFile { file, .. }, encoding, ..
        } = *self;
        let Encoding { content, chunks, counted, .. } = encoding;
        let Counted { tally, changes } = counted.into_inner().unwrap_or_else(PoisonError::into_inner);
        let summary = tally.summary(&content.lattice);
        heading.is_adjusted_time = summary.is_adjusted_time();
        heading.making = settings.making(cloud, &content, &changes);
        let table = chunks.table(&in_file(&tree)?).map_err(|e| failed(&e))?;
        let entry = |n: &FinishedNode| NodeEntry::new(n.key, n.points, chunks_start + n.byte_offset, n.byte_size);
        let mut nodes: Vec<NodeEntry> = tree.nodes.iter().map(entry).collect();
        let ending = heading.finish(info(cloud, &spacing), &summary, &mut nodes, &table).map_err(|e| failed(&e))?;
        file.write_at(&ending.tail, ending.tail_start, "writing the hierarchy")?;
        file.write_at(&ending.head, 0, "writing the header")?;
        file.set_len(ending.tail_start + ending.tail.len() as u64, "ending the file")?;
        file.sync("syncing the file")?;

        let (kind, schema) = (settings.kind(), cloud.schema());
        let each = content.choice.kept.iter().zip(&changes).filter_map(|(&i, changes)| {
            let attribute = &schema.attributes[i];
            changed(kind, attribute, attribute.ty, changes)
        });
        let (attributes_changed, changes): (_, Vec<_>) = each.unzip();
        let mut warnings = settings.foresee(schema, &content.choice.kept, &cloud.facts.crs);
        warnings.extend(notes::renamed(&content, schema));
        warnings.extend(changes);
        let errors = octrees::errors(cloud, content.anchor, content.lattice.offset);
        let mut details = Map::new();
        details.insert("spacing".into(), spacing.describe());
        details.insert("point_format".into(), content.layout.point_format().into());
        Ok(OutputReport {
            points: tree.ledger.points(),
            duplicates_dropped: tree.ledger.duplicates_dropped(),
            accuracy: report::accuracy(cloud, tree.ledger.points(), errors),
            attributes: cloud.names(content.choice.kept.iter().copied()),
            attributes_renamed: content.renamed(schema),
            attributes_dropped: content.choice.dropped,
            attributes_changed,
            warnings,
            bytes: ending.tail_start + ending.tail.len() as u64,
            checksum: tree.ledger.unaltered().to_string(),
            tree: tree_report(&tree),
            details,
            ..OutputReport::default()
        })
    }
}

/// Points and bytes of each chunk, in the order of the file.
fn in_file(tree: &Octree) -> Result<Vec<(u32, u32)>, ConvertError> {
    let mut nodes: Vec<&FinishedNode> = tree.nodes.iter().collect();
    nodes.sort_unstable_by_key(|node| node.byte_offset);
    let too_large = |node: &FinishedNode| -> ConvertError {
        let what = format!("node {} takes {} bytes", node.key, node.byte_size);
        Unsupported::Format { kind: DatasetKind::Copc, what }.into()
    };
    let bytes = |node: &FinishedNode| u32::try_from(node.byte_size).map_err(|_| too_large(node));
    nodes.into_iter().map(|node| Ok((node.points, bytes(node)?))).collect()
}

/// The cube and the spacing.
fn info(cloud: &Cloud<'_>, spacing: &ChosenSpacing) -> Info {
    let cube = &cloud.frame.cube;
    let (corner, half_size) = (cube.offset(&cloud.lattice.lattice), cube.side / 2.0);
    Info {
        center: corner.map(|c| c + half_size),
        half_size,
        spacing: spacing.root,
        root_page_offset: 0,
        root_page_size: 0,
        gps_time: [0.0; 2],
    }
}

fn failed(error: &WriteError) -> ConvertError {
    Unsupported::Format { kind: DatasetKind::Copc, what: error.to_string() }.into()
}
