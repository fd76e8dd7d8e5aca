//! Compressed sections: blocks of whole batches, each a zstd frame (`docs/formats/batches.md`, §8).

use std::sync::atomic::{AtomicU64, Ordering};

use super::{AlignedBytes, Part};

/// Most batches of a block: 10 MiB of words.
pub(super) const MAX_BATCHES_PER_BLOCK: u32 = 256;

/// One block, decompressed. Reuse one for sections that are read batch by batch: batches of the same block cost nothing.
/// It may serve several files.
#[derive(Debug, Clone, Default)]
#[cfg_attr(not(feature = "zstd"), allow(dead_code))] // the same type in all builds; without zstd nothing fills it
pub struct BlockScratch {
    /// What `bytes` holds: file, section and block.
    block: Option<(FileId, Part, u32)>,
    bytes: AlignedBytes,
}

/// An open file, told apart from all others that this process has opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FileId(u64);

impl FileId {
    pub(super) fn new() -> Self {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        Self(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}

/// The head of a section: batches a block, and the number of blocks, as far as the bytes go.
fn head(section: &[u8]) -> Option<(u32, u32)> {
    let (per_block, rest) = section.split_first_chunk()?;
    let (blocks, _) = rest.split_first_chunk()?;
    Some((u32::from_le_bytes(*per_block), u32::from_le_bytes(*blocks)))
}

/// The table of a section that was checked: all of it that is before the first block.
#[cfg(feature = "zstd")]
pub(super) fn table(section: &[u8]) -> &[u8] {
    let end = entry(section, 0).and_then(|end| usize::try_from(end).ok());
    end.and_then(|end| section.get(..end)).unwrap_or(&[])
}

/// Where entry `i` of the table says that block `i` begins.
fn entry(section: &[u8], i: u32) -> Option<u64> {
    let at = 8 + 8 * i as usize;
    section.get(at..)?.first_chunk().map(|b| u64::from_le_bytes(*b))
}

/// Checks the table at the start of `section` (all bytes up to the end of the file) and gives the section's length.
pub(super) fn check_table(section: &[u8], batches: u32) -> Result<u64, String> {
    let (per_block, blocks) = head(section).ok_or("lies outside the file")?;
    if !(1..=MAX_BATCHES_PER_BLOCK).contains(&per_block) {
        return Err(format!("has blocks of {per_block} batches; 1 to {MAX_BATCHES_PER_BLOCK} are allowed"));
    }
    if blocks != batches.div_ceil(per_block) {
        return Err(format!("has {blocks} blocks of {per_block} batches for {batches} batches"));
    }
    let mut before = 16 + 8 * u64::from(blocks);
    if entry(section, 0) != Some(before) {
        return Err(format!("has its first block not at {before}, right behind it"));
    }
    for i in 1..=blocks {
        let end = entry(section, i).ok_or("leaves the file")?;
        if end < before || end > section.len() as u64 {
            return Err(format!("has the end of block {} at {end}, outside {before} to {}", i - 1, section.len()));
        }
        before = end;
    }
    Ok(before)
}

#[cfg(feature = "zstd")]
pub(super) use zstd_blocks::Blocks;
#[cfg(feature = "zstd")]
pub use zstd_blocks::DEFAULT_BATCHES_PER_BLOCK;

#[cfg(feature = "zstd")]
mod zstd_blocks {
    use std::ops::Range;

    use super::super::{BATCH_POINTS, Part};
    use super::{BlockScratch, FileId, entry, head};

    /// Batches of a block unless another number is given: 640 KiB of words.
    pub const DEFAULT_BATCHES_PER_BLOCK: u32 = 16;

    /// No zstd frame gives more bytes than this per compressed byte: a block of 128 KiB takes 4 bytes at least
    /// (RFC 8878, section 3.1.1.2).
    const MAX_RATIO: u64 = 32_768;

    /// The largest block that is decompressed: 256 batches of 200 bytes a point.
    const MAX_BLOCK_BYTES: u64 = 512 << 20;

    /// The blocks of a section that was checked.
    #[derive(Debug, Clone, Copy)]
    pub(in super::super) struct Blocks<'a> {
        /// The section, or its table alone.
        pub(in super::super) table: &'a [u8],
        pub(in super::super) file: FileId,
        pub(in super::super) part: Part,
        /// Bytes per point.
        pub(in super::super) size: usize,
        /// Of the file.
        pub(in super::super) points: u64,
    }

    impl BlockScratch {
        /// The raw bytes of `slot`; `frame` gives the bytes of the section that it is asked for, unless its block is here.
        ///
        /// On failure: what `frame` says, or `broken` makes of where in the section it is and what.
        pub(in super::super) fn batch<F: AsRef<[u8]>, E>(
            &mut self,
            blocks: Blocks<'_>,
            slot: u32,
            frame: impl FnOnce(Range<u64>) -> Result<F, E>,
            broken: impl Fn(u64, String) -> E,
        ) -> Result<&[u8], E> {
            let Blocks { table, file, part, size, points } = blocks;
            let no_table = || broken(0, "has no block table".to_owned());
            let (per_block, _) = head(table).filter(|(k, _)| *k > 0).ok_or_else(no_table)?;
            let block = slot / per_block;
            if self.block != Some((file, part, block)) {
                self.block = None;
                let first = u64::from(block * per_block) * u64::from(BATCH_POINTS);
                let full = u64::from(per_block) * u64::from(BATCH_POINTS);
                let raw = points.saturating_sub(first).min(full) * size as u64;
                let (start, end) = entry(table, block).zip(entry(table, block + 1)).ok_or_else(no_table)?;
                let found = self.decompress(frame(start..end)?.as_ref(), raw);
                found.map_err(|what| broken(start, format!("block {block} {what}")))?;
                self.block = Some((file, part, block));
            }
            let batch = BATCH_POINTS as usize * size;
            let bytes = self.bytes.as_ref();
            let start = ((slot % per_block) as usize * batch).min(bytes.len());
            Ok(&bytes[start..(start + batch).min(bytes.len())])
        }

        /// On failure: what the block does.
        fn decompress(&mut self, frame: &[u8], raw: u64) -> Result<(), String> {
            let declared = zstd::zstd_safe::get_frame_content_size(frame).ok().flatten();
            if declared != Some(raw) {
                let declared = declared.map_or("nothing".to_owned(), |t| t.to_string());
                return Err(format!("is no zstd frame of {raw} bytes: its header declares {declared}"));
            }
            if raw > (frame.len() as u64).saturating_mul(MAX_RATIO) {
                return Err(format!("claims {raw} bytes, more than {} compressed bytes can hold", frame.len()));
            }
            if raw > MAX_BLOCK_BYTES {
                return Err(format!("has {raw} bytes, at most {MAX_BLOCK_BYTES} are decompressed at once"));
            }
            let fits = usize::try_from(raw).ok().filter(|len| self.bytes.try_resize(*len).is_ok());
            fits.ok_or_else(|| format!("has {raw} bytes, which do not fit memory"))?;
            match zstd::bulk::decompress_to_buffer(frame, self.bytes.as_mut()) {
                Ok(len) if len as u64 == raw => Ok(()),
                Ok(len) => Err(format!("decompresses to {len} bytes, not {raw}")),
                Err(e) => Err(format!("does not decompress: {e}")),
            }
        }
    }
}
