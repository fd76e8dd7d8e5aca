//! What `metadata.json` says.

use crate::names::named;
use crate::octree::OctreeInfo;
use crate::{Aabb, Attribute, Lattice, NodeKey};

/// How the payloads in `octree.bin` are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Encoding {
    /// `DEFAULT`: interleaved records of [`Metadata::record_len`] bytes.
    Default,
    /// `BROTLI`: one Brotli stream per node, planar, in Morton order, positions and colours as Morton codes.
    Brotli,
}

impl Encoding {
    /// Every encoding.
    pub const ALL: &[Self] = &[Self::Default, Self::Brotli];

    /// The word in the metadata.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Default => "DEFAULT",
            Self::Brotli => "BROTLI",
        }
    }
}

named!(Encoding, "encoding");

/// An attribute and what its values are like.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct AttributeStats {
    /// Name, type, scale and offset.
    pub attribute: Attribute,
    /// Smallest stored value of each element; of `position`: world coordinates. Empty if the file does not say.
    pub min: Vec<f64>,
    /// Largest stored value of each element; of `position`: world coordinates. Empty if the file does not say.
    pub max: Vec<f64>,
    /// Number of points for each of the 256 values of a one-byte attribute.
    pub histogram: Option<Vec<u64>>,
}

impl AttributeStats {
    /// An attribute of whose values nothing is known.
    #[must_use]
    pub const fn new(attribute: Attribute) -> Self {
        Self { attribute, min: Vec::new(), max: Vec::new(), histogram: None }
    }
}

/// The contents of `metadata.json`.
///
/// ```
/// use pointmill_format::{NodeKey, potree2::{Dataset, Metadata}};
///
/// # fn main() -> Result<(), pointmill_format::ReadError> {
/// let dataset = Dataset::open(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/potree2/default"))?;
/// let metadata = dataset.metadata();
/// assert_eq!(metadata.node_cube(NodeKey::ROOT), metadata.cube);
/// assert_eq!(metadata.spacing_at(1), metadata.spacing / 2.0);
/// for stats in &metadata.attributes {
///     println!("{}: {:?} to {:?}", stats.attribute.name, stats.min, stats.max);
/// }
/// // what is written is read back
/// assert_eq!(&Metadata::from_json(metadata.to_json().as_bytes(), "copy")?, metadata);
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Metadata {
    /// Name of the cloud.
    pub name: String,
    /// Free text.
    pub description: String,
    /// Points of all nodes together.
    pub points: u64,
    /// A proj4 definition or nothing.
    pub projection: String,
    /// Bytes of the chunk at the start of `hierarchy.bin`.
    pub first_chunk_size: u64,
    /// Levels per hierarchy chunk, in datasets whose chunks all have as many. Nobody needs it: the masks of the records
    /// say where a chunk ends.
    pub step_size: u32,
    /// The deepest level that has a node (root = 0); PotreeConverter 2 often writes less.
    pub depth: u32,
    /// `world = stored · scale + offset`.
    pub lattice: Lattice,
    /// Spacing of the root, world units.
    pub spacing: f64,
    /// The root's box, a cube.
    pub cube: Aabb,
    /// How payloads are stored.
    pub encoding: Encoding,
    /// In the order of the bytes, `position` among them.
    pub attributes: Vec<AttributeStats>,
    /// Top-level keys that the format does not know; ours is `pointmill`.
    pub extra: serde_json::Map<String, serde_json::Value>,
}

impl Metadata {
    /// The metadata of an unnamed cloud without points: encoding DEFAULT, `step_size` 4, which is what
    /// clients know from PotreeConverter. Set the other fields.
    ///
    /// `cube`, `spacing` of the root: world units. `attributes`: in the order of the bytes, `position` among them.
    #[must_use]
    pub fn new(lattice: Lattice, cube: Aabb, spacing: f64, attributes: Vec<AttributeStats>) -> Self {
        Self {
            name: String::new(),
            description: String::new(),
            points: 0,
            projection: String::new(),
            first_chunk_size: 0,
            step_size: 4,
            depth: 0,
            lattice,
            spacing,
            cube,
            encoding: Encoding::Default,
            attributes,
            extra: serde_json::Map::new(),
        }
    }

    /// Bytes per point in DEFAULT encoding.
    pub fn record_len(&self) -> usize {
        self.attributes.iter().map(|a| a.attribute.size()).sum()
    }

    /// Bytes per point in a decompressed BROTLI payload: 16 for `position`, 8 for `rgb`, else as in DEFAULT.
    pub fn planar_len(&self) -> usize {
        self.attributes.iter().map(|a| planar_size(&a.attribute)).sum()
    }

    /// The box of a node: the cube halved [`NodeKey::level`] times, as viewers do it.
    #[must_use]
    pub fn node_cube(&self, key: NodeKey) -> Aabb {
        self.cube.octant(key)
    }

    /// Spacing of the nodes of `level`, world units: halves with every level.
    #[must_use]
    pub fn spacing_at(&self, level: u8) -> f64 {
        self.spacing * (-f64::from(level)).exp2()
    }

    /// What is the same in all octrees.
    pub(super) fn octree_info(&self) -> OctreeInfo {
        let attributes = self.attributes.iter().map(|a| &a.attribute).filter(|a| a.name != "position");
        let mut info = OctreeInfo::new("Potree 2.0", self.cube, self.spacing, attributes.cloned().collect());
        info.points = Some(self.points);
        info.projection.clone_from(&self.projection);
        info
    }

    /// Where `position` stands in [`Self::attributes`]; always there if the metadata was parsed.
    pub fn position_index(&self) -> Option<usize> {
        self.index_of("position")
    }

    /// Where `rgb` stands in [`Self::attributes`].
    pub fn rgb_index(&self) -> Option<usize> {
        self.index_of("rgb")
    }

    fn index_of(&self, name: &str) -> Option<usize> {
        self.attributes.iter().position(|a| a.attribute.name == name)
    }
}

/// Bytes per point of one attribute in a decompressed BROTLI payload.
pub(super) fn planar_size(attribute: &Attribute) -> usize {
    match attribute.name.as_str() {
        "position" => 16,
        "rgb" => 8,
        _ => attribute.size(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit_cube() -> Metadata {
        let lattice = Lattice { scale: [1.0; 3], offset: [0.0; 3] };
        Metadata::new(lattice, Aabb { min: [0.0; 3], max: [16.0; 3] }, 8.0, Vec::new())
    }

    #[test]
    fn a_node_lies_in_the_octants_of_its_name() {
        let key = NodeKey::from_name("r41").unwrap(); // upper x, then upper z of that
        let cube = unit_cube().node_cube(key);
        assert_eq!(cube, Aabb { min: [8.0, 0.0, 4.0], max: [12.0, 4.0, 8.0] });
        assert_eq!(unit_cube().node_cube(NodeKey::ROOT), unit_cube().cube);
    }

    #[test]
    fn spacing_halves_with_every_level_down_to_the_deepest() {
        assert_eq!([0, 1, 4].map(|l| unit_cube().spacing_at(l)), [8.0, 4.0, 0.5]);
        assert_eq!(unit_cube().spacing_at(31), 8.0 / f64::from(1u32 << 31));
    }
}
