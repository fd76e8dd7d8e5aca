//! The sections of a file of batches, read batch by batch: a file that is cut while it is served is an error, where a map of it
//! would end the process. It is mapped while it is opened, to look at header, records, description and tables.

use std::fs::File;
use std::path::{Path, PathBuf};

use pointmill_format::batches::{
    AttributeEntry, BATCH_POINTS, BatchRecord, Batches, BlockScratch, ColourSource, CompressedSection, Header, Part,
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
    /// Sections of a compressed file.
    compressed: Option<Vec<(Part, CompressedSection)>>,
    /// Bytes of the file when it was opened.
    bytes: u64,
}

impl BatchFile {
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let batches = Batches::map(path)?;
        let file = open_file(batches.path()).map_err(|e| ReadError::io(path, "opening", e))?;
        let bytes = file.metadata().map_err(|e| ReadError::io(path, "asking for the size", e))?.len();
        let description = batches.description();
        let planes =
            [Part::Hi10, Part::Mid10, Part::Lo10].into_iter().take(batches.header().precision().planes() as usize);
        let attributes = (0..batches.attributes().len()).map(Part::Attribute);
        let parts = planes.chain([Part::Colour]).chain(attributes);
        let section = |part| Ok((part, batches.compressed_section(part)?));
        let compressed = batches.is_compressed().then(|| parts.map(section).collect::<Result<_, ReadError>>());
        Ok(Self {
            header: batches.header().clone(),
            records: batches.records().to_vec(),
            attributes: batches.attributes().cloned().zip(description.attributes.iter().cloned()).collect(),
            name: description.name.clone(),
            projection: description.projection.clone(),
            colour: description.colour,
            file,
            path: batches.path().to_path_buf(),
            compressed: compressed.transpose()?,
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
        if let Some(sections) = &self.compressed {
            let (_, section) = sections.iter().find(|(p, _)| *p == part).ok_or_else(|| self.absent())?;
            out.extend_from_slice(section.batch(slot, scratch, |at, bytes| self.read_at(at, bytes))?);
            return Ok(());
        }
        let Some(((start, size), record)) = self.place(part).zip(self.records.get(slot as usize)) else {
            return Err(self.absent());
        };
        out.resize(record.points as usize * size, 0);
        self.read_at(start + u64::from(slot) * u64::from(BATCH_POINTS) * size as u64, out)
    }

    fn read_at(&self, at: u64, out: &mut [u8]) -> Result<(), ReadError> {
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

    fn absent(&self) -> ReadError {
        ReadError::unsupported(&self.path, "the file has no such section or batch")
    }

    fn cut(&self) -> ReadError {
        let what = format!("the file is shorter than the {} bytes it had when it was opened", self.bytes);
        ReadError::broken(&self.path, None, what).advise("copy or convert it again")
    }
}
