//! Boxes, lattices, node addresses and Morton codes.

mod aabb;
mod axis_grid;
mod lattice;
pub(crate) mod morton;
mod node_key;

pub use aabb::Aabb;
pub use axis_grid::AxisGrid;
pub use lattice::Lattice;
pub use node_key::NodeKey;
