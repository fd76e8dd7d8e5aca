//! Compressed sections of a file that is read by positions.

use std::ops::Range;
use std::path::{Path, PathBuf};

use crate::ReadError;

use super::blocks::{Blocks, FileId};
use super::header::CORRUPT;
use super::{AlignedBytes, BlockScratch, Part, Section};

/// Where the blocks of a compressed section are, for programs that read a file by positions: a map of a file that another program
/// cuts short ends the program that reads it.
///
/// ```
/// use pointmill_format::{ReadError, bytes::read_exact_at};
/// use pointmill_format::batches::{Batches, BlockScratch, Part};
///
/// # fn main() -> Result<(), ReadError> {
/// let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/batches/blocks.qbatch");
/// let colours = Batches::open(path)?.compressed_section(Part::Colour)?;
/// let file = std::fs::File::open(path).map_err(|e| ReadError::io(path, "opening", e))?;
/// let read = |at, bytes: &mut [u8]| read_exact_at(&file, bytes, at).map_err(|e| ReadError::io(path, "reading", e));
/// println!("{} bytes of colours", colours.batch(0, &mut BlockScratch::default(), read)?.len());
/// # Ok(())
/// # }
/// ```
#[derive(Debug, Clone)]
pub struct CompressedSection {
    pub(super) table: Vec<u8>,
    pub(super) file: FileId,
    pub(super) part: Part,
    /// Bytes per point.
    pub(super) size: usize,
    /// Points and batches of the file.
    pub(super) points: u64,
    pub(super) batches: u32,
    pub(super) section: Section,
    pub(super) name: String,
    pub(super) path: PathBuf,
}

impl CompressedSection {
    /// The values of one slot, in storage order, as [`super::Batches::batch`] gives them. `read` fills a buffer with the
    /// bytes of the file from a place on, and is called if `scratch` does not hold the block.
    ///
    /// # Errors
    /// That of `read`; a block that does not decompress; [`crate::ErrorKind::Unsupported`] for a slot that is not there.
    pub fn batch<'a>(
        &self,
        slot: u32,
        scratch: &'a mut BlockScratch,
        read: impl FnOnce(u64, &mut [u8]) -> Result<(), ReadError>,
    ) -> Result<&'a [u8], ReadError> {
        if slot >= self.batches {
            let what = format!("slot {slot} was requested, the file has {}", self.batches);
            return Err(ReadError::unsupported(&self.path, what));
        }
        let Self { file, part, size, points, section, .. } = *self;
        let blocks = Blocks { table: &self.table, file, part, size, points };
        let frame = |at: Range<u64>| {
            let mut bytes = AlignedBytes::with_size(at.end.saturating_sub(at.start), &self.path)?;
            read(section.offset.saturating_add(at.start), bytes.as_mut())?;
            Ok(bytes)
        };
        scratch.batch(blocks, slot, frame, |at, what| broken_block(&self.path, section, &self.name, at, &what))
    }
}

/// `what` is wrong at byte `at` of a section.
pub(super) fn broken_block(path: &Path, section: Section, name: &str, at: u64, what: &str) -> ReadError {
    ReadError::broken(path, section.offset.saturating_add(at), format!("section {name}: {what}")).advise(CORRUPT)
}
