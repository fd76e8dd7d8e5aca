//! What stands around the chunks of a COPC file.

mod header;
mod heading;
mod pages;
mod records;

pub use header::Summary;
pub use heading::{Ending, Heading};
pub use pages::{MAX_PAGE_ENTRIES, Pages, encode_pages};
