//! What `cloud.js` says.

use serde_json::Value;

use crate::octree::OctreeInfo;
use crate::{Aabb, Attribute, NodeKey};

use super::path::node_path;
use super::{OCTREE_DIR, PointAttribute};

/// What the files of nodes are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum NodeFiles {
    /// `.bin`: records of [`Metadata::record_len`] bytes.
    Bin,
    /// `.las`: uncompressed LAS files.
    Las,
    /// `.laz`: LAZ files.
    Laz,
}

impl NodeFiles {
    /// Their extension, with the dot.
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Bin => ".bin",
            Self::Las => ".las",
            Self::Laz => ".laz",
        }
    }
}

/// The contents of `cloud.js`.
///
/// ```
/// use pointmill_format::potree1::{Field, Metadata, PointAttribute};
/// use pointmill_format::{Aabb, NodeKey};
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let fields = [Field::Position, Field::Rgba].map(PointAttribute::of_words);
/// let attributes = fields.into_iter().collect::<Option<_>>().ok_or("they have words")?;
/// let cube = Aabb { min: [0.0; 3], max: [16.384; 3] };
/// let mut metadata = Metadata::new(cube, 0.001, 0.128, attributes);
/// metadata.points = Some(1000);
/// assert_eq!(metadata.record_len(), 16);
/// assert_eq!(metadata.node_file("r012345".parse()?), "data/r/01234/r012345.bin");
/// // what is written is read back
/// assert_eq!(Metadata::from_json(metadata.to_json().as_bytes(), "copy")?, metadata);
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Metadata {
    /// The version is 1.`minor`: 4 to 8.
    pub minor: u32,
    /// The folder of the nodes, relative to that of `cloud.js`: parts separated by `/`, none of them `.` or `..`.
    pub octree_dir: String,
    /// A proj4 definition or nothing.
    pub projection: String,
    /// Points of all nodes together, if the file says it.
    pub points: Option<u64>,
    /// The root's box, a cube.
    pub cube: Aabb,
    /// The box of the points, if the file says it.
    pub tight_box: Option<Aabb>,
    /// What the files of nodes are.
    pub files: NodeFiles,
    /// In the order of the bytes; empty unless files are [`NodeFiles::Bin`].
    pub attributes: Vec<PointAttribute>,
    /// Spacing of the root, world units.
    pub spacing: f64,
    /// World units of a step of stored positions.
    pub scale: f64,
    /// Levels of a folder and of an index file, at least 1.
    pub step: u32,
    /// Nodes and their points, in files of version 1.5 and older.
    pub nodes: Option<Vec<(NodeKey, u64)>>,
    /// Top-level keys that the format does not know; ours is `pointmill`.
    pub extra: serde_json::Map<String, serde_json::Value>,
}

impl Metadata {
    /// The metadata of a cloud of version 1.7 without points, step 5, nodes in the folder `data`. Set the other fields.
    ///
    /// `cube`, `scale`, `spacing` of the root: world units. `attributes`: in the order of the bytes, the position first.
    #[must_use]
    pub fn new(cube: Aabb, scale: f64, spacing: f64, attributes: Vec<PointAttribute>) -> Self {
        Self {
            minor: 7,
            octree_dir: OCTREE_DIR.to_owned(),
            projection: String::new(),
            points: None,
            cube,
            tight_box: None,
            files: NodeFiles::Bin,
            attributes,
            spacing,
            scale,
            step: 5,
            nodes: None,
            extra: serde_json::Map::new(),
        }
    }

    /// Bytes of a point in a `.bin` file.
    pub fn record_len(&self) -> usize {
        self.attributes.iter().map(PointAttribute::size).sum()
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

    /// What is the same in all octrees. LAS files have their own attributes.
    pub(super) fn octree_info(&self) -> OctreeInfo {
        let attributes = self.attributes.iter().flat_map(PointAttribute::columns).map(|a| self.scaled(a)).collect();
        let mut info = OctreeInfo::new(format!("Potree 1.{}", self.minor), self.cube, self.spacing, attributes);
        info.points = self.points;
        info.projection.clone_from(&self.projection);
        info
    }

    /// The attribute with the scale and offset that the key `pointmill` gives it: the format has no other place for them.
    fn scaled(&self, mut attribute: Attribute) -> Attribute {
        let scaled = self.extra.get("pointmill").and_then(|own| own.get("attributeScales")?.get(&attribute.name));
        let numbers = |key| {
            let numbers = scaled?.get(key)?.as_array()?.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>()?;
            (numbers.len() == attribute.elements && numbers.iter().all(|n| n.is_finite())).then_some(numbers)
        };
        if let (Some(scale), Some(offset)) = (numbers("scale"), numbers("offset")) {
            (attribute.scale, attribute.offset) = (scale, offset);
        }
        attribute
    }

    /// The file with the points of a node, relative to the folder of `cloud.js`.
    #[must_use]
    pub fn node_file(&self, key: NodeKey) -> String {
        let extension = self.files.extension();
        if self.has_folders() { self.file(key, extension) } else { format!("{}/{key}{extension}", self.octree_dir) }
    }

    /// The index file of a node whose level is a multiple of [`Self::step`], relative to the folder of `cloud.js`.
    #[must_use]
    pub fn index_file(&self, key: NodeKey) -> String {
        self.file(key, ".hrc")
    }

    fn file(&self, key: NodeKey, extension: &str) -> String {
        format!("{}/{}{extension}", self.octree_dir, node_path(key, self.step))
    }

    /// False in version 1.4: all files are in one folder, and there is no index but [`Self::nodes`].
    pub const fn has_folders(&self) -> bool {
        self.minor >= 5
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_in_folders_from_version_1_5_on() {
        let mut metadata = Metadata::new(Aabb { min: [0.0; 3], max: [1.0; 3] }, 0.001, 0.01, Vec::new());
        metadata.step = 2;
        let key: NodeKey = "r123".parse().unwrap();
        assert_eq!(metadata.node_file(key), "data/r/12/r123.bin");
        assert_eq!(metadata.index_file(key.parent().unwrap()), "data/r/12/r12.hrc");
        assert_eq!(metadata.index_file(NodeKey::ROOT), "data/r/r.hrc");
        metadata.minor = 4;
        assert_eq!(metadata.node_file(key), "data/r123.bin");
        (metadata.minor, metadata.files) = (6, NodeFiles::Laz);
        assert_eq!(metadata.node_file(NodeKey::ROOT), "data/r/r.laz");
    }
}
