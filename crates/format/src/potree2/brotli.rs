//! The only place that knows which Brotli library is in use (the C one, through `brotlic`).

use brotlic::{BrotliDecoder, CompressionMode, Quality, WindowSize, decode::DecoderInfo};

use crate::WriteError;

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
            let guess = (2 * out.len()).max(input.len().saturating_mul(8)).max(1 << 16);
            out.resize(guess.min(len), 0);
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
