//! Why a decoder refuses a picture, in plain words: what the decoders say is for programmers.

use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::Path;

use png::DecodingError;
use zune_core::bytestream::ZByteIoError;
use zune_jpeg::errors::DecodeErrors;

/// A picture that was cut short.
pub(super) const ENDS: &str = "it ends before its last pixel";

const CORRUPT_PIXELS: &str = "its compressed pixels are corrupt";

/// Why a PNG picture is refused. What the decoder finds has no type outside of it, but a text.
pub(super) fn png_reason(error: &DecodingError) -> String {
    /// Words of the decoder, and ours; `chunk`, the name of the one that it names.
    const REASONS: [(&str, &str); 15] = [
        ("CRC error", "the checksum of its chunk {chunk} is wrong"),
        ("Corrupt deflate stream", CORRUPT_PIXELS),
        ("chunk is missing", "it has no pixels"),
        ("does not have enough data", "pixels are missing in it"),
        ("must appear at most once", "its chunk {chunk} is there twice"),
        ("Unrecognized critical chunk", "its chunk {chunk} is not known"),
        ("Chunk length wrong", "its chunk {chunk} has a wrong length"),
        ("alette", "its palette is missing or too short"),
        ("Invalid bit depth", "its header is wrong"),
        ("Invalid color", "its header is wrong"),
        ("Invalid image dimensions", "its header is wrong"),
        ("Unknown ", "its header is wrong"),
        ("limits are exceeded", "it has more beside its pixels than pictures have"),
        ("before IHDR", "its chunk {chunk} is out of place"),
        (" invalid ", "its chunk {chunk} is out of place"),
    ];
    let text = error.to_string();
    let found = REASONS.iter().find(|(theirs, _)| text.contains(theirs));
    let ours = found.map_or("its chunks are not those of a PNG picture", |(_, ours)| ours);
    match chunk_name(&text) {
        Some(name) => ours.replace("{chunk}", name),
        None => ours.replace(" {chunk}", ""),
    }
}

/// The name of a chunk, four letters, in a text of the decoder.
fn chunk_name(text: &str) -> Option<&str> {
    let after = |start: &str| text.split_once(start).and_then(|(_, rest)| rest.get(..4));
    let name = after("type: ").or_else(|| after("\""))?;
    name.bytes().all(|letter| letter.is_ascii_alphabetic()).then_some(name)
}

/// Why a JPEG picture is refused.
pub(super) fn jpeg_reason(error: &DecodeErrors) -> &'static str {
    let text: &str = match error {
        DecodeErrors::IoErrors(ZByteIoError::StdIoError(_) | ZByteIoError::NotEnoughBytes(..))
        | DecodeErrors::ExhaustedData => return ENDS,
        DecodeErrors::HuffmanDecode(_) | DecodeErrors::MCUError(_) => return CORRUPT_PIXELS,
        DecodeErrors::DqtError(_) => return "its table of quantisation is wrong",
        DecodeErrors::SosError(_) => return "its header of a scan is wrong",
        DecodeErrors::SofError(_) => return "its header of a frame is wrong",
        DecodeErrors::ZeroError => return "it declares no pixels",
        DecodeErrors::Format(text) => text,
        DecodeErrors::FormatStatic(text) => text,
        _ => "",
    };
    match text {
        _ if text.contains("Premature") || text.contains("Missing samples") => ENDS,
        _ if text.contains("uffman") || text.contains("bit stream") => CORRUPT_PIXELS,
        _ => "its segments are not those of a JPEG picture",
    }
}

/// How a JPEG picture is coded, if that is a way that the decoder does not read: it passes over such a frame, and misses it
/// later.
pub(super) fn unknown_coding(path: &Path) -> Option<&'static str> {
    let mut file = BufReader::new(File::open(path).ok()?);
    file.seek_relative(2).ok()?;
    loop {
        let mut head = [0; 4];
        file.read_exact(&mut head).ok()?;
        let [0xff, marker, length @ ..] = head else { return None };
        match marker {
            0xc3 => return Some("lossless"),
            0xc5..=0xc7 => return Some("hierarchical"),
            0xc9..=0xcb | 0xcd..=0xcf => return Some("arithmetic coding"),
            0xc0..=0xc2 => {
                let mut bits = [0];
                file.read_exact(&mut bits).ok()?;
                return (bits[0] == 12).then_some("12 bits");
            }
            // pixels follow
            0xda => return None,
            _ => file.seek_relative(i64::from(u16::from_be_bytes(length)) - 2).ok()?,
        }
    }
}
