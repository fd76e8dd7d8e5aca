//! Boxes, affine maps, lattices, node addresses and Morton codes.

mod aabb;
mod affine;
mod axis_grid;
mod deviations;
mod lattice;
pub(crate) mod morton;
mod node_key;

pub use aabb::Aabb;
pub use affine::{Affine, AffineFault};
pub use axis_grid::AxisGrid;
pub use deviations::Deviations;
pub use lattice::Lattice;
pub use node_key::NodeKey;
