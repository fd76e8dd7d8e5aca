//! Points in memory: what a column holds, its values, and batches of columns.

mod attribute;
mod batch;
mod changes;
mod column;
pub(crate) mod column_bytes;
mod element;
mod node_points;

pub use attribute::{Attribute, AttributeType};
pub use batch::{PointBatch, Positions};
pub use changes::Changes;
pub use column::Column;
pub use element::Element;
pub use node_points::NodePoints;
