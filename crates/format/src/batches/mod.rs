//! Quantised batches: one `.qbatch` file that a renderer maps and hands to the GPU (`docs/formats/batches.md`).
//!
//! Points stand in Morton order in batches of 10,240, every second batch swapped with its mirror; positions are three
//! planes of 10 bits per axis inside the batch's box; colours carry a level of detail.
//!
//! ```
//! use pointmill_format::batches::{Batches, Precision};
//!
//! # fn main() -> Result<(), pointmill_format::ReadError> {
//! let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/batches/example.qbatch");
//! let batches = Batches::open(file)?; // `Batches::map` with the feature `mmap`
//! for record in batches.records() {
//!     println!("{} points from {}, box {:?} to {:?}", record.points, record.first_point, record.min, record.max);
//! }
//! if let (Some(hi10), Some(colour)) = (batches.hi10(), batches.colour()) {
//!     println!("{} words to upload", hi10.len() + colour.len());
//! }
//! for point in batches.points_in_morton_order(Precision::Thirty) {
//!     println!("{:?}", point?.world);
//! }
//! # Ok(())
//! # }
//! ```
//!
//! What renderers compute is here as plain functions, the same ones that the writer uses: [`swap_slot`], [`weight`],
//! [`BatchRecord::quantize`] and [`BatchRecord::decoder`], [`Precision::for_error`], [`keeps`].
//!
//! To write: [`write()`] does all of it for a cloud in memory, and is the reference for others. A writer that works in
//! parallel or out of core asks [`Layout`] where everything will lie, encodes batches with [`encode_batch`] in any
//! order on any thread, writes them at their places, and ends with [`Layout::finish`].
//!
//! Sections are handed out without copying, so the host has to be little-endian; others are refused when a file is opened.

mod aligned;
mod blocks;
mod check;
mod clod;
mod colour;
#[cfg(feature = "zstd")]
mod compress;
#[cfg(feature = "zstd")]
mod compressed_section;
mod describe;
mod encode;
mod grid;
mod header;
mod layout;
#[cfg(feature = "mmap")]
mod map;
mod order;
mod part;
mod points;
mod precision;
mod read;
mod record;
mod write;

pub use crate::geometry::morton::{morton21, morton32};
pub use aligned::AlignedBytes;
pub use blocks::BlockScratch;
#[cfg(feature = "zstd")]
pub use blocks::DEFAULT_BATCHES_PER_BLOCK;
pub use clod::{keeps, target_spacing, weight};
pub use colour::{ColourSum, colour_word, eight_bit, grey, lod_of, rgb_of};
#[cfg(feature = "zstd")]
pub use compress::compress;
#[cfg(feature = "zstd")]
pub use compressed_section::CompressedSection;
pub use describe::{AttributeEntry, ColourSource, Description, ErrorFigures, LatticeEntry, PlaneErrors};
pub use encode::{EncodedBatch, ErrorSums, encode_batch, le_bytes};
pub use grid::{Grid, LOD_LEVELS, f32_above, f32_below};
pub use header::{Flags, Header, Sections};
pub use layout::{Averaging, Finish, Layout, PointSection, Section};
#[cfg(feature = "mmap")]
pub use map::MappedFile;
pub use order::{batch_count, batch_points, swap_slot};
pub use part::Part;
pub use points::{BatchScratch, Point, PointsInMortonOrder};
pub use precision::{Precision, distance_to_box, focal_pixels, projected_diagonal};
pub use read::{Batches, Original};
pub use record::{BatchRecord, Decoder, planes, quantized};
pub use write::{Cloud, WriteOptions, Written, write};

/// The first eight bytes.
pub const MAGIC: [u8; 8] = *b"QBATCHES";

/// The version that is read and written.
pub const VERSION: u32 = 1;

/// Bytes of the header.
pub const HEADER_BYTES: u64 = 256;

/// Every section begins at a multiple of this many bytes: what GPUs ask of buffer offsets.
pub const SECTION_ALIGNMENT: u64 = 256;

/// Points of a batch; the last one may have fewer.
pub const BATCH_POINTS: u32 = 10_240;

/// Points of a file, at most: storage indices are u32.
pub const MAX_POINTS: u64 = u32::MAX as u64;

/// `offset` rounded up to where a section can begin; saturates.
pub(crate) const fn align(offset: u64) -> u64 {
    offset.saturating_add(SECTION_ALIGNMENT - 1) / SECTION_ALIGNMENT * SECTION_ALIGNMENT
}

/// The file in the folder of a dataset.
pub const BATCHES_FILE: &str = "points.qbatch";
