//! Points in memory: what a column holds, its values, and batches of columns.

mod attribute;
mod batch;
mod column;

pub use attribute::{Attribute, AttributeType};
pub use batch::{PointBatch, Positions};
pub use column::Column;
