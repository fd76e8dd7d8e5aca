//! What stands around the chunks of a COPC file.

mod heading;
mod pages;

pub use crate::scan::las::write::{Ending, Summary};
pub use heading::Heading;
pub use pages::{MAX_PAGE_ENTRIES, Pages, encode_pages};
