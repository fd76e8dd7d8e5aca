//! The C interface of pointmill: engines and other languages open datasets, walk their nodes and decode points.
//!
//! `include/pointmill.h` documents every function; `docs/embedding.md` has a first example. The functions take references
//! and owned boxes where C has pointers: a null pointer is `None`, so that only texts and buffers with a length need
//! `unsafe` code (`border.rs`). Objects to write to are `MaybeUninit`.

#![cfg_attr(
    not(test),
    warn(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::unreachable, clippy::unwrap_in_result)
)]
#![allow(clippy::missing_safety_doc)] // what a caller promises is the same for all functions: the header says it

mod about;
mod axes;
mod border;
mod camera;
mod check;
mod colours;
mod dataset;
mod decode;
mod detail;
mod info;
mod nodes;
mod octree;
mod pick;
mod points;
mod sections;
mod select;
mod status;
#[cfg(test)]
mod test_help;

pub use axes::PmAxes;
pub use camera::PmCamera;
pub use check::{PmValidation, pm_validate};
pub use dataset::{PM_NO_NODE, PmDataset, pm_api_version, pm_close, pm_open, pm_version};
pub use detail::{pm_clod_keeps, pm_clod_levels, pm_clod_spacing, pm_clod_weight};
pub use info::{PmAttribute, PmBox, PmInfo, PmKind, PmType, pm_attribute, pm_format, pm_info, pm_projection};
pub use nodes::{
    PM_NODE_DRAWABLE, PM_NODE_LEAF, PM_NODE_PROXY, PmNode, pm_children, pm_distances, pm_load, pm_load_all, pm_node,
    pm_node_name, pm_nodes,
};
pub use pick::{PmHit, PmRay, pm_pick};
pub use points::{
    PM_MESH_VERTICES, PmPoints, pm_decode, pm_points_attribute, pm_points_colours, pm_points_count, pm_points_free,
    pm_points_new, pm_points_positions, pm_points_values, pm_points_world,
};
pub use sections::{PmBatchRecord, PmSection, pm_batch_section, pm_section};
pub use select::{PmDraw, PmMaterial, PmOrder, PmSelection, pm_material, pm_select, pm_switch_distance};
pub use status::{PM_API_VERSION, PmStatus, pm_last_error};
