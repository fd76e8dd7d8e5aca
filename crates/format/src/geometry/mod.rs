//! Boxes, lattices, node addresses and Morton codes.

mod aabb;
mod deviations;
mod lattice;
pub(crate) mod morton;
mod node_key;

pub use aabb::Aabb;
pub use deviations::Deviations;
pub use lattice::Lattice;
pub use node_key::NodeKey;
