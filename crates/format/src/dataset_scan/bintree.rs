//! Binary trees.

use std::path::Path;

use crate::bintree::{Bintree, Header, INDEX_FILE, Layout, Node, NodeKind, PACKED_FILE};
use crate::bytes::Folder;
use crate::scan::DatasetNote;
use crate::{Aabb, Attribute, AttributeType, Lattice, NodePoints, OpenOptions, ReadError, Scan, ScanWarning};

use super::columns::{Becomes, Columns};
use super::crs::crs_of;
use super::described::{Described, NodeMemory, advised, file_bytes};
use super::node_scan::{NodeScan, Nodes};
use super::own_key::OwnKey;
use super::pieces::Place;
use super::placing::held;

/// Bytes of a node while the index is read, and of those that may be taken if nothing is said.
const NODE_BYTES: u64 = 100;
const MOST_BYTES: u64 = 1 << 30;

/// Bits of an offset in single precision.
const MANTISSA: i32 = 24;

/// The leaves of a tree, by index, each with its place among the bytes of all.
struct Leaves {
    tree: Bintree,
    leaves: Vec<(u32, u64)>,
}

impl Nodes for Leaves {
    type Scratch = ();

    fn len(&self) -> usize {
        self.leaves.len()
    }

    fn place(&self, node: usize) -> Place {
        let (index, byte_offset) = self.leaves[node];
        let points = self.tree.node(index).map_or(0, |leaf| leaf.count);
        Place { points, byte_offset, byte_size: points.saturating_mul(self.tree.header().record.stride() as u64) }
    }

    fn name(&self, node: usize) -> String {
        format!("leaf {}", self.leaves[node].0)
    }

    fn read(&self, node: usize, (): &mut (), out: &mut NodePoints) -> Result<(), ReadError> {
        self.tree.read_leaf(self.leaves[node].0, out)
    }
}

/// Opens the dataset in the folder `path`.
pub(super) fn open(path: &Path, options: &OpenOptions) -> Result<Box<dyn Scan>, ReadError> {
    let most = options.description_bytes.unwrap_or(MOST_BYTES) / NODE_BYTES;
    let source = Folder::with_marker(path, INDEX_FILE);
    let tree = Bintree::from_source_within(source, usize::try_from(most).unwrap_or(usize::MAX)).map_err(advised)?;
    let mut leaves: Vec<(u32, u64)> = tree.leaves().map(|leaf| (leaf, start(tree.node(leaf)))).collect();
    leaves.sort_by_key(|(index, start)| (*start, *index));
    if tree.header().layout == Layout::Files {
        let stride = tree.header().record.stride() as u64;
        leaves.iter_mut().fold(0u64, |at, (index, start)| {
            *start = at;
            at.saturating_add(tree.node(*index).map_or(0, |leaf| leaf.count.saturating_mul(stride)))
        });
    }
    let mut described = described(path, &tree);
    let found = leaves.iter().filter_map(|(leaf, _)| tree.node(*leaf)).map(|leaf| leaf.count).sum();
    described.compare_count(Some(tree.header().points), found);
    described.warnings.extend(inexact(&tree));
    Ok(Box::new(NodeScan::new(Leaves { tree, leaves }, described)))
}

fn start(node: Option<&Node>) -> u64 {
    match node.map(|node| node.kind) {
        Some(NodeKind::Leaf { start: Some(start), .. }) => start,
        _ => 0,
    }
}

fn described(path: &Path, tree: &Bintree) -> Described {
    let header = tree.header();
    let own = OwnKey::of_map(&header.pointmill);
    let mut warnings = Vec::new();
    let crs = crs_of(own.wkt(), &header.projection, &mut warnings);
    let bounds = tree.nodes().first().map_or(Aabb::EMPTY, |root| root.bounds);
    let bytes = match header.layout {
        Layout::Packed => file_bytes(&tree.locate(PACKED_FILE)),
        Layout::Files => header.points.saturating_mul(header.record.stride() as u64),
    };
    let columns = columns(header);
    let size: u64 = header.record.extras().iter().map(|extra| extra.attribute.size() as u64).sum();
    Described {
        path: path.to_path_buf(),
        format: format!("binary tree, {}", header.layout),
        bounds: Some(bounds),
        lattice: lattice(header, &bounds),
        step: header.lattice.scale,
        rgb_is_16_bit: columns.attributes().iter().any(|a| a.name == "rgb") && has(header, "rgb"),
        columns,
        crs,
        bytes: bytes.saturating_add(file_bytes(&tree.locate(INDEX_FILE))),
        warnings,
        memory: NodeMemory { per_point: 2 * (24 + 4 + size), decompressor: 0 },
    }
}

/// An empty tree may have any lattice.
fn lattice(header: &Header, bounds: &Aabb) -> Option<Lattice> {
    if bounds.is_empty() { Some(header.lattice) } else { held(&header.lattice, bounds) }
}

/// Colours for meshes stand for those of 16 bits where these are missing.
fn columns(header: &Header) -> Columns {
    let class = (Attribute::new("classification", AttributeType::UInt8, 1), 0, Becomes::Class);
    let has_rgb = has(header, "rgb");
    let extras = header.record.extras().iter().enumerate().filter_map(|(i, extra)| {
        let attribute = extra.attribute.clone();
        match (attribute.name.as_str(), attribute.ty, attribute.elements) {
            ("rgba", AttributeType::UInt8, 4) if has_rgb => None,
            ("rgba", AttributeType::UInt8, 4) => {
                Some((Attribute::new("rgb", AttributeType::UInt16, 3), i + 1, Becomes::FirstThree))
            }
            _ => Some((attribute, i + 1, Becomes::Same)),
        }
    });
    let own = OwnKey::of_map(&header.pointmill);
    Columns::list(std::iter::once(class).chain(extras)).with_restored(own)
}

fn has(header: &Header, name: &str) -> bool {
    header.record.extras().iter().any(|extra| extra.attribute.name == name)
}

/// Leaves so large that single precision may not give the integers back.
fn inexact(tree: &Bintree) -> Option<ScanWarning> {
    let scale = tree.header().lattice.scale;
    let leaves = tree.nodes().iter().filter(|node| node.is_leaf());
    let error = |leaf: &Node, axis: usize| {
        let half = leaf.bounds.extent()[axis] / 2.0;
        if half > 0.0 { 2f64.powi(half.log2().floor() as i32 - MANTISSA) } else { 0.0 }
    };
    let mut most = [0.0; 3];
    for leaf in leaves {
        (0..3).for_each(|axis| most[axis] = f64::max(most[axis], error(leaf, axis)));
    }
    let is_coarse = (0..3).any(|axis| most[axis] >= scale[axis] / 2.0);
    is_coarse.then_some(ScanWarning::Dataset(DatasetNote::Inexact { most }))
}
