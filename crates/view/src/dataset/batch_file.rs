//! The sections of a file of batches, read batch by batch: a file that is cut while it is served is an error, where a map of it
//! would end the process. Compressed sections are read through a map all the same, after a look at the length of the file; one that
//! is cut in the moment between the two ends the process.

use std::fs::File;
use std::path::{Path, PathBuf};

use pointmill_format::batches::{
    AttributeEntry, BATCH_POINTS, BatchRecord, Batches, BlockScratch, ColourSource, Header, MappedFile, Part,
};
use pointmill_format::bytes::{open_file, read_exact_at};
use pointmill_format::{Attribute, ReadError};

/// A file that is open, with what is known of it without its points.
#[derive(Debug)]
pub(super) struct BatchFile {
    pub(super) header: Header,
    pub(super) records: Vec<BatchRecord>,
    pub(super) attributes: Vec<(Attribute, AttributeEntry)>,
    pub(super) name: String,
    pub(super) projection: String,
    pub(super) colour: ColourSource,
    file: File,
    path: PathBuf,
    /// Of a compressed file, whose blocks only the map decompresses.
    compressed: Option<Batches<MappedFile>>,
    /// Bytes of the file when it was opened.
    bytes: u64,
}

impl BatchFile {
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let batches = Batches::map(path)?;
        let file = open_file(batches.path()).map_err(|e| ReadError::io(path, "opening", e))?;
        let bytes = file.metadata().map_err(|e| ReadError::io(path, "asking for the size", e))?.len();
        let description = batches.description();
        Ok(Self {
            header: batches.header().clone(),
            records: batches.records().to_vec(),
            attributes: batches.attributes().cloned().zip(description.attributes.iter().cloned()).collect(),
            name: description.name.clone(),
            projection: description.projection.clone(),
            colour: description.colour,
            file,
            path: batches.path().to_path_buf(),
            compressed: batches.is_compressed().then_some(batches),
            bytes,
        })
    }

    /// The values of a slot that exists, in storage order; replaces the contents of `out`.
    pub(super) fn read(
        &self,
        part: Part,
        slot: u32,
        scratch: &mut BlockScratch,
        out: &mut Vec<u8>,
    ) -> Result<(), ReadError> {
        out.clear();
        if let Some(batches) = &self.compressed {
            self.check_length()?;
            out.extend_from_slice(batches.batch(part, slot, scratch)?);
            return Ok(());
        }
        let Some(((start, size), record)) = self.place(part).zip(self.records.get(slot as usize)) else {
            return Err(ReadError::unsupported(&self.path, "the file has no such section or batch"));
        };
        out.resize(record.points as usize * size, 0);
        let at = start + u64::from(slot) * u64::from(BATCH_POINTS) * size as u64;
        read_exact_at(&self.file, out, at).map_err(|error| match error.kind() {
            std::io::ErrorKind::UnexpectedEof => self.cut(),
            _ => ReadError::io(&self.path, "reading a batch", error),
        })
    }

    /// Where a section begins, and bytes per point.
    fn place(&self, part: Part) -> Option<(u64, usize)> {
        let sections = &self.header.sections;
        match part {
            Part::Hi10 => Some((sections.hi10, 4)),
            Part::Mid10 => Some((sections.mid10?, 4)),
            Part::Lo10 => Some((sections.lo10?, 4)),
            Part::Colour => Some((sections.colour, 4)),
            Part::Attribute(i) => self.attributes.get(i).map(|(attribute, entry)| (entry.offset, attribute.size())),
        }
    }

    fn check_length(&self) -> Result<(), ReadError> {
        let now = self.file.metadata().map_err(|e| ReadError::io(&self.path, "asking for the size", e))?.len();
        if now < self.bytes { Err(self.cut()) } else { Ok(()) }
    }

    fn cut(&self) -> ReadError {
        let what = format!("the file is shorter than the {} bytes it had when it was opened", self.bytes);
        ReadError::broken(&self.path, None, what).advise("copy or convert it again")
    }
}
