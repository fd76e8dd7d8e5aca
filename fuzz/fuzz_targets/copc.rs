//! COPC as an octree: a file in memory, whose pages and chunks are read.

#![no_main]

use pointmill_format::bytes::Memory;
use pointmill_format::copc::{Dataset, Entry, Info};
use pointmill_format::octree::{Octree, OctreeNodes};
use pointmill_format::{NodeKey, NodePoints, ReadError};
use pointmill_fuzz::check_error;

const FILE: &str = "fuzz.copc.laz";
/// Nodes that are looked at of one input.
const MAX_NODES: usize = 200;
/// A node of an input takes no more memory.
const MAX_NODE_BYTES: u64 = 16 << 20;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if let Some(record) = bytes.first_chunk() {
        assert_eq!(Entry::from_bytes(record).to_bytes(), *record, "an entry keeps its bytes");
    }
    if let Err(error) = read(bytes) {
        check_error(&error);
    }
});

fn read(bytes: &[u8]) -> Result<(), ReadError> {
    let mut dataset = Dataset::from_source(Memory::from([(FILE.to_owned(), bytes.to_vec())]), FILE)?;
    dataset.set_max_node_bytes(MAX_NODE_BYTES);
    let info = &dataset.copc_info().to_bytes()[..72];
    assert_eq!(info, &bytes[Info::OFFSET as usize..][..72]);
    let whole = dataset.read_hierarchy();
    let mut nodes = OctreeNodes::new(&dataset)?;
    let (mut stack, mut points) = (vec![NodeKey::ROOT], NodePoints::default());
    for _ in 0..MAX_NODES {
        let Some(key) = stack.pop() else { break };
        nodes.load(&dataset, key)?;
        stack.extend(nodes.children(key).map(|child| child.key));
        let Some(node) = nodes.get(key) else { panic!("{key} was announced and is not there") };
        match dataset.read_points(node, &mut points) {
            Ok(()) => {
                assert_eq!(points.len() as u64, dataset.count(node)?);
                assert!(points.len().checked_sub(1).is_none_or(|i| points.world(i).is_some()));
                assert!(points.names().eq(dataset.info().attributes.iter().map(|a| a.name.as_str())));
            }
            Err(error) => {
                check_error(&error);
                assert!(points.is_empty());
            }
        }
    }
    // a walk to the end finds what the whole hierarchy has
    match whole {
        Ok(whole) if stack.is_empty() => assert_eq!(whole.len(), nodes.len()),
        Ok(_) => {}
        Err(error) => check_error(&error),
    }
    Ok(())
}
