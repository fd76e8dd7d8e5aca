//! Potree 1.x datasets: `cloud.js`, an index in `.hrc` files, and a file of points for each node
//! (`docs/formats/potree1.md`).
//!
//! For writing there are [`Metadata::to_json`], [`encode_index`] and [`node_path`]; records of points are interleaved as
//! [`Metadata::attributes`] says.

mod encode_index;
mod metadata;
mod metadata_json;
mod metadata_parse;
mod names;
mod path;
mod record;

pub use encode_index::{IndexFile, NodeCount, encode_index};
pub use metadata::{Metadata, NodeFiles};
pub use names::{Field, PointAttribute};
pub use path::{begins_index, node_path};
pub use record::IndexRecord;

/// The file of the metadata: JSON, despite its name.
pub const METADATA_FILE: &str = "cloud.js";

/// The folder of the nodes in what is written here.
pub const OCTREE_DIR: &str = "data";
