//! Compressed sections: a second pass over the finished file (`docs/formats/batches.md`, §8).

use pointmill_format::batches::{BATCH_POINTS, Flags, Part, PointSection, SECTION_ALIGNMENT, Section};
use zstd::bulk::Compressor;

use super::finish::Finished;
use crate::error::ConvertError;
use crate::runtime::{DiskFile, Runtime};

/// Batches of a block: 640 KiB of words.
const BATCHES_PER_BLOCK: u64 = 16;

/// Blocks that a thread compresses before what all threads have made is written.
const BLOCKS_PER_THREAD: usize = 8;

/// Copies the finished file `raw` to `to`, its sections compressed, and corrects their places in header and description.
pub(super) fn compress(
    rt: &Runtime<'_>,
    raw: &DiskFile,
    to: &DiskFile,
    level: i32,
    finished: &mut Finished,
) -> Result<(), ConvertError> {
    let (layout, end) = (&finished.layout, &mut finished.end);
    let mut copy = Copy { rt, raw, to, level, at: pointmill_format::batches::HEADER_BYTES };
    let mut sections = end.header.sections;
    sections.batches = copy.plain(layout.records)?.offset;
    for PointSection { part, section, bytes_per_point, .. } in layout.sections() {
        let Section { offset, bytes } = copy.blocks(section, bytes_per_point)?;
        match part {
            Part::Hi10 => sections.hi10 = offset,
            Part::Mid10 => sections.mid10 = Some(offset),
            Part::Lo10 => sections.lo10 = Some(offset),
            Part::Colour => sections.colour = offset,
            Part::Attribute(i) => {
                if let Some(entry) = end.description.attributes.get_mut(i) {
                    (entry.offset, entry.bytes) = (offset, bytes);
                }
            }
        }
    }
    if let Some(bytes) = finished.averaging.originals_bytes() {
        let section = Section { offset: layout.originals, bytes };
        sections.originals = Some(copy.plain(section)?.offset);
    }
    let text = end.description.to_json();
    copy.align();
    copy.write(text.as_bytes(), copy.at)?;
    sections.description = copy.at;
    finished.bytes = copy.at + text.len() as u64;
    let flags = Flags(end.header.flags.0 | Flags::COMPRESSED);
    (end.header.flags, end.header.sections) = (flags, sections);
    end.header.description_bytes = text.len() as u64;
    copy.write(&end.header.encode(), 0)
}

/// The compressed file as far as it goes.
struct Copy<'a> {
    rt: &'a Runtime<'a>,
    raw: &'a DiskFile,
    to: &'a DiskFile,
    level: i32,
    at: u64,
}

impl Copy<'_> {
    fn align(&mut self) {
        self.at = self.at.next_multiple_of(SECTION_ALIGNMENT);
    }

    fn write(&self, bytes: &[u8], offset: u64) -> Result<(), ConvertError> {
        self.to.write_at(bytes, offset, "writing the batches")
    }

    fn read(&self, section: Section, bytes: &mut Vec<u8>) -> Result<(), ConvertError> {
        bytes.clear();
        bytes.resize(section.bytes as usize, 0);
        self.raw.read_at(bytes, section.offset, "reading the batches before compression")
    }

    /// Copies a section as it is.
    fn plain(&mut self, from: Section) -> Result<Section, ConvertError> {
        self.align();
        let (offset, mut bytes) = (self.at, Vec::new());
        for part in parts(from, 8 << 20) {
            self.read(part, &mut bytes)?;
            self.write(&bytes, self.at)?;
            self.at += part.bytes;
        }
        Ok(Section { offset, bytes: from.bytes })
    }

    /// Compresses a section with `size` bytes per point: block table, then one frame per block.
    fn blocks(&mut self, from: Section, size: u64) -> Result<Section, ConvertError> {
        self.align();
        let offset = self.at;
        let parts: Vec<Section> = parts(from, BATCHES_PER_BLOCK * u64::from(BATCH_POINTS) * size).collect();
        let mut table = [BATCHES_PER_BLOCK as u32, parts.len() as u32].map(u32::to_le_bytes).concat();
        self.at += table.len() as u64 + 8 * (parts.len() as u64 + 1);
        for some in parts.chunks(BLOCKS_PER_THREAD * self.rt.threads) {
            for frame in self.frames(some)? {
                table.extend((self.at - offset).to_le_bytes());
                self.write(&frame, self.at)?;
                self.at += frame.len() as u64;
            }
        }
        table.extend((self.at - offset).to_le_bytes());
        self.write(&table, offset)?;
        Ok(Section { offset, bytes: self.at - offset })
    }

    /// The frames of some blocks, in order.
    fn frames(&self, blocks: &[Section]) -> Result<Vec<Vec<u8>>, ConvertError> {
        /// One thread's memory.
        #[derive(Default)]
        struct Worker {
            compressor: Option<Compressor<'static>>,
            raw: Vec<u8>,
            frames: Vec<(usize, Vec<u8>)>,
        }
        let compress = |worker: &mut Worker, block: usize| {
            let failed = |e| ConvertError::Internal(format!("zstd: {e}"));
            self.read(blocks[block], &mut worker.raw)?;
            let compressor = match &mut worker.compressor {
                Some(compressor) => compressor,
                none => none.insert(Compressor::new(self.level).map_err(failed)?),
            };
            worker.frames.push((block, compressor.compress(&worker.raw).map_err(failed)?));
            Ok(())
        };
        let done = self.rt.in_parallel(blocks.len(), Worker::default, compress, |worker| worker.frames)?;
        let mut frames: Vec<_> = done.into_iter().flatten().collect();
        frames.sort_unstable_by_key(|(block, _)| *block);
        Ok(frames.into_iter().map(|(_, frame)| frame).collect())
    }
}

/// Consecutive parts of a section, `bytes` long but for the last.
fn parts(section: Section, bytes: u64) -> impl Iterator<Item = Section> {
    let part = move |start: u64| Section { offset: section.offset + start, bytes: bytes.min(section.bytes - start) };
    (0..section.bytes).step_by(bytes as usize).map(part)
}
