//! A file that is open: sections as slices.

#[cfg(feature = "zstd")]
use std::ops::Range;
use std::path::{Path, PathBuf};

use bytemuck::{AnyBitPattern, Pod, Zeroable};

use crate::bytes::ByteSource;
use crate::{Attribute, Element, ReadError};

use super::blocks::FileId;
use super::check::{Check, Places};
use super::{
    AlignedBytes, BATCH_POINTS, BATCHES_FILE, BatchRecord, BlockScratch, Decoder, Description, Flags, Header, Part,
    Precision, Section, rgb_of, swap_slot,
};
#[cfg(feature = "zstd")]
use super::{
    CompressedSection,
    blocks::{Blocks, table},
    compressed_section::broken_block,
};

/// The colour of a point before it was replaced by the mean of its cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Original {
    /// Storage index.
    pub index: u32,
    /// Colour word; its top byte is 0.
    pub colour: u32,
}

/// An open file of quantised batches: any bytes that are aligned to 8, a map (feature `mmap`:
/// `Batches::map`) or memory.
///
/// Places and lengths were checked when it was opened. Threads may share it.
///
/// ```
/// use pointmill_format::batches::{Batches, Precision, rgb_of};
///
/// # fn main() -> Result<(), pointmill_format::ReadError> {
/// let batches = Batches::open(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/batches/example.qbatch"))?;
/// let colours = batches.colour().unwrap_or(&[]); // a section as it is, for the GPU
/// assert_eq!(colours.len() as u64, batches.header().points);
/// let (position, rgb) = (batches.position(0, Precision::Ten), colours.first().map(|word| rgb_of(*word)));
/// println!("{position:?} {rgb:?}");
/// # Ok(())
/// # }
/// ```
#[derive(Debug)]
pub struct Batches<B> {
    id: FileId,
    bytes: B,
    path: PathBuf,
    header: Header,
    description: Description,
    places: Places,
}

impl Batches<AlignedBytes> {
    /// Reads the whole file `path`, or `points.qbatch` in the folder `path`, into memory.
    ///
    /// # Errors
    /// As [`Self::from_bytes`], and those of the operating system.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let path = file_at(path.as_ref());
        Self::from_bytes(AlignedBytes::read(&path)?, path)
    }

    /// Reads all of `points.qbatch` of a source into memory.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn from_source(source: impl ByteSource) -> Result<Self, ReadError> {
        let path = source.locate(BATCHES_FILE);
        let size = source.size(BATCHES_FILE).map_err(|e| ReadError::io(&path, "opening", e))?;
        let mut bytes = AlignedBytes::with_size(size, &path)?;
        source.read_at(BATCHES_FILE, 0, bytes.as_mut()).map_err(|e| ReadError::io(&path, "reading", e))?;
        Self::from_bytes(bytes, path)
    }
}

/// The file that `path` is, or that is in the folder.
pub(super) fn file_at(path: &Path) -> PathBuf {
    if path.is_dir() { path.join(BATCHES_FILE) } else { path.to_path_buf() }
}

impl<B: AsRef<[u8]>> Batches<B> {
    /// Opens the file whose bytes these are; `path` is for messages.
    ///
    /// Reads header, records, description and tables: time grows with the batches, not the points.
    ///
    /// # Errors
    /// What §11 of the format page lists; [`crate::ErrorKind::Unsupported`] on a big-endian host, or if the bytes are not
    /// aligned to 8 ([`AlignedBytes`] and maps are).
    pub fn from_bytes(bytes: B, path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let path = path.as_ref();
        if cfg!(target_endian = "big") {
            let what = "holds little-endian words, which this big-endian machine cannot use as they stand";
            return Err(ReadError::unsupported(path, what));
        }
        let slice = bytes.as_ref();
        let header = Header::parse(slice, path)?;
        if slice.as_ptr().align_offset(8) != 0 {
            let what = "the buffer does not begin at a multiple of 8 bytes";
            return Err(ReadError::unsupported(path, what).advise("copy it to AlignedBytes, or map the file"));
        }
        let check = Check { bytes: slice, header: &header, path };
        let description = check.description()?;
        let places = check.places(&description)?;
        check.records(cast(range(slice, places.records)))?;
        Ok(Self { id: FileId::new(), bytes, path: path.to_path_buf(), header, description, places })
    }

    /// The fields of the header.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The description of the cloud.
    pub fn description(&self) -> &Description {
        &self.description
    }

    /// The file, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Extra attributes, in the order of their sections.
    pub fn attributes(&self) -> impl ExactSizeIterator<Item = &Attribute> + Clone {
        self.places.attributes.iter().map(|(attribute, _)| attribute)
    }

    /// One record per slot.
    pub fn records(&self) -> &[BatchRecord] {
        cast(self.range(self.places.records))
    }

    /// Bits 29–20 of all points, in storage order. `None` if sections are compressed.
    pub fn hi10(&self) -> Option<&[u32]> {
        self.words(Part::Hi10)
    }

    /// Bits 19–10. `None` if the plane was omitted or sections are compressed.
    pub fn mid10(&self) -> Option<&[u32]> {
        self.words(Part::Mid10)
    }

    /// Bits 9–0. `None` if the plane was omitted or sections are compressed.
    pub fn lo10(&self) -> Option<&[u32]> {
        self.words(Part::Lo10)
    }

    /// Colour words. `None` if sections are compressed.
    pub fn colour(&self) -> Option<&[u32]> {
        self.words(Part::Colour)
    }

    /// The words of a section. `None` if it is absent or compressed, or its entries are not of 4 bytes.
    pub fn words(&self, part: Part) -> Option<&[u32]> {
        let (section, size) = self.place(part)?;
        (size == 4 && !self.is_compressed()).then(|| cast(self.range(section)))
    }

    /// The values of attribute `i`, N · elements of them. `None` if there is no such attribute, it is of another type, or
    /// compressed.
    pub fn attribute<T: Element>(&self, i: usize) -> Option<&[T]> {
        let (attribute, section) = self.places.attributes.get(i)?;
        (attribute.ty == T::TYPE && !self.is_compressed()).then(|| cast(self.range(*section)))
    }

    /// True if sections are blocks of zstd, which [`Self::batch`] decompresses.
    pub fn is_compressed(&self) -> bool {
        self.header.flags.has(Flags::COMPRESSED)
    }

    /// A section as it is in the file: raw values, or a block table and its blocks.
    ///
    /// # Errors
    /// [`crate::ErrorKind::Unsupported`] if it is absent.
    pub fn section_bytes(&self, part: Part) -> Result<&[u8], ReadError> {
        self.place(part).map(|(section, _)| self.range(section)).ok_or_else(|| self.absent(part))
    }

    /// The values of one slot, in storage order; `scratch` is used if the section is compressed.
    ///
    /// # Errors
    /// A section that is absent, a slot that is not there, a block that does not decompress;
    /// [`crate::ErrorKind::Unsupported`] for compressed sections without the feature `zstd`.
    pub fn batch<'a>(&'a self, part: Part, slot: u32, scratch: &'a mut BlockScratch) -> Result<&'a [u8], ReadError> {
        let (section, size) = self.place(part).ok_or_else(|| self.absent(part))?;
        let Some(record) = self.records().get(slot as usize) else {
            let what = format!("slot {slot} was requested, the file has {}", self.header.batches);
            return Err(ReadError::unsupported(&self.path, what));
        };
        let bytes = self.range(section);
        if !self.is_compressed() {
            // the record was checked: 10240 · slot and its points lie in the section
            let start = slot as usize * BATCH_POINTS as usize * size;
            return Ok(bytes.get(start..start + record.points as usize * size).unwrap_or(&[]));
        }
        #[cfg(feature = "zstd")]
        {
            let blocks = Blocks { table: bytes, file: self.id, part, size, points: self.header.points };
            let frame = |at: Range<u64>| Ok(bytes.get(at.start as usize..at.end as usize).unwrap_or(&[]));
            scratch
                .batch(blocks, slot, frame, |at, what| broken_block(&self.path, section, &self.name(part), at, &what))
        }
        #[cfg(not(feature = "zstd"))]
        {
            let _ = (scratch, self.id);
            let what = "has compressed sections, which this program cannot read";
            Err(ReadError::unsupported(&self.path, what).advise("build it with the feature zstd"))
        }
    }

    /// What is needed to read a compressed section by positions, without these bytes.
    ///
    /// # Errors
    /// [`crate::ErrorKind::Unsupported`] if the section is absent or the file is not compressed.
    #[cfg(feature = "zstd")]
    pub fn compressed_section(&self, part: Part) -> Result<CompressedSection, ReadError> {
        let found = self.place(part).filter(|_| self.is_compressed());
        let (section, size) = found.ok_or_else(|| self.absent(part))?;
        Ok(CompressedSection {
            table: table(self.range(section)).to_vec(),
            file: self.id,
            part,
            size,
            points: self.header.points,
            batches: self.header.batches,
            section,
            name: self.name(part),
            path: self.path.clone(),
        })
    }

    /// As [`Self::batch`], for sections with entries of 4 bytes.
    ///
    /// # Errors
    /// As [`Self::batch`].
    pub fn batch_words<'a>(
        &'a self,
        part: Part,
        slot: u32,
        scratch: &'a mut BlockScratch,
    ) -> Result<&'a [u32], ReadError> {
        self.batch(part, slot, scratch).map(cast)
    }

    /// The slot of Morton batch `i`, and the Morton batch in slot `i`.
    pub fn swap(&self, i: u32) -> u32 {
        if self.header.flags.has(Flags::SWAPPED) { swap_slot(i, self.header.batches) } else { i }
    }

    /// Colours before averaging, by ascending storage index; empty if there are none.
    pub fn originals(&self) -> &[Original] {
        self.originals_section().and_then(|bytes| bytes.get(8..)).map_or(&[], cast)
    }

    /// The colour of a point before averaging: from the originals, else as it stands. `None` for an index that is not
    /// there, or if sections are compressed.
    pub fn original_colour(&self, index: u32) -> Option<[u8; 3]> {
        let word = *self.colour()?.get(index as usize)?;
        let originals = self.originals();
        let found = originals.binary_search_by_key(&index, |o| o.index);
        Some(rgb_of(found.map_or(word, |i| originals[i].colour)))
    }

    /// World coordinates of the point with that storage index. `None` for an index that is not there, fewer planes in the
    /// file than the precision has, or compressed sections.
    pub fn position(&self, index: u32, precision: Precision) -> Option<[f64; 3]> {
        let word = |plane: Option<&[u32]>| plane?.get(index as usize).copied();
        let hi = word(self.hi10())?;
        let mid = if precision >= Precision::Twenty { word(self.mid10())? } else { 0 };
        let lo = if precision >= Precision::Thirty { word(self.lo10())? } else { 0 };
        let decoder = self.decoder(index / BATCH_POINTS, precision)?;
        Some(self.world(decoder.position_of_words(hi, mid, lo)))
    }

    /// What decodes the points of a slot, relative to the origin.
    pub fn decoder(&self, slot: u32, precision: Precision) -> Option<Decoder> {
        self.records().get(slot as usize).map(|r| r.decoder(precision))
    }

    /// World coordinates of a position relative to the origin.
    pub fn world(&self, relative: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|a| self.header.grid.origin[a] + relative[a])
    }

    pub(crate) fn originals_section(&self) -> Option<&[u8]> {
        self.places.originals.map(|section| self.range(section))
    }

    /// The section, and bytes per point.
    fn place(&self, part: Part) -> Option<(Section, usize)> {
        let p = &self.places;
        match part {
            Part::Hi10 => Some((p.hi10, 4)),
            Part::Mid10 => p.mid10.map(|s| (s, 4)),
            Part::Lo10 => p.lo10.map(|s| (s, 4)),
            Part::Colour => Some((p.colour, 4)),
            Part::Attribute(i) => p.attributes.get(i).map(|(a, s)| (*s, a.size())),
        }
    }

    fn name(&self, part: Part) -> String {
        match part {
            Part::Hi10 => "hi10".into(),
            Part::Mid10 => "mid10".into(),
            Part::Lo10 => "lo10".into(),
            Part::Colour => "colour".into(),
            Part::Attribute(i) => match self.places.attributes.get(i) {
                Some((a, _)) => format!("\"{}\"", a.name),
                None => format!("of attribute {i}"),
            },
        }
    }

    fn absent(&self, part: Part) -> ReadError {
        ReadError::unsupported(&self.path, format!("has no section {}", self.name(part)))
    }

    fn range(&self, section: Section) -> &[u8] {
        range(self.bytes.as_ref(), section)
    }
}

/// A section that was checked when the file was opened.
fn range(bytes: &[u8], section: Section) -> &[u8] {
    bytes.get(section.offset as usize..section.end() as usize).unwrap_or(&[])
}

/// Sections begin at multiples of 256 and hold whole entries: the cast succeeds. Bytes that move between two calls of
/// `AsRef` are the one case where it does not, and they get nothing.
fn cast<T: AnyBitPattern>(bytes: &[u8]) -> &[T] {
    bytemuck::try_cast_slice(bytes).unwrap_or(&[])
}
