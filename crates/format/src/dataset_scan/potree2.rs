//! Potree 2.0 datasets.

use std::path::Path;

use crate::octree::{Octree, OctreeNode};
use crate::potree2::{Dataset, Encoding, METADATA_FILE, Metadata, Node, OCTREE_FILE};
use crate::{Aabb, Lattice, OpenOptions, ReadError, Scan};

use super::columns::Columns;
use super::crs::crs_of;
use super::described::{Described, NodeMemory, advised, file_bytes};
use super::own_key::OwnKey;
use super::placing::with_offset;
use super::{nodes, octree_nodes};

/// What a decompressor keeps: the window, and its tables.
const BROTLI_BYTES: u64 = 8 << 20;

/// Opens the dataset in the folder `path`.
pub(super) fn open(path: &Path, options: &OpenOptions) -> Result<Box<dyn Scan>, ReadError> {
    let dataset = Dataset::open(path).map_err(advised)?;
    let deepest = nodes::deepest(options, dataset.info());
    let mut nodes = nodes::list(&dataset, deepest, options).map_err(advised)?;
    // nodes without a payload have no points, whatever they claim
    nodes.retain(|node| node.byte_size > 0);
    nodes.sort_by_key(|node| (node.byte_offset, node.key.breadth_first_rank()));
    check(&dataset, &nodes).map_err(advised)?;
    let mut described = described(path, &dataset);
    if !options.has_levels() {
        let found = nodes.iter().map(|node| node.points).sum();
        described.compare_count(Some(dataset.metadata().points), found);
    }
    Ok(octree_nodes::scan(dataset, described, nodes))
}

/// No byte is the payload of two nodes: or a small file could be a scan without an end. Payloads are in the file, and records
/// fill theirs.
fn check(dataset: &Dataset, nodes: &[OctreeNode]) -> Result<(), ReadError> {
    let broken =
        |node: &OctreeNode, what: String| Err(ReadError::broken(dataset.locate(OCTREE_FILE), node.byte_offset, what));
    for pair in nodes.windows(2) {
        if let [before, after] = pair
            && before.byte_offset.saturating_add(before.byte_size) > after.byte_offset
        {
            return broken(after, format!("the payloads of nodes {} and {} overlap", before.key, after.key));
        }
    }
    let (metadata, bytes) = (dataset.metadata(), dataset.octree_bytes());
    let point_bytes = match metadata.encoding {
        Encoding::Default => Some(metadata.record_len() as u128),
        Encoding::Brotli => None,
    };
    for node in nodes {
        let needed = node.byte_offset.checked_add(node.byte_size);
        if needed.is_none_or(|end| end > bytes) {
            return broken(node, format!("node {} ends outside of the file, which has {bytes} bytes", node.key));
        }
        if let Some(one) = point_bytes.filter(|one| one * u128::from(node.points) != u128::from(node.byte_size)) {
            let what = format!("node {} has {} bytes for {} points of {one}", node.key, node.byte_size, node.points);
            return broken(node, what);
        }
        // or memory would be asked for what is not there
        let node = Node::from(node);
        if dataset.is_doubtful(&node) {
            dataset.check_payload(&node)?;
        }
    }
    Ok(())
}

fn described(path: &Path, dataset: &Dataset) -> Described {
    let metadata = dataset.metadata();
    let own = OwnKey::of(&metadata.extra);
    let mut warnings = Vec::new();
    let crs = crs_of(own.wkt(), &metadata.projection, &mut warnings);
    let bounds = bounds(metadata);
    let columns: u64 = dataset.info().attributes.iter().map(|a| a.size() as u64).sum();
    let (unpacked, decompressor) = match metadata.encoding {
        Encoding::Default => (0, 0),
        Encoding::Brotli => (metadata.planar_len() as u64, BROTLI_BYTES),
    };
    Described {
        path: path.to_path_buf(),
        format: format!("{}, {}", dataset.info().format, metadata.encoding),
        bounds: Some(bounds),
        lattice: Some(lattice(metadata, own, &bounds)),
        step: metadata.lattice.scale,
        columns: Columns::new(&dataset.info().attributes, &own.renamed(), |_| false, false).with_restored(own),
        crs,
        // colours of 8 bits were stored as 16 then
        rgb_is_16_bit: own.is_there() && metadata.rgb_index().is_some(),
        bytes: dataset.hierarchy_bytes() + dataset.octree_bytes() + file_bytes(&dataset.locate(METADATA_FILE)),
        warnings,
        memory: NodeMemory { per_point: unpacked + 2 * (12 + columns), decompressor },
    }
}

/// The lattice of the job that made the dataset, so that integers and corners are those of its scans; else its own.
fn lattice(metadata: &Metadata, own: OwnKey<'_>, bounds: &Aabb) -> Lattice {
    let job = own.vector("latticeOffset").and_then(|offset| with_offset(&metadata.lattice, offset, bounds));
    job.unwrap_or(metadata.lattice)
}

/// Where the points are, by the range of the positions, else the cube.
fn bounds(metadata: &Metadata) -> Aabb {
    let stats = metadata.position_index().and_then(|i| metadata.attributes.get(i));
    let corner = |values: &[f64]| <[f64; 3]>::try_from(values).ok();
    let found = stats.and_then(|stats| Some(Aabb { min: corner(&stats.min)?, max: corner(&stats.max)? }));
    found.filter(|found| !found.is_empty()).unwrap_or(metadata.cube)
}
