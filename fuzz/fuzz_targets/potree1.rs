//! A dataset in memory: two lengths (u32, little-endian), then cloud.js, an index and the points of a node. All nodes that begin
//! an index have that index, and all nodes those points.
//!
//! Metadata that cannot be read is taken from a fixture, so that most inputs reach the index and the nodes.

#![no_main]

use std::io;
use std::path::PathBuf;

use pointmill_format::bytes::{ByteSource, Memory};
use pointmill_format::octree::{Octree, OctreeNodes};
use pointmill_format::potree1::{Dataset, METADATA_FILE, Metadata};
use pointmill_format::{NodeKey, NodePoints, ReadError};
use pointmill_fuzz::check_error;

const METADATA: [&[u8]; 3] = [
    include_bytes!("../../fixtures/potree1/words/cloud.js"),
    include_bytes!("../../fixtures/potree1/objects/cloud.js"),
    include_bytes!("../../fixtures/potree1/flat/cloud.js"),
];
/// Nodes that are looked at of one input: one index for all would have no end.
const MAX_NODES: usize = 200;

/// One file for each ending, whatever the folder.
struct ByEnding(Memory);

impl ByEnding {
    fn name(file: &str) -> &'static str {
        match file.rsplit('.').next() {
            Some("js") => "js",
            Some("hrc") => "hrc",
            _ => "bin",
        }
    }
}

impl ByteSource for ByEnding {
    fn read_at(&self, file: &str, offset: u64, buf: &mut [u8]) -> io::Result<()> {
        self.0.read_at(Self::name(file), offset, buf)
    }

    fn size(&self, file: &str) -> io::Result<u64> {
        assert!(!file.split('/').any(|part| part == ".." || part.is_empty()), "{file} leaves the folder");
        self.0.size(Self::name(file))
    }

    fn locate(&self, file: &str) -> PathBuf {
        PathBuf::from("fuzz").join(file)
    }
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((lengths, rest)) = bytes.split_first_chunk::<8>() else { return };
    let length = |at: usize| lengths[at..].first_chunk().map_or(0, |b| u32::from_le_bytes(*b)) as usize;
    let (metadata, rest) = rest.split_at(length(0).min(rest.len()));
    let (index, node) = rest.split_at(length(4).min(rest.len()));
    if let Err(error) = read(metadata, index, node) {
        check_error(&error);
    }
});

fn read(metadata: &[u8], index: &[u8], node: &[u8]) -> Result<(), ReadError> {
    let parsed = Metadata::from_json(metadata, METADATA_FILE);
    if let Ok(parsed) = &parsed {
        let again = Metadata::from_json(parsed.to_json().as_bytes(), "again");
        assert!(again.is_ok(), "what is written can be read: {again:?}");
    }
    let metadata = match parsed {
        Ok(_) => metadata.to_vec(),
        // the last byte chooses, so that a seed of any layout stays one
        Err(error) => {
            check_error(&error);
            METADATA[usize::from(metadata.last().copied().unwrap_or(0)) % METADATA.len()].to_vec()
        }
    };
    let files = [("js", metadata), ("hrc", index.to_vec()), ("bin", node.to_vec())];
    let source = ByEnding(Memory::from(files.map(|(name, bytes)| (name.to_owned(), bytes))));
    let mut dataset = Dataset::from_source(source)?;
    dataset.set_max_node_bytes(16 << 20);
    let mut nodes = OctreeNodes::new(&dataset)?;
    let (mut stack, mut points) = (vec![NodeKey::ROOT], NodePoints::default());
    for _ in 0..MAX_NODES {
        let Some(key) = stack.pop() else { break };
        nodes.load(&dataset, key)?;
        stack.extend(nodes.children(key).map(|child| child.key));
        match dataset.read_points(key, &mut points) {
            Ok(()) => {
                assert_eq!(points.len() as u64, dataset.count(key)?);
                assert!(points.len().checked_sub(1).is_none_or(|i| points.world(i).is_some()));
                assert!(points.names().eq(dataset.info().attributes.iter().map(|a| a.name.as_str())));
            }
            Err(error) => check_error(&error),
        }
    }
    Ok(())
}
