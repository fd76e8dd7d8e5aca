//! PNG pictures of depths: what they are, how many pixels have a depth, and the depths.

use std::fs::File;
use std::io::{self, BufReader};
use std::ops::RangeInclusive;
use std::path::Path;

use png::{BitDepth, ColorType, Decoder, DecodingError, Reader};

use super::grid::Grid;
use crate::{Advice, ReadError};

/// The first bytes of each PNG file, and the name of its first chunk.
const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
const FIRST_CHUNK: &[u8] = b"IHDR";

/// Pixels of a picture that is read: its depths and its colours are held in memory.
pub(super) const MAX_PIXELS: u64 = 1 << 25;

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
        return Err(ReadError::broken(path, None, what).advise(Advice::Damaged));
    }
    Ok(())
}

/// A PNG file, opened behind its header.
pub(super) fn open_png(path: &Path, transform: png::Transformations) -> Result<Reader<BufReader<File>>, ReadError> {
    let file = File::open(path).map_err(|e| ReadError::io(path, "opening the picture", e))?;
    let mut decoder = Decoder::new(BufReader::new(file));
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    decoder.set_transformations(transform);
    let reader = decoder.read_info().map_err(|e| refuse(path, e))?;
    let (width, height) = reader.info().size();
    check_size(path, [width, height])?;
    Ok(reader)
}

/// What is wrong with a PNG file.
pub(super) fn refuse(path: &Path, error: DecodingError) -> ReadError {
    match error {
        DecodingError::IoError(e) if e.kind() != io::ErrorKind::UnexpectedEof => {
            ReadError::io(path, "reading the picture", e)
        }
        DecodingError::IoError(_) => {
            ReadError::broken(path, None, "the picture ends before its last pixel").advise(Advice::CutShort)
        }
        other => ReadError::broken(path, None, format!("the picture cannot be decoded: {other}"))
            .advise(Advice::Damaged),
    }
}

/// A depth picture that is open.
pub(super) struct DepthPicture<'a> {
    path: &'a Path,
    reader: Reader<BufReader<File>>,
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
        let reader = open_png(path, png::Transformations::IDENTITY)?;
        let (colour, bits) = (reader.info().color_type, reader.info().bit_depth);
        if (colour, bits) != (ColorType::Grayscale, BitDepth::Sixteen) {
            let header = Header { size: [0; 2], bits: bits as u8, colour: colour as u8 };
            return Err(not_depth(path, header));
        }
        Ok(Self { path, reader, rule })
    }

    pub(super) fn size(&self) -> [u32; 2] {
        let (width, height) = self.reader.info().size();
        [width, height]
    }

    /// Pixels that have a depth, counted row by row.
    pub(super) fn count(mut self) -> Result<u64, ReadError> {
        let mut count = 0;
        while let Some(row) = self.reader.next_row().map_err(|e| refuse(self.path, e))? {
            count += samples(row.data()).filter(|stored| self.rule.depth(*stored) > 0.0).count() as u64;
        }
        self.end()?;
        Ok(count)
    }

    /// All depths. `raw` keeps its memory.
    pub(super) fn depths(mut self, raw: &mut Vec<u8>) -> Result<Grid, ReadError> {
        let [width, height] = self.size().map(|side| side as usize);
        raw.resize(raw.len().max(width * height * 2), 0);
        let stored = &mut raw[..width * height * 2];
        self.reader.next_frame(stored).map_err(|e| refuse(self.path, e))?;
        let mut depths = Vec::with_capacity(width * height);
        depths.extend(samples(stored).map(|stored| self.rule.depth(stored)));
        self.end()?;
        Ok(Grid { width, height, depths })
    }

    /// What follows the pixels: a picture that was cut there is not whole.
    fn end(&mut self) -> Result<(), ReadError> {
        self.reader.finish().map_err(|e| refuse(self.path, e))
    }
}

/// A picture of other bits.
pub(super) fn not_depth(path: &Path, header: Header) -> ReadError {
    let what = format!("a PNG picture of {}; a depth map has 16-bit grey", header.describe());
    ReadError::broken(path, None, what).advise("export the depths with 16 bits")
}

fn samples(bytes: &[u8]) -> impl Iterator<Item = u16> {
    bytes.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_chunk_says_what_a_picture_is() {
        let mut start = [SIGNATURE, &[0, 0, 0, 13], FIRST_CHUNK, &[0, 0, 2, 128, 0, 0, 1, 224, 16, 0, 0, 0, 0]].concat();
        let header = Header::of(&start).unwrap();
        assert_eq!((header.size, header.is_depth(), header.describe()), ([640, 480], true, "16-bit grey".to_owned()));
        (start[24], start[25]) = (8, 2);
        let header = Header::of(&start).unwrap();
        assert_eq!((header.is_depth(), header.describe()), (false, "8-bit colour".to_owned()));
        assert_eq!(Header::of(&start[..25]), None);
        assert_eq!(Header::of(b"LASF"), None);
    }
}
