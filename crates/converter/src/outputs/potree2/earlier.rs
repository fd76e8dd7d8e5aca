//! The dataset that scans are added to, as a tree that nodes are taken from.

use std::fs;

use pointmill_format::potree2::{Dataset, Encoding as StoredEncoding, Node, NodeRecord, NodeType, OCTREE_FILE};
use pointmill_format::{Aabb, Attribute, Lattice, NodePoints, with_column};
use serde_json::{Map, Value};

use super::layout::OutputLayout;
use super::settings::{DarkColours, Encoding, Potree2Settings};
use crate::cloud::Cloud;
use crate::error::ConvertError;
use crate::octree::{EarlierTree, FinishedNode};
use crate::outputs::octrees::ChosenSpacing;
use crate::outputs::output::Output;
use crate::plan::{Filter, OriginPoints, Plan, RgbDepth};
use crate::reason::BuiltAnew;
use crate::runtime::{DiskFile, Runtime};

/// A dataset whose nodes are those of a new one where no new point comes near them.
pub(super) struct EarlierDataset {
    dataset: Dataset,
    octree: DiskFile,
    unit_points: u64,
    encoding: Encoding,
    layout: OutputLayout,
}

impl EarlierDataset {
    /// The dataset that the plan adds to. `names`: of the attributes of the new one beside the position.
    pub(super) fn open(
        cloud: &Cloud<'_>,
        rt: &Runtime<'_>,
        settings: &Potree2Settings,
        spacing: &ChosenSpacing,
        layout: &OutputLayout,
        names: &[String],
    ) -> Result<Self, BuiltAnew> {
        let unit_points = unit_points(cloud.plan, settings).ok_or(BuiltAnew::OtherMaking)?;
        if !keeps_points(cloud.plan) {
            return Err(BuiltAnew::OtherMaking);
        }
        let dataset = Dataset::open(&cloud.plan.output).map_err(|_| BuiltAnew::Unreadable)?;
        let octree = rt.temp.read(&dataset.locate(OCTREE_FILE)).map_err(|_| BuiltAnew::Unreadable)?;
        let (metadata, cube) = (dataset.metadata(), &cloud.frame.cube);
        let lattice = Lattice { scale: cloud.lattice.lattice.scale, offset: cube.offset(&cloud.lattice.lattice) };
        let box_of_root = Aabb { min: lattice.offset, max: lattice.offset.map(|v| v + cube.side) };
        let same = |is_same: bool, why: BuiltAnew| if is_same { Ok(()) } else { Err(why) };
        same(metadata.lattice.scale == lattice.scale, BuiltAnew::Step)?;
        same(metadata.lattice == lattice && metadata.cube == box_of_root, BuiltAnew::Cube)?;
        same(metadata.spacing == spacing.root, BuiltAnew::Spacing)?;
        let is_stored = |(stored, (attribute, name)): (&Attribute, (&Attribute, &String))| {
            (&stored.name, stored.ty, stored.elements) == (name, attribute.ty, attribute.elements)
        };
        let mut stored = metadata.attributes.iter().map(|stats| &stats.attribute);
        let is_first = stored.next().is_some_and(|first| first.name == "position");
        let is_like_it = stored.len() == names.len() && stored.zip(layout.attributes.iter().zip(names)).all(is_stored);
        let gives_back = layout.gives_back_records() && settings.dark_colours == DarkColours::Keep;
        same(is_first && is_like_it && gives_back, BuiltAnew::Attributes)?;
        let is_encoded_alike = match settings.encoding {
            Encoding::Default => metadata.encoding == StoredEncoding::Default,
            Encoding::Brotli { .. } => metadata.encoding == StoredEncoding::Brotli,
        };
        same(is_encoded_alike, BuiltAnew::OtherMaking)?;
        Ok(Self { dataset, octree, unit_points, encoding: settings.encoding, layout: layout.clone() })
    }
}

/// True if all points of the dataset are read, as they are stored.
fn keeps_points(plan: &Plan) -> bool {
    let Filter { bounds, regions, classes, every, origin_points } = &plan.filter;
    let keeps_all = bounds.is_none() && regions.is_empty() && classes.is_none() && *every <= 1;
    let is_input = plan.inputs.contains(&plan.output);
    is_input && keeps_all && *origin_points == OriginPoints::Keep && plan.rgb_depth != RgbDepth::Eight
}

/// Maximum points of a subtree of the dataset that a plan adds to, if this version has made it with the same settings.
fn unit_points(plan: &Plan, settings: &Potree2Settings) -> Option<u64> {
    let report: Value = serde_json::from_slice(&fs::read(plan.output.join("report.json")).ok()?).ok()?;
    let mut now = Map::new();
    settings.describe_settings(&mut now);
    let was = report.get("options")?;
    let is_given = |name: &str| ["spacing", "seed", "brotli-quality"].contains(&name);
    let is_same = |(name, value): (&String, &Value)| was.get(name) == Some(value);
    let has_no_other = || was.as_object()?.keys().find(|name| is_given(name) && !now.contains_key(*name)).map(|_| ());
    let is_alike = now.iter().all(is_same) && has_no_other().is_none();
    let is_this_version = report.get("version")?.as_str()? == env!("CARGO_PKG_VERSION");
    let [output] = &report.get("outputs")?.as_array()?[..] else { return None };
    let unit_points = output.get("tree")?.get("unit_points")?.as_u64()?;
    (is_alike && is_this_version).then_some(unit_points)
}

impl EarlierTree for EarlierDataset {
    fn nodes(&self) -> Result<Vec<FinishedNode>, ConvertError> {
        let nodes = self.dataset.read_hierarchy()?;
        let node = |node: &Node| {
            let NodeRecord { points, byte_offset, byte_size, .. } = node.record;
            FinishedNode { key: node.key, points, byte_offset, byte_size }
        };
        Ok(nodes.iter().filter(|node| node.record.byte_size > 0).map(node).collect())
    }

    fn unit_points(&self) -> u64 {
        self.unit_points
    }

    fn read(&self, offset: u64, out: &mut [u8]) -> Result<(), ConvertError> {
        self.octree.read_at(out, offset, "reading nodes")
    }

    fn records(
        &self,
        node: &FinishedNode,
        bytes: &[u8],
        points: &mut NodePoints,
        out: &mut Vec<u8>,
    ) -> Result<(), ConvertError> {
        let (start, stride) = (out.len(), self.layout.stride);
        match self.encoding {
            Encoding::Default => out.extend_from_slice(bytes),
            Encoding::Brotli { .. } => {
                let FinishedNode { key, points: count, byte_offset, byte_size } = *node;
                let node_type = NodeType::Normal as u8; // as much as reading its points needs
                let record = NodeRecord { node_type, child_mask: 0, points: count, byte_offset, byte_size };
                self.dataset.read_points(&Node::new(key, record), points)?;
                out.resize(start + count as usize * stride, 0);
                interleave(points, &mut out[start..], stride);
            }
        }
        self.layout.unfinish(&mut out[start..]);
        Ok(())
    }
}

/// Puts columns into records.
fn interleave(points: &NodePoints, records: &mut [u8], stride: usize) {
    let mut put = |at: usize, bytes: &[u8], record: usize| {
        if let Some(to) = records.get_mut(record * stride + at..record * stride + at + bytes.len()) {
            to.copy_from_slice(bytes);
        }
    };
    for (axis, values) in points.quantized().into_iter().flatten().enumerate() {
        values.iter().enumerate().for_each(|(i, value)| put(4 * axis, &value.to_le_bytes(), i));
    }
    let mut at = crate::sources::POSITION_BYTES;
    for column in points.columns() {
        let elements = column.len().checked_div(points.len()).unwrap_or(0).max(1);
        let size = column.ty().size();
        with_column!(column, values => {
            for (i, point) in values.chunks_exact(elements).enumerate() {
                point.iter().enumerate().for_each(|(e, value)| put(at + e * size, &value.to_le_bytes(), i));
            }
        });
        at += elements * size;
    }
}
