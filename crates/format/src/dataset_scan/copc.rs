//! COPC files of which some levels are read; all of a file is read as the LAZ file that it is.

use std::path::Path;

use crate::copc::Dataset;
use crate::octree::Octree;
use crate::{OpenOptions, ReadError, Scan};

use super::columns::Columns;
use super::described::{Described, NodeMemory, advised};
use super::{nodes, octree_nodes};

/// What a decompressor keeps.
const LAZ_BYTES: u64 = 8 << 20;

/// Opens the file `path`.
pub(super) fn open(path: &Path, options: &OpenOptions) -> Result<Box<dyn Scan>, ReadError> {
    let dataset = Dataset::open(path).map_err(advised)?;
    let deepest = nodes::deepest(options, dataset.info());
    let mut nodes = nodes::list(&dataset, deepest, options).map_err(advised)?;
    nodes.sort_by_key(|node| (node.byte_offset, node.key.breadth_first_rank()));
    for pair in nodes.windows(2) {
        if let [before, after] = pair
            && before.byte_offset.saturating_add(before.byte_size) > after.byte_offset
        {
            let what = format!("the chunks of nodes {} and {} overlap", before.key, after.key);
            return Err(advised(ReadError::broken(path, after.byte_offset, what)));
        }
    }
    let described = described(path, &dataset);
    Ok(octree_nodes::scan(dataset, described, nodes))
}

fn described(path: &Path, dataset: &Dataset) -> Described {
    let columns: u64 = dataset.info().attributes.iter().map(|a| a.size() as u64).sum();
    Described {
        path: path.to_path_buf(),
        format: dataset.info().format.clone(),
        bounds: dataset.bounds_declared(),
        lattice: Some(dataset.lattice()),
        step: dataset.lattice().scale,
        columns: Columns::new(&dataset.info().attributes, &Default::default(), |_| false, false),
        crs: dataset.crs().clone(),
        rgb_is_16_bit: false,
        bytes: dataset.file_bytes(),
        warnings: dataset.warnings().to_vec(),
        memory: NodeMemory { per_point: 2 * (12 + columns), decompressor: LAZ_BYTES },
    }
}
