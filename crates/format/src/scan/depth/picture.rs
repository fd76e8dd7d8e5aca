//! PNG pictures of depths: what they are, how many pixels have a depth, and the depths.

use std::fs::File;
use std::io::{self, Read as _};
use std::ops::RangeInclusive;
use std::path::Path;

use png::{BitDepth, ColorType, Decoder, DecodingError, Reader};

use super::grid::Grid;
use super::reasons::png_reason;
use super::tracked::{Place, Tracked};
use crate::{Advice, ReadError};

/// The first bytes of each PNG file, and the name of its first chunk.
const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
const FIRST_CHUNK: &[u8] = b"IHDR";

/// Where the size of a PNG picture stands, and its bits.
pub(super) const SIZE_AT: u64 = 16;
const BITS_AT: u64 = 24;

/// Pixels of a picture that is read: its depths and its colours are held in memory.
pub(super) const MAX_PIXELS: u64 = 1 << 25;

/// Bytes that show what a picture is.
const FIRST_BYTES: u64 = 64;

/// The first bytes of a picture.
pub(super) fn first_bytes(path: &Path) -> Result<Vec<u8>, ReadError> {
    let io = |e| ReadError::io(path, "reading the picture", e);
    let mut first = Vec::new();
    File::open(path).map_err(io)?.take(FIRST_BYTES).read_to_end(&mut first).map_err(io)?;
    Ok(first)
}

/// True for the start of a PNG file that ends within its first chunk.
pub(super) fn is_cut(first_bytes: &[u8]) -> bool {
    let starts = first_bytes.starts_with(SIGNATURE) || !first_bytes.is_empty() && SIGNATURE.starts_with(first_bytes);
    starts && (first_bytes.len() as u64) < BITS_AT + 2
}

/// The error of such a file.
pub(super) fn cut(path: &Path, at: u64) -> ReadError {
    ReadError::broken(path, at, "the picture ends before its last pixel").advise(Advice::CutShort)
}

/// What the first chunk of a PNG file says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) size: [u32; 2],
    bits: u8,
    colour: u8,
}

impl Header {
    /// That of a file that starts with these bytes, if it is PNG.
    pub(super) fn of(first_bytes: &[u8]) -> Option<Self> {
        let chunk = first_bytes.strip_prefix(SIGNATURE)?.get(4..)?.strip_prefix(FIRST_CHUNK)?;
        let number = |at: usize| Some(u32::from_be_bytes(*chunk.get(at..)?.first_chunk()?));
        Some(Self { size: [number(0)?, number(4)?], bits: *chunk.get(8)?, colour: *chunk.get(9)? })
    }

    /// True for 16 bits of grey.
    pub(super) const fn is_depth(self) -> bool {
        self.bits == 16 && self.colour == ColorType::Grayscale as u8
    }

    /// "8-bit colour".
    pub(super) fn describe(self) -> String {
        let colour = match ColorType::from_u8(self.colour) {
            Some(ColorType::Grayscale) => "grey",
            Some(ColorType::GrayscaleAlpha) => "grey and alpha",
            Some(ColorType::Rgb) => "colour",
            Some(ColorType::Rgba) => "colour and alpha",
            Some(ColorType::Indexed) => "palette",
            None => "unknown",
        };
        format!("{}-bit {colour}", self.bits)
    }
}

/// Refuses a size that no memory is meant for.
pub(super) fn check_size(path: &Path, [width, height]: [u32; 2]) -> Result<(), ReadError> {
    let pixels = u64::from(width) * u64::from(height);
    if !(1..=MAX_PIXELS).contains(&pixels) {
        let what = format!("a picture of {width} × {height} pixels; 1 to {MAX_PIXELS} are read");
        return Err(ReadError::broken(path, SIZE_AT, what).advise(Advice::Damaged));
    }
    Ok(())
}

/// A PNG file, opened behind its header.
pub(super) fn open_png(path: &Path, transform: png::Transformations) -> Result<(Reader<Tracked>, Place), ReadError> {
    let (file, place) = Tracked::open(path)?;
    let mut decoder = Decoder::new(file);
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    decoder.set_transformations(transform);
    let reader = decoder.read_info().map_err(|e| refuse(path, &place, e))?;
    let (width, height) = reader.info().size();
    check_size(path, [width, height])?;
    Ok((reader, place))
}

/// What is wrong with a PNG file.
pub(super) fn refuse(path: &Path, place: &Place, error: DecodingError) -> ReadError {
    match error {
        DecodingError::IoError(e) if e.kind() != io::ErrorKind::UnexpectedEof => {
            ReadError::io(path, "reading the picture", e)
        }
        DecodingError::IoError(_) => cut(path, place.get()),
        other => {
            let what = format!("the picture cannot be decoded: {}", png_reason(&other));
            ReadError::broken(path, place.get(), what).advise(Advice::Damaged)
        }
    }
}

/// A depth picture that is open.
pub(super) struct DepthPicture<'a> {
    path: &'a Path,
    reader: Reader<Tracked>,
    place: Place,
    rule: &'a Rule,
}

/// Which stored values are depths.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rule {
    pub(super) units_per_metre: f64,
    pub(super) range: Option<RangeInclusive<f64>>,
}

impl Rule {
    /// The depth in metres; 0 if that is none.
    #[inline]
    fn depth(&self, stored: u16) -> f64 {
        let depth = f64::from(stored) / self.units_per_metre;
        if self.range.as_ref().is_none_or(|range| range.contains(&depth)) { depth } else { 0.0 }
    }
}

impl<'a> DepthPicture<'a> {
    /// Opens a picture of 16 bits of grey.
    pub(super) fn open(path: &'a Path, rule: &'a Rule) -> Result<Self, ReadError> {
        let (reader, place) = open_png(path, png::Transformations::IDENTITY)?;
        let (colour, bits) = (reader.info().color_type, reader.info().bit_depth);
        if (colour, bits) != (ColorType::Grayscale, BitDepth::Sixteen) {
            let header = Header { size: [0; 2], bits: bits as u8, colour: colour as u8 };
            return Err(not_depth(path, header));
        }
        Ok(Self { path, reader, place, rule })
    }

    pub(super) fn size(&self) -> [u32; 2] {
        let (width, height) = self.reader.info().size();
        [width, height]
    }

    /// Pixels that have a depth, counted row by row.
    pub(super) fn count(mut self) -> Result<u64, ReadError> {
        let mut count = 0;
        while let Some(row) = self.reader.next_row().map_err(|e| refuse(self.path, &self.place, e))? {
            count += samples(row.data()).filter(|stored| self.rule.depth(*stored) > 0.0).count() as u64;
        }
        self.end()?;
        Ok(count)
    }

    /// All depths. `memory` is for what the decoder gives, and is kept.
    pub(super) fn depths(mut self, memory: &mut Vec<u8>) -> Result<Grid, ReadError> {
        let [width, height] = self.size().map(|side| side as usize);
        let bytes = width * height * 2;
        if memory.len() < bytes {
            memory.reserve_exact(bytes - memory.len());
            memory.resize(bytes, 0);
        }
        let stored = &mut memory[..bytes];
        self.reader.next_frame(stored).map_err(|e| refuse(self.path, &self.place, e))?;
        let mut depths = Vec::with_capacity(width * height);
        depths.extend(samples(stored).map(|stored| self.rule.depth(stored)));
        self.end()?;
        Ok(Grid { width, height, depths })
    }

    /// What follows the pixels: a picture that was cut there is not whole.
    fn end(&mut self) -> Result<(), ReadError> {
        self.reader.finish().map_err(|e| refuse(self.path, &self.place, e))
    }
}

/// A picture of other bits.
pub(super) fn not_depth(path: &Path, header: Header) -> ReadError {
    let what = format!("a PNG picture of {}; a depth map has 16-bit grey", header.describe());
    ReadError::broken(path, BITS_AT, what).advise("export the depths with 16 bits")
}

fn samples(bytes: &[u8]) -> impl Iterator<Item = u16> {
    bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_chunk_says_what_a_picture_is() {
        let mut start =
            [SIGNATURE, &[0, 0, 0, 13], FIRST_CHUNK, &[0, 0, 2, 128, 0, 0, 1, 224, 16, 0, 0, 0, 0]].concat();
        let header = Header::of(&start).unwrap();
        assert_eq!((header.size, header.is_depth(), header.describe()), ([640, 480], true, "16-bit grey".to_owned()));
        (start[24], start[25]) = (8, 2);
        let header = Header::of(&start).unwrap();
        assert_eq!((header.is_depth(), header.describe()), (false, "8-bit colour".to_owned()));
        assert_eq!(Header::of(&start[..25]), None);
        assert_eq!(Header::of(b"LASF"), None);
    }
}
