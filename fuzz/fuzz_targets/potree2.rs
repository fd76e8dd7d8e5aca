//! A dataset in memory: two lengths (u32, little-endian), then metadata.json, hierarchy.bin and octree.bin.
//!
//! Metadata that is not JSON is taken from a fixture, so that most inputs reach the hierarchy and the nodes.

#![no_main]

use pointmill_format::bytes::Memory;
use pointmill_format::potree2::{Dataset, HIERARCHY_FILE, Hierarchy, METADATA_FILE, Metadata, OCTREE_FILE};
use pointmill_format::{NodePoints, ReadError};
use pointmill_fuzz::check_error;

const METADATA: [&[u8]; 2] = [
    include_bytes!("../../fixtures/potree2/default/metadata.json"),
    include_bytes!("../../fixtures/potree2/brotli/metadata.json"),
];
/// Nodes that are decoded of one input.
const MAX_NODES: usize = 200;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((lengths, rest)) = bytes.split_first_chunk::<8>() else { return };
    let length = |at: usize| lengths[at..].first_chunk().map_or(0, |b| u32::from_le_bytes(*b)) as usize;
    let (metadata, rest) = rest.split_at(length(0).min(rest.len()));
    let (hierarchy, octree) = rest.split_at(length(4).min(rest.len()));
    if let Err(error) = read(metadata, hierarchy, octree) {
        check_error(&error);
    }
});

fn read(metadata: &[u8], hierarchy: &[u8], octree: &[u8]) -> Result<(), ReadError> {
    let parsed = Metadata::from_json(metadata, "metadata.json");
    if let Ok(parsed) = &parsed {
        let again = Metadata::from_json(parsed.to_json().as_bytes(), "again");
        assert!(again.is_ok(), "what is written can be read: {again:?}");
    }
    let metadata = match parsed {
        Ok(_) => metadata.to_vec(),
        // the last byte chooses, so that a seed of either encoding stays one
        Err(error) => {
            check_error(&error);
            METADATA[usize::from(metadata.last().is_some_and(|b| b & 1 == 1))].to_vec()
        }
    };
    let files = [(METADATA_FILE, metadata), (HIERARCHY_FILE, hierarchy.to_vec()), (OCTREE_FILE, octree.to_vec())];
    let mut dataset = Dataset::from_source(Memory::from(files.map(|(name, bytes)| (name.to_owned(), bytes))))?;
    dataset.set_max_node_bytes(16 << 20);
    let _ = dataset.locate(OCTREE_FILE);
    let _ = Hierarchy::new(&dataset);
    let nodes = dataset.read_hierarchy()?;
    let mut points = NodePoints::default();
    for node in nodes.iter().take(MAX_NODES) {
        match dataset.read_points(node, &mut points) {
            Ok(()) => {
                // PotreeConverter 2.0 declares points of nodes that it left empty
                let is_empty = node.record.byte_size == 0 && points.is_empty();
                assert!(is_empty || points.len() as u64 == u64::from(node.record.points));
                let last = points.len().checked_sub(1);
                assert!(last.is_none_or(|i| points.world(i).is_some()));
            }
            Err(error) => check_error(&error),
        }
    }
    Ok(())
}
