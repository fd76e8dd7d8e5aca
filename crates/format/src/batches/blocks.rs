//! Compressed sections: blocks of whole batches, each a zstd frame (`docs/formats/batches.md`, §8).

use super::{AlignedBytes, Part};

/// Most batches of a block: 10 MiB of words.
const MAX_BATCHES_PER_BLOCK: u32 = 256;

/// One block, decompressed. Reuse one for sections that are read batch by batch: batches of the same block cost nothing.
#[derive(Debug, Clone, Default)]
#[cfg_attr(not(feature = "zstd"), allow(dead_code))] // the same type in all builds; without zstd nothing fills it
pub struct BlockScratch {
    /// What `bytes` holds.
    block: Option<(Part, u32)>,
    bytes: AlignedBytes,
}

/// The head of a section: batches a block, and the number of blocks, as far as the bytes go.
fn head(section: &[u8]) -> Option<(u32, u32)> {
    let (per_block, rest) = section.split_first_chunk()?;
    let (blocks, _) = rest.split_first_chunk()?;
    Some((u32::from_le_bytes(*per_block), u32::from_le_bytes(*blocks)))
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
pub use zstd_blocks::{DEFAULT_BATCHES_PER_BLOCK, compress};

#[cfg(feature = "zstd")]
mod zstd_blocks {
    use std::io::{Seek, SeekFrom, Write};
    use std::path::Path;

    use super::super::{
        BATCH_POINTS, Batches, Description, Flags, HEADER_BYTES, Header, Part, Section, WriteError, align,
    };
    use super::{BlockScratch, MAX_BATCHES_PER_BLOCK, entry, head};
    use crate::{Attribute, ReadError};

    /// Batches of a block unless another number is asked for: 640 KiB of words.
    pub const DEFAULT_BATCHES_PER_BLOCK: u32 = 16;

    /// No zstd frame gives more bytes than this for each of its own: a block of 128 KiB takes 4 bytes at least
    /// (RFC 8878, section 3.1.1.2).
    const MAX_RATIO: u64 = 32_768;

    impl BlockScratch {
        /// The raw bytes of `slot`, out of a checked compressed `section` with `size` bytes a point.
        ///
        /// On failure: where in the section, and what.
        pub(in super::super) fn batch(
            &mut self,
            section: &[u8],
            part: Part,
            size: usize,
            slot: u32,
            points: u64,
        ) -> Result<&[u8], (u64, String)> {
            let (per_block, _) = head(section).filter(|(k, _)| *k > 0).ok_or((0, "has no block table".to_owned()))?;
            let block = slot / per_block;
            if self.block != Some((part, block)) {
                self.block = None;
                let first = u64::from(block * per_block) * u64::from(BATCH_POINTS);
                let full = u64::from(per_block) * u64::from(BATCH_POINTS);
                let raw = points.saturating_sub(first).min(full) * size as u64;
                self.decompress(section, block, raw)?;
                self.block = Some((part, block));
            }
            let batch = BATCH_POINTS as usize * size;
            let bytes = self.bytes.as_ref();
            let start = ((slot % per_block) as usize * batch).min(bytes.len());
            Ok(&bytes[start..(start + batch).min(bytes.len())])
        }

        fn decompress(&mut self, section: &[u8], block: u32, raw: u64) -> Result<(), (u64, String)> {
            let ends = entry(section, block).zip(entry(section, block + 1));
            let (start, end) = ends.ok_or((0, "has no block table".to_owned()))?;
            let broken = |what: String| (start, format!("block {block} {what}"));
            let frame = section.get(start as usize..end as usize).unwrap_or(&[]);
            let told = zstd::zstd_safe::get_frame_content_size(frame).ok().flatten();
            if told != Some(raw) {
                let told = told.map_or("nothing".to_owned(), |t| t.to_string());
                return Err(broken(format!("is no zstd frame of {raw} bytes: its header tells {told}")));
            }
            if raw > (frame.len() as u64).saturating_mul(MAX_RATIO) {
                return Err(broken(format!("claims {raw} bytes, more than {} compressed bytes can hold", frame.len())));
            }
            let fits = usize::try_from(raw).ok().filter(|len| self.bytes.try_resize(*len).is_ok());
            fits.ok_or_else(|| broken(format!("has {raw} bytes, which do not fit memory")))?;
            match zstd::bulk::decompress_to_buffer(frame, self.bytes.as_mut()) {
                Ok(len) if len as u64 == raw => Ok(()),
                Ok(len) => Err(broken(format!("decompresses to {len} bytes, not {raw}"))),
                Err(e) => Err(broken(format!("does not decompress: {e}"))),
            }
        }
    }

    /// Writes the cloud of `source` to `out` with compressed sections, from its position 0 on.
    ///
    /// `level`: of zstd, 1–22. `batches_per_block`: 1 … 256, [`DEFAULT_BATCHES_PER_BLOCK`]. One thread; memory of one block.
    /// Returns the header as it was written.
    ///
    /// # Errors
    /// [`WriteError::Input`] if `source` is compressed already or broken, or for a number of batches out of range; the disk.
    pub fn compress<B: AsRef<[u8]>>(
        source: &Batches<B>,
        out: &mut (impl Write + Seek),
        level: i32,
        batches_per_block: u32,
    ) -> Result<Header, WriteError> {
        if source.header().flags.has(Flags::COMPRESSED) {
            return Err(WriteError::input("the file is compressed already"));
        }
        if !(1..=MAX_BATCHES_PER_BLOCK).contains(&batches_per_block) {
            return Err(WriteError::input(format!("{batches_per_block} batches a block; 1 to 256 are allowed")));
        }
        let compressor = zstd::bulk::Compressor::new(level).map_err(|e| WriteError::Compress(e.to_string()))?;
        let mut file = Compressed { out, at: 0, compressor, batches_per_block, batches: source.header().batches };
        let mut header = source.header().clone();
        let mut description = source.description().clone();
        let sections = &mut header.sections;
        file.skip_to(HEADER_BYTES)?;
        sections.batches = file.raw(bytemuck::cast_slice(source.records()))?.offset;
        let attribute_sizes: Vec<usize> = source.attributes().map(Attribute::size).collect();
        for part in Part::in_file_order(attribute_sizes.len(), source.header().precision()) {
            let size = if let Part::Attribute(i) = part { attribute_sizes[i] } else { 4 };
            let section = file.blocks(raw(source, part)?, size)?;
            match part {
                Part::Hi10 => sections.hi10 = section.offset,
                Part::Mid10 => sections.mid10 = Some(section.offset),
                Part::Lo10 => sections.lo10 = Some(section.offset),
                Part::Colour => sections.colour = section.offset,
                Part::Attribute(i) => {
                    if let Some(entry) = description.attributes.get_mut(i) {
                        (entry.offset, entry.bytes) = (section.offset, section.bytes);
                    }
                }
            }
        }
        if let Some(bytes) = source.originals_section() {
            sections.originals = Some(file.raw(bytes)?.offset);
        }
        let text = description.to_json();
        let section = file.raw(text.as_bytes())?;
        (sections.description, header.description_bytes) = (section.offset, section.bytes);
        header.flags.0 |= Flags::COMPRESSED;
        file.out.seek(SeekFrom::Start(0))?;
        file.out.write_all(&header.encode())?;
        file.out.flush()?;
        debug_assert!(Description::from_json(text.as_bytes(), Path::new(""), 0).is_ok());
        Ok(header)
    }

    fn raw<B: AsRef<[u8]>>(source: &Batches<B>, part: Part) -> Result<&[u8], WriteError> {
        let no_such = |e: ReadError| WriteError::input(e.to_string());
        source.section_bytes(part).map_err(no_such)
    }

    struct Compressed<'a, W> {
        out: &'a mut W,
        at: u64,
        compressor: zstd::bulk::Compressor<'static>,
        batches_per_block: u32,
        batches: u32,
    }

    impl<W: Write + Seek> Compressed<'_, W> {
        fn put(&mut self, bytes: &[u8]) -> Result<(), WriteError> {
            self.out.write_all(bytes)?;
            self.at += bytes.len() as u64;
            Ok(())
        }

        fn skip_to(&mut self, offset: u64) -> Result<(), WriteError> {
            let gap = (offset - self.at) as usize;
            self.put(&[0; HEADER_BYTES as usize][..gap])
        }

        fn raw(&mut self, bytes: &[u8]) -> Result<Section, WriteError> {
            self.skip_to(align(self.at))?;
            let offset = self.at;
            self.put(bytes)?;
            Ok(Section { offset, bytes: bytes.len() as u64 })
        }

        /// The table first as zeros, then the frames, then the table again.
        fn blocks(&mut self, bytes: &[u8], size: usize) -> Result<Section, WriteError> {
            self.skip_to(align(self.at))?;
            let offset = self.at;
            let count = self.batches.div_ceil(self.batches_per_block);
            let mut table = [self.batches_per_block, count].map(u32::to_le_bytes).concat();
            let table_bytes = table.len() + 8 * (count as usize + 1);
            self.put(&vec![0; table_bytes])?;
            let block_bytes = self.batches_per_block as usize * BATCH_POINTS as usize * size;
            for block in bytes.chunks(block_bytes) {
                table.extend((self.at - offset).to_le_bytes());
                let frame = self.compressor.compress(block).map_err(|e| WriteError::Compress(e.to_string()))?;
                self.put(&frame)?;
            }
            table.extend((self.at - offset).to_le_bytes());
            self.out.seek(SeekFrom::Start(offset))?;
            self.out.write_all(&table)?;
            self.out.seek(SeekFrom::Start(self.at))?;
            Ok(Section { offset, bytes: self.at - offset })
        }
    }
}
