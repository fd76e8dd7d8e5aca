//! The bytes of a decoder of records: in memory, or read in windows.

use super::stop::Stop;
use crate::scan::source::Source;

/// Bytes of a window: large enough that reading costs little beside decoding, small beside a batch.
pub(in super::super) const WINDOW: usize = 256 << 10;

/// Bytes with a decoder in them.
pub(in super::super) enum Input<'a> {
    /// All of them.
    Whole(&'a [u8]),
    /// A part of a file, a window at a time.
    Windows(Windows<'a>),
}

/// Reads a part of a file.
pub(in super::super) struct Windows<'a> {
    source: &'a Source,
    start: u64,
    /// Behind the last byte read.
    next: u64,
    end: u64,
    window: Vec<u8>,
    size: usize,
}

impl<'a> Input<'a> {
    /// The bytes `start..end` of a file, the end at most the end of the file.
    pub(in super::super) fn of_file(source: &'a Source, start: u64, end: u64) -> Self {
        Self::with_windows(source, start, end, WINDOW)
    }

    fn with_windows(source: &'a Source, start: u64, end: u64, size: usize) -> Self {
        let end = end.min(source.len()).max(start);
        Self::Windows(Windows { source, start, next: start, end, window: Vec::new(), size })
    }

    /// What is there to be decoded.
    #[inline]
    pub(super) fn bytes(&self) -> &[u8] {
        match self {
            Self::Whole(bytes) => bytes,
            Self::Windows(windows) => &windows.window,
        }
    }

    /// Bytes from the start of the input to byte `at` of [`Self::bytes`].
    pub(super) fn place(&self, at: usize) -> u64 {
        match self {
            Self::Whole(_) => at as u64,
            Self::Windows(w) => w.next - w.start - w.window.len() as u64 + at as u64,
        }
    }

    /// The last byte of [`Self::bytes`] at which something of `most` bytes may begin.
    #[inline]
    pub(super) fn last_start(&self, most: usize) -> usize {
        match self {
            Self::Windows(w) if w.next < w.end => w.window.len().saturating_sub(most),
            _ => usize::MAX,
        }
    }

    /// Makes sure that `most` bytes from `at` on are there, or all up to the end; `at` moves along with them.
    pub(super) fn refill(&mut self, at: &mut usize, most: usize) -> Result<(), Stop> {
        let Self::Windows(w) = self else { return Ok(()) };
        if w.next == w.end || w.window.len().saturating_sub(*at) >= most {
            return Ok(());
        }
        let gone = (*at).min(w.window.len());
        w.window.drain(..gone);
        *at -= gone;
        let kept = w.window.len();
        let more = (w.end - w.next).min((w.size.max(most) - kept) as u64);
        w.window.resize(kept + more as usize, 0);
        w.source.read_at(w.next, &mut w.window[kept..]).map_err(Stop::Read)?;
        w.next += more;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_slide_over_the_part_and_end_with_it() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let bytes: Vec<u8> = (0..200).collect();
        std::fs::write(file.path(), &bytes).unwrap();
        let source = Source::open(file.path()).unwrap();
        let mut input = Input::with_windows(&source, 50, 150, 16);
        let (mut at, mut seen) = (0, Vec::new());
        while seen.len() < 100 {
            input.refill(&mut at, 10).unwrap();
            assert!(input.bytes().len() - at >= 10.min(100 - seen.len()));
            assert_eq!(input.place(at), seen.len() as u64);
            while at <= input.last_start(10) && at < input.bytes().len() {
                seen.push(input.bytes()[at]);
                at += 1;
            }
        }
        assert_eq!(seen, bytes[50..150]);
        assert_eq!(input.last_start(10), usize::MAX);
        input.refill(&mut at, 10).unwrap();
        assert_eq!(input.bytes().len(), at);
    }
}
