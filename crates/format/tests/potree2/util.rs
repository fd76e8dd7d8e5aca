//! What the tests share.

use std::path::PathBuf;

use pointmill_format::bytes::Memory;
use pointmill_format::potree2::{
    AttributeStats, Dataset, Encoding, HIERARCHY_FILE, METADATA_FILE, Metadata, NodeEntry, OCTREE_FILE,
    encode_hierarchy,
};
use pointmill_format::{Aabb, Attribute, AttributeType, Lattice, NodeKey, ReadError};
use pointmill_testkit::files::fixture;

/// The folder of the golden dataset in that encoding.
pub(crate) fn golden(encoding: &str) -> PathBuf {
    fixture("potree2").join(encoding)
}

/// A dataset's files in memory, to be changed.
pub(crate) fn load(folder: &std::path::Path) -> Memory {
    let [metadata, hierarchy, octree] =
        [METADATA_FILE, HIERARCHY_FILE, OCTREE_FILE].map(|f| std::fs::read(folder.join(f)).unwrap());
    memory(metadata, hierarchy, octree)
}

pub(crate) fn memory(metadata: Vec<u8>, hierarchy: Vec<u8>, octree: Vec<u8>) -> Memory {
    let files = [(METADATA_FILE, metadata), (HIERARCHY_FILE, hierarchy), (OCTREE_FILE, octree)];
    Memory::from(files.map(|(name, bytes)| (name.to_owned(), bytes)))
}

pub(crate) fn file_mut<'a>(files: &'a mut Memory, name: &str) -> &'a mut Vec<u8> {
    files.get_mut(name).unwrap()
}

/// `position`, `rgb` and one attribute of every other kind of size.
pub(crate) fn attributes() -> Vec<Attribute> {
    use AttributeType as T;
    vec![
        Attribute::new("position", T::Int32, 3),
        Attribute::new("rgb", T::UInt16, 3),
        Attribute::new("classification", T::UInt8, 1),
        Attribute::new("scan angle", T::Int16, 1),
        Attribute::new("gps-time", T::Float64, 1),
        Attribute::new("normal", T::Float32, 3),
        Attribute::new("id", T::UInt32, 1),
    ]
}

/// Metadata for files that a test makes: a cube of 2^31 units.
pub(crate) fn metadata(encoding: Encoding, first_chunk_size: u64, attributes: Vec<Attribute>) -> Metadata {
    let stats = |attribute: Attribute| {
        let mut stats = AttributeStats::new(attribute);
        stats.min = vec![0.0; stats.attribute.elements];
        stats.max = stats.min.clone();
        stats
    };
    let lattice = Lattice { scale: [0.001; 3], offset: [0.0; 3] };
    let cube = Aabb { min: [0.0; 3], max: [2_147_483.648; 3] };
    let mut metadata = Metadata::new(lattice, cube, 1.0, attributes.into_iter().map(stats).collect());
    metadata.name = "made".into();
    (metadata.first_chunk_size, metadata.encoding) = (first_chunk_size, encoding);
    metadata
}

/// A dataset of a root alone with that payload.
pub(crate) fn one_node(encoding: Encoding, attributes: Vec<Attribute>, points: u32, octree: Vec<u8>) -> Memory {
    let root = NodeEntry::new(NodeKey::ROOT, points, 0, octree.len() as u64);
    let hierarchy = encode_hierarchy(&mut [root], 4).bytes;
    memory(metadata(encoding, 22, attributes).to_json().into_bytes(), hierarchy, octree)
}

pub(crate) fn open(files: &Memory) -> Result<Dataset, ReadError> {
    Dataset::from_source(files.clone())
}
