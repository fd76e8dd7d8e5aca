//! Boxes, affine maps, lattices, node addresses, Morton codes, and what cameras and rays meet.

mod aabb;
mod affine;
mod axis_grid;
mod deviations;
mod frustum;
mod lattice;
pub(crate) mod morton;
mod node_key;
mod ray;
pub(crate) mod vectors;

pub use aabb::Aabb;
pub use affine::{Affine, AffineFault};
pub use axis_grid::AxisGrid;
pub use deviations::Deviations;
pub use frustum::Frustum;
pub use lattice::Lattice;
pub use node_key::NodeKey;
pub use ray::Ray;
