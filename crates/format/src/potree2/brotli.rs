//! The only place that knows which Brotli library is in use (the C one, through `brotlic`).

use brotlic::{
    BrotliDecoder, BrotliEncoderOptions, CompressionMode, Quality, WindowSize, decode::DecoderInfo,
    encode::BrotliOperation,
};

use crate::WriteError;
use crate::bytes::try_resize;

/// Input given to the encoder at once, bytes: the next question whether to go on comes after it.
const PIECE: usize = 64 << 10;

/// The encoder treats pieces as it treats the whole from this quality on.
const STREAMED_QUALITY: u8 = 2;

/// Compresses `input` into one stream (window 22, generic mode) and appends it to `out`. `goes_on` is asked often; false
/// ends it with [`WriteError::Stopped`]. The stream is that of one call for the whole input.
pub(super) fn compress(
    input: &[u8],
    quality: u8,
    goes_on: &dyn Fn() -> bool,
    out: &mut Vec<u8>,
) -> Result<(), WriteError> {
    // The bound holds for qualities from 2 up; below, the library stores what does not fit it uncompressed.
    let bound = brotlic::compress_bound(input.len(), Quality::best())
        .ok_or_else(|| WriteError::input("a payload too large for Brotli"))?;
    let start = out.len();
    out.resize(start + bound, 0);
    let room = &mut out[start..];
    let result = if quality < STREAMED_QUALITY || input.len() <= PIECE {
        at_once(input, quality, room)
    } else {
        match in_pieces(input, quality, goes_on, room) {
            Ok(None) => at_once(input, quality, room),
            Ok(Some(written)) => Ok(written),
            Err(error) => Err(error),
        }
    };
    out.truncate(start + *result.as_ref().unwrap_or(&0));
    result.map(drop)
}

fn at_once(input: &[u8], quality: u8, room: &mut [u8]) -> Result<usize, WriteError> {
    let (quality, window) = (Quality::new(quality).map_err(refused)?, WindowSize::new(22).map_err(refused)?);
    brotlic::compress(input, room, quality, window, CompressionMode::Generic).map_err(refused)
}

/// `None`: the stream is larger than the bound.
fn in_pieces(
    input: &[u8],
    quality: u8,
    goes_on: &dyn Fn() -> bool,
    room: &mut [u8],
) -> Result<Option<usize>, WriteError> {
    let mut encoder = BrotliEncoderOptions::new()
        .quality(Quality::new(quality).map_err(refused)?)
        .window_size(WindowSize::new(22).map_err(refused)?)
        .mode(CompressionMode::Generic)
        .size_hint(input.len() as u32) // as the library does for a whole input
        .build()
        .map_err(refused)?;
    let (mut read, mut written) = (0, 0);
    while !encoder.is_finished() {
        if !goes_on() {
            return Err(WriteError::Stopped);
        }
        let end = input.len().min(read + PIECE);
        // the last bytes come with the word that they are the last, or an empty block would follow them
        let operation = if end == input.len() { BrotliOperation::Finish } else { BrotliOperation::Process };
        let step = encoder.compress(&input[read..end], &mut room[written..], operation).map_err(refused)?;
        (read, written) = (read + step.bytes_read, written + step.bytes_written);
        if written == room.len() && !encoder.is_finished() {
            return Ok(None);
        }
    }
    Ok(Some(written))
}

fn refused(error: impl std::fmt::Display) -> WriteError {
    WriteError::Compress(error.to_string())
}

/// Why a stream did not give what it should.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// Not Brotli, or damaged.
    Corrupt,
    /// The stream ends early or gives less: this many bytes.
    Short(usize),
    /// The stream would give more than requested, or more bytes follow its end.
    Long,
    /// There is no memory for what it gives.
    Memory,
}

/// Decompresses `input`, which must be one complete stream of exactly `len` bytes, into `out` (contents replaced).
///
/// `out` grows as the stream fills it, so a stream that lies about its length costs no more memory than twice what it
/// gives, and never more than `len`.
pub(super) fn decompress(input: &[u8], len: usize, out: &mut Vec<u8>) -> Result<(), Fault> {
    let mut decoder = BrotliDecoder::new();
    let (mut read, mut written) = (0, 0);
    out.clear();
    loop {
        if written == out.len() {
            let guess = out.len().saturating_mul(2).max(input.len().saturating_mul(8)).max(1 << 16);
            try_resize(out, guess.min(len) as u64).map_err(|_| Fault::Memory)?;
        }
        let step = decoder.decompress(&input[read..], &mut out[written..]).map_err(|_| Fault::Corrupt)?;
        read += step.bytes_read;
        written += step.bytes_written;
        match step.info {
            DecoderInfo::Finished if read < input.len() => return Err(Fault::Long),
            DecoderInfo::Finished if written < len => return Err(Fault::Short(written)),
            DecoderInfo::Finished => return Ok(()),
            DecoderInfo::NeedsMoreInput => return Err(Fault::Short(written)),
            DecoderInfo::NeedsMoreOutput if written == len => return Err(Fault::Long),
            DecoderInfo::NeedsMoreOutput => {}
        }
    }
}

/// Finds out whether `input` is one complete stream of exactly `len` bytes, and keeps nothing of it.
pub(super) fn count(input: &[u8], len: usize) -> Result<(), Fault> {
    let mut decoder = BrotliDecoder::new();
    let mut window = vec![0; 1 << 16];
    let (mut read, mut written) = (0, 0);
    loop {
        let step = decoder.decompress(&input[read..], &mut window).map_err(|_| Fault::Corrupt)?;
        read += step.bytes_read;
        written += step.bytes_written;
        match step.info {
            _ if written > len => return Err(Fault::Long),
            DecoderInfo::Finished if read < input.len() => return Err(Fault::Long),
            DecoderInfo::Finished if written < len => return Err(Fault::Short(written)),
            DecoderInfo::Finished => return Ok(()),
            DecoderInfo::NeedsMoreInput => return Err(Fault::Short(written)),
            DecoderInfo::NeedsMoreOutput => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::Cell;

    use super::*;

    /// Bytes like those of a node: slow coordinates, then noise, then few values.
    fn payload(bytes: usize) -> Vec<u8> {
        let mut random = pointmill_testkit::Random::new(5);
        let mut wave = 0u32;
        let slow = (0..bytes / 8).flat_map(|_| {
            wave = wave.wrapping_add(random.next_u64() as u32 % 97);
            wave.to_le_bytes()
        });
        let mut all: Vec<u8> = slow.collect();
        all.extend((all.len()..bytes).map(|i| if i % 3 == 0 { i as u8 % 7 } else { (i * 31) as u8 }));
        all
    }

    #[test]
    fn pieces_give_the_stream_of_the_whole() {
        let fast = [PIECE - 1, PIECE, PIECE + 1, 4 * PIECE, 8 * PIECE, 8 * PIECE + 1, 700_001].map(|len| (len, 0..9));
        let slow = [PIECE + 1, 4 * PIECE, 4 * PIECE + 1].map(|len| (len, 9..12));
        for (len, qualities) in fast.into_iter().chain(slow) {
            let input = payload(len);
            let bound = brotlic::compress_bound(len, Quality::best()).unwrap();
            for quality in qualities {
                let mut out = vec![7];
                compress(&input, quality, &|| true, &mut out).unwrap();
                let mut whole = vec![0; bound];
                let end = at_once(&input, quality, &mut whole).unwrap();
                assert!(out[1..] == whole[..end], "{len} bytes, quality {quality}");
            }
        }
    }

    #[test]
    fn it_stops_when_asked_to_and_leaves_the_output_as_it_was() {
        let asked = Cell::new(0);
        let goes_on = || asked.replace(asked.get() + 1) < 3;
        let mut out = vec![7];
        assert!(matches!(compress(&payload(1 << 20), 11, &goes_on, &mut out), Err(WriteError::Stopped)));
        assert_eq!((out, asked.get()), (vec![7], 4));
    }

    #[test]
    fn counting_a_stream_finds_what_decompressing_it_finds() {
        let (mut stream, mut out) = (Vec::new(), Vec::new());
        compress(&vec![7; 200_000], 6, &|| true, &mut stream).unwrap();
        let mut both = |input: &[u8], len| {
            let found = (count(input, len), decompress(input, len, &mut out));
            assert_eq!(found.0, found.1, "{len}");
            found.0
        };
        assert_eq!(both(&stream, 200_000), Ok(()));
        assert_eq!(both(&stream, 199_999), Err(Fault::Long));
        assert_eq!(both(&stream, 200_001), Err(Fault::Short(200_000)));
        assert_eq!(both(&[&stream[..], &[0]].concat(), 200_000), Err(Fault::Long));
        assert_eq!(both(&[0xff; 100], 200_000), Err(Fault::Corrupt));
        assert_eq!(both(&[], 10), Err(Fault::Short(0)));
    }
}
