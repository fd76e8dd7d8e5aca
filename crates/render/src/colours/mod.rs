//! What colour a point has.

mod paint;
mod ramps;
mod values;

pub(crate) use paint::Paint;
pub(crate) use ramps::{level as of_level, overdraw};
