//! Potree 1.x datasets: `cloud.js`, an index in `.hrc` files, and a file of points for each node
//! (`docs/formats/potree1.md`).
//!
//! [`Dataset`] opens one from a folder or from any [`ByteSource`](crate::bytes::ByteSource). Renderers walk it as any
//! [`Octree`](crate::octree::Octree); [`Dataset::read_hierarchy`] reads the whole index.
//!
//! Nothing found in a file is trusted. What PotreeConverter 1 wrote is read, its wrong counts included: how many points a
//! node has is told by the size of its file.
//!
//! For writing there are [`Metadata::to_json`], [`encode_index`] and [`node_path`]; records of points are interleaved as
//! [`Metadata::attributes`] says.

mod dataset;
mod encode_index;
mod index;
mod las_points;
mod metadata;
mod metadata_json;
mod metadata_parse;
mod names;
mod node;
mod node_points;
mod normals;
mod octree;
mod path;
mod record;

pub use dataset::Dataset;
pub use encode_index::{IndexFile, NodeCount, encode_index};
pub use metadata::{Metadata, NodeFiles};
pub use names::{Field, PointAttribute};
pub use node::Node;
pub use path::{begins_index, node_path};
pub use record::IndexRecord;

/// The file of the metadata: JSON, despite its name.
pub const METADATA_FILE: &str = "cloud.js";

/// The folder of the nodes in what is written here.
pub const OCTREE_DIR: &str = "data";
