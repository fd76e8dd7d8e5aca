//! Potree 1.x datasets.

use std::path::Path;

use crate::octree::{Octree, OctreeNode};
use crate::potree1::{Dataset, Field, METADATA_FILE, Metadata, NodeFiles};
use crate::scan::DatasetNote;
use crate::{Aabb, Lattice, NodeKey, OpenOptions, ReadError, Scan, ScanWarning};

use super::columns::Columns;
use super::crs::crs_of;
use super::described::{Described, NodeMemory, advised, file_bytes};
use super::own_key::OwnKey;
use super::placing::held;
use super::{nodes, octree_nodes};

/// What the decompressor of LAZ files keeps.
const LAZ_BYTES: u64 = 8 << 20;

/// Opens the dataset at `path`, a folder or an archive.
pub(super) fn open(path: &Path, options: &OpenOptions) -> Result<Box<dyn Scan>, ReadError> {
    let dataset = Dataset::open(path).map_err(advised)?;
    let deepest = nodes::deepest(options, dataset.info());
    let mut nodes = nodes::list(&dataset, deepest, options).map_err(advised)?;
    nodes.sort_by_cached_key(|node| depth_first_rank(node.key));
    count(&dataset, &mut nodes, options).map_err(advised)?;
    let bytes = place(&dataset, &mut nodes);
    let depth = nodes.iter().map(|node| node.key.level).max().unwrap_or(0);
    let mut described = described(path, &dataset, depth);
    described.bytes += bytes;
    if !options.has_levels() {
        let found = nodes.iter().map(|node| node.points).sum();
        described.compare_count(dataset.metadata().points, found);
    }
    Ok(octree_nodes::scan(dataset, described, nodes))
}

/// Where a node stands if each is followed by its descendants: files of one folder are read one after the other.
fn depth_first_rank(key: NodeKey) -> (u128, u8) {
    let up = u32::from(NodeKey::MAX_LEVEL.saturating_sub(key.level));
    let [x, y, z] = [key.x, key.y, key.z].map(|cell| cell << up);
    (NodeKey { level: 0, x, y, z }.breadth_first_rank(), key.level)
}

/// True counts. Those of the index are believed where they add up to the total, or a million files would be looked at; a node
/// that has another is an error when it is read.
fn count(dataset: &Dataset, nodes: &mut [OctreeNode], options: &OpenOptions) -> Result<(), ReadError> {
    let declared = nodes.iter().try_fold(0u64, |sum, node| sum.checked_add(node.points));
    if !options.has_levels() && declared.is_some() && declared == dataset.metadata().points {
        return Ok(());
    }
    nodes.iter_mut().try_for_each(|node| {
        node.points = dataset.count(node.key)?;
        Ok(())
    })
}

/// Places in the files of all nodes, as if they were one behind the other. Their bytes.
fn place(dataset: &Dataset, nodes: &mut [OctreeNode]) -> u64 {
    let metadata = dataset.metadata();
    let size = |node: &OctreeNode| match metadata.files {
        NodeFiles::Bin => node.points.saturating_mul(metadata.record_len() as u64),
        _ => file_bytes(&dataset.locate(&metadata.node_file(node.key))),
    };
    nodes.iter_mut().fold(0, |at, node| {
        (node.byte_offset, node.byte_size) = (at, size(node));
        at.saturating_add(node.byte_size)
    })
}

fn described(path: &Path, dataset: &Dataset, depth: u8) -> Described {
    let metadata = dataset.metadata();
    let own = OwnKey::of(&metadata.extra);
    let mut warnings = Vec::new();
    let crs = crs_of(own.wkt(), &metadata.projection, &mut warnings);
    let bounds = metadata.tight_box.unwrap_or(metadata.cube);
    let stored = &dataset.info().attributes;
    let columns: u64 = stored.iter().map(|a| a.size() as u64).sum();
    let (is_bin, made) = (metadata.files == NodeFiles::Bin, made_colours(own, dataset));
    if uses_fourth_byte(dataset) {
        warnings.push(ScanWarning::Dataset(DatasetNote::AlphaIgnored));
    }
    Described {
        path: path.to_path_buf(),
        format: dataset.info().format.clone(),
        bounds: Some(bounds),
        lattice: if is_bin { lattice(metadata, own, &bounds, depth) } else { None },
        step: [metadata.scale; 3],
        columns: Columns::new(stored, &own.renamed(), |name| made && name == "rgb", is_bin).with_restored(own),
        crs,
        rgb_is_16_bit: false,
        bytes: file_bytes(&dataset.locate(METADATA_FILE)),
        warnings,
        memory: NodeMemory { per_point: 2 * (24 + columns), decompressor: if is_bin { 0 } else { LAZ_BYTES } },
    }
}

/// True if colours of the root have a fourth byte that is not 255, as all writers known have it. That the root cannot be read is
/// told when it is.
fn uses_fourth_byte(dataset: &Dataset) -> bool {
    let (mut at, mut root) = (0, Vec::new());
    for attribute in &dataset.metadata().attributes {
        if attribute.field == Field::Rgba {
            let is_read = dataset.read_payload(NodeKey::ROOT, &mut root).is_ok();
            let mut records = root.chunks_exact(dataset.metadata().record_len());
            return is_read && records.any(|record| record.get(at + 3).is_some_and(|alpha| *alpha != u8::MAX));
        }
        at += attribute.size();
    }
    false
}

/// Colours that the sources did not have say nothing; greys of an intensity do, unless it is there.
fn made_colours(own: OwnKey<'_>, dataset: &Dataset) -> bool {
    let has_intensity = dataset.info().attributes.iter().any(|a| a.name == "intensity");
    own.get("colours").is_some_and(|colours| colours.as_str() == Some("white") || has_intensity)
}

/// The lattice of the job that made the dataset; else its own, if the corners of all nodes are on it: stored integers count from
/// there.
fn lattice(metadata: &Metadata, own: OwnKey<'_>, bounds: &Aabb, depth: u8) -> Option<Lattice> {
    if let Some(job) = own.lattice() {
        return held(&job, bounds);
    }
    let steps = metadata.cube.extent().map(|side| side / metadata.scale);
    let is_whole = |steps: &f64| {
        let parts = 2f64.powi(i32::from(depth));
        let nearest = (steps / parts).round() * parts;
        nearest > 0.0 && (steps - nearest).abs() <= nearest * 4.0 * f64::EPSILON
    };
    let own = Lattice { scale: [metadata.scale; 3], offset: metadata.cube.min };
    held(&own, bounds).filter(|_| steps.iter().all(is_whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nodes_are_followed_by_their_descendants() {
        let mut names = ["r1", "r07", "r", "r0", "r10", "r071", "r00"].map(|n| NodeKey::from_name(n).unwrap());
        names.sort_by_key(|key| depth_first_rank(*key));
        assert_eq!(names.map(|key| key.to_string()), ["r", "r0", "r00", "r07", "r071", "r1", "r10"]);
    }

    #[test]
    fn integers_stay_where_the_corners_of_all_nodes_are_whole_steps() {
        let cube = |side: f64| Aabb { min: [1000.0; 3], max: [1000.0 + side; 3] };
        let of = |side, depth| {
            let metadata = Metadata::new(cube(side), 0.001, 0.1, Vec::new());
            lattice(&metadata, OwnKey::of(&metadata.extra), &metadata.cube, depth).map(|l| l.offset)
        };
        assert_eq!(of(16.384, 14), Some([1000.0; 3]));
        assert_eq!(of(16.384, 15), None);
        assert_eq!(of(16.385, 1), None);
        assert_eq!(of(16.385, 0), Some([1000.0; 3]));
    }
}
