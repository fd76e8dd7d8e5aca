//! Colour pictures that are registered to a depth image: PNG and JPEG.

use std::io;
use std::path::Path;

use png::{BitDepth, Transformations};
use zune_core::bytestream::ZByteIoError;
use zune_core::colorspace::ColorSpace;
use zune_core::options::DecoderOptions;
use zune_jpeg::JpegDecoder;
use zune_jpeg::errors::DecodeErrors;

use super::picture::{Header, check_size, first_bytes, open_png, refuse};
use super::reasons::{ENDS, jpeg_reason, unknown_coding};
use super::tracked::{Place, Tracked};
use crate::{Advice, ReadError};

/// Start of a JPEG file.
const JPEG: &[u8] = &[0xff, 0xd8, 0xff];

/// The pixels of a colour picture, as they are stored.
#[derive(Debug)]
pub(super) struct Colours {
    bytes: Vec<u8>,
    /// One or two (grey, alpha), three or four (colour, alpha).
    channels: usize,
    /// Two bytes a channel, the high one first.
    is_wide: bool,
}

impl Colours {
    /// The colour of a pixel in 16 bits, full range; of 8 bits each value times 257.
    #[inline]
    pub(super) fn at(&self, pixel: usize) -> [u16; 3] {
        let value = |channel: usize| {
            let at = pixel * self.channels + channel;
            if self.is_wide {
                let pair = self.bytes.get(at * 2..).and_then(<[u8]>::first_chunk);
                pair.map_or(0, |pair| u16::from_be_bytes(*pair))
            } else {
                u16::from(self.bytes.get(at).copied().unwrap_or(0)) * 257
            }
        };
        if self.channels < 3 { [value(0); 3] } else { [value(0), value(1), value(2)] }
    }

    /// Memory of reading one of that many pixels, of either kind: pixels of 8 bytes; of a progressive JPEG three bytes and
    /// the coefficients.
    pub(super) fn bytes(pixels: u64) -> u64 {
        pixels * 12 + STATE
    }
}

/// What a decoder holds beside pixels.
const STATE: u64 = 1 << 20;

/// True for JPEG.
pub(super) fn is_jpeg(first_bytes: &[u8]) -> bool {
    first_bytes.starts_with(JPEG)
}

/// Width and height of a picture.
pub(super) fn size(path: &Path) -> Result<[u32; 2], ReadError> {
    let start = first_bytes(path)?;
    if let Some(header) = Header::of(&start) {
        return Ok(header.size);
    }
    Ok(jpeg(path, &start)?.1)
}

/// Reads a picture, which must be of that size.
pub(super) fn read(path: &Path, expected: [u32; 2]) -> Result<Colours, ReadError> {
    let start = first_bytes(path)?;
    let colours = match Header::of(&start) {
        Some(_) => read_png(path, expected)?,
        None => read_jpeg(path, &start, expected)?,
    };
    Ok(colours)
}

/// A colour picture of another size than its depths.
pub(super) fn check(path: &Path, found: [u32; 2], expected: [u32; 2]) -> Result<(), ReadError> {
    if found == expected {
        return Ok(());
    }
    let ([width, height], [w, h]) = (found, expected);
    let what = format!("the colour picture has {width} × {height} pixels, the depth map {w} × {h}");
    Err(ReadError::broken(path, 0, what).advise("register it to the depths: each pixel needs its colour"))
}

fn read_png(path: &Path, expected: [u32; 2]) -> Result<Colours, ReadError> {
    let (mut reader, place) = open_png(path, Transformations::EXPAND)?;
    let (width, height) = reader.info().size();
    check(path, [width, height], expected)?;
    let (colour, bits) = reader.output_color_type();
    let channels = colour.samples();
    let is_wide = bits == BitDepth::Sixteen;
    let size = channels * width as usize * height as usize * if is_wide { 2 } else { 1 };
    let mut bytes = vec![0; reader.output_buffer_size().unwrap_or(size).max(size)];
    reader.next_frame(&mut bytes).map_err(|e| refuse(path, &place, e))?;
    reader.finish().map_err(|e| refuse(path, &place, e))?;
    Ok(Colours { bytes, channels, is_wide })
}

fn read_jpeg(path: &Path, start: &[u8], expected: [u32; 2]) -> Result<Colours, ReadError> {
    let (mut decoder, size, place) = jpeg(path, start)?;
    check(path, size, expected)?;
    let bytes = decoder.decode().map_err(|e| refuse_jpeg(path, &place, e))?;
    let channels = decoder.output_colorspace().map_or(3, |space| space.num_components());
    Ok(Colours { bytes, channels, is_wide: false })
}

/// A JPEG file with its header read, its size, and how far it is read.
fn jpeg(path: &Path, start: &[u8]) -> Result<(JpegDecoder<Tracked>, [u32; 2], Place), ReadError> {
    if !is_jpeg(start) {
        let what = "the colour picture is neither PNG nor JPEG";
        return Err(ReadError::broken(path, 0, what).advise("convert it to one of these"));
    }
    let (file, place) = Tracked::open(path)?;
    // what is cut short or corrupt is an error, not grey
    let options = DecoderOptions::new_safe().set_strict_mode(true);
    let mut decoder = JpegDecoder::new_with_options(file, options);
    decoder.decode_headers().map_err(|e| refuse_jpeg(path, &place, e))?;
    let size = decoder.dimensions().and_then(|(w, h)| Some([u32::try_from(w).ok()?, u32::try_from(h).ok()?]));
    let size = size.unwrap_or_default();
    check_size(path, size)?;
    if decoder.input_colorspace() == Some(ColorSpace::Luma) {
        decoder.set_options(options.jpeg_set_out_colorspace(ColorSpace::Luma));
    }
    Ok((decoder, size, place))
}

fn refuse_jpeg(path: &Path, place: &Place, error: DecodeErrors) -> ReadError {
    let error = match error {
        DecodeErrors::IoErrors(ZByteIoError::StdIoError(e)) if e.kind() != io::ErrorKind::UnexpectedEof => {
            return ReadError::io(path, "reading the picture", e);
        }
        other => other,
    };
    if let Some(coding) = unknown_coding(path) {
        let what = format!("the colour picture is a JPEG of a coding that is not read: {coding}");
        return ReadError::unsupported(path, what).advise("save it as a JPEG of the usual kind, or as PNG");
    }
    let reason = jpeg_reason(&error);
    let advice = if reason == ENDS { Advice::CutShort } else { Advice::Damaged };
    ReadError::broken(path, place.get(), format!("the colour picture cannot be decoded: {reason}")).advise(advice)
}
