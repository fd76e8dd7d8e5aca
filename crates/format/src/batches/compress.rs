//! Writes a file again with compressed sections (`docs/formats/batches.md`, §8).

use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

#[cfg(doc)]
use super::DEFAULT_BATCHES_PER_BLOCK;
use super::blocks::MAX_BATCHES_PER_BLOCK;
use super::{BATCH_POINTS, Batches, Description, Flags, HEADER_BYTES, Header, Part, Section, align};
use crate::{Attribute, ReadError, WriteError};

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
