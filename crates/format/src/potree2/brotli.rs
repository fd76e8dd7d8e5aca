//! The only place that knows which Brotli library is in use (the C one, through `brotlic`).

use brotlic::{BrotliDecoder, CompressionMode, Quality, WindowSize, decode::DecoderInfo};

use crate::WriteError;
use crate::bytes::try_resize;

/// Compresses `input` into one stream (window 22, generic mode) and appends it to `out`.
pub(super) fn compress(input: &[u8], quality: u8, out: &mut Vec<u8>) -> Result<(), WriteError> {
    let quality = Quality::new(quality).map_err(refused)?;
    let window = WindowSize::new(22).map_err(refused)?;
    // The bound holds for qualities from 2 up; below, the library stores what does not fit it uncompressed.
    let bound = brotlic::compress_bound(input.len(), Quality::best())
        .ok_or_else(|| WriteError::input("a payload too large for Brotli"))?;
    let start = out.len();
    out.resize(start + bound, 0);
    let result = brotlic::compress(input, &mut out[start..], quality, window, CompressionMode::Generic);
    out.truncate(start + *result.as_ref().unwrap_or(&0));
    result.map(|_| ()).map_err(refused)
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
    use super::*;

    #[test]
    fn counting_a_stream_finds_what_decompressing_it_finds() {
        let (mut stream, mut out) = (Vec::new(), Vec::new());
        compress(&vec![7; 200_000], 6, &mut stream).unwrap();
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
