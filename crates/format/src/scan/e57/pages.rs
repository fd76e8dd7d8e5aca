//! The paged layer: every 1,024 bytes of the file end in a checksum, CRC-32C, most significant byte first.
//!
//! Offsets are *physical* (of the file) or *logical* (without the checksums). Structures are contiguous logically.

use crate::scan::source::Source;
use crate::{Advice, Fault, ReadError};

/// Bytes of a page; E57 1.0 knows no other size.
pub(super) const PAGE: u64 = 1024;
/// Bytes of a page without its checksum.
pub(super) const DATA: u64 = PAGE - 4;

/// The logical offset of a physical one.
pub(super) fn logical(physical: u64) -> u64 {
    physical - physical / PAGE * (PAGE - DATA)
}

/// The physical offset of a logical one.
pub(super) fn physical(logical: u64) -> u64 {
    (logical / DATA).saturating_mul(PAGE).saturating_add(logical % DATA)
}

/// The logical length of the file: whole pages only.
pub(super) fn logical_len(source: &Source) -> u64 {
    source.len() / PAGE * DATA
}

/// Verified bytes of a file, read a window of pages at a time.
pub(super) struct Pages<'a> {
    source: &'a Source,
    window: &'a mut Vec<u8>,
    /// Pages to read at once.
    ahead: u64,
    /// The pages in the window: the first one and how many were verified.
    first: u64,
    good: u64,
}

impl<'a> Pages<'a> {
    /// `window`: memory to use; `ahead`: pages that one read fetches, ≥ 1.
    pub(super) fn new(source: &'a Source, window: &'a mut Vec<u8>, ahead: u64) -> Self {
        Self { source, window, ahead, first: 0, good: 0 }
    }

    /// Fills `out` from the logical offset `at`.
    ///
    /// # Errors
    /// The file ends before, or a page that holds some of the bytes does not match its checksum.
    pub(super) fn read(&mut self, mut at: u64, out: &mut [u8]) -> Result<(), ReadError> {
        let mut filled = 0;
        while filled < out.len() {
            let page = self.page(at / DATA)?;
            let bytes = &page[(at % DATA) as usize..];
            let n = bytes.len().min(out.len() - filled);
            out[filled..filled + n].copy_from_slice(&bytes[..n]);
            filled += n;
            at += n as u64;
        }
        Ok(())
    }

    /// The data of one page.
    fn page(&mut self, index: u64) -> Result<&[u8], ReadError> {
        if index < self.first || index - self.first >= self.good {
            self.load(index)?;
        }
        let start = ((index - self.first) * PAGE) as usize;
        Ok(&self.window[start..start + DATA as usize])
    }

    /// Reads the window that starts with page `index`. It ends before the next bad page, which is an error only when
    /// it is requested.
    fn load(&mut self, index: u64) -> Result<(), ReadError> {
        let pages = self.ahead.min((self.source.len() / PAGE).saturating_sub(index));
        if pages == 0 {
            let what = format!("page {index} is wanted, the file has {}", self.source.len() / PAGE);
            return Err(ReadError::broken(self.source.path(), self.source.len(), what).advise(Advice::CutShort));
        }
        self.good = 0;
        let bytes = self.source.slice_at(index * PAGE, pages * PAGE, self.window)?;
        let good = bytes.chunks_exact(PAGE as usize).take_while(|page| is_sound(page)).count() as u64;
        if good == 0 {
            return Err(ReadError::broken(self.source.path(), index * PAGE, Fault::Checksum { page: index })
                .advise(Advice::Damaged));
        }
        (self.first, self.good) = (index, good);
        Ok(())
    }
}

fn is_sound(page: &[u8]) -> bool {
    let (data, stored) = page.split_at(DATA as usize);
    crc32c::crc32c(data).to_be_bytes() == stored
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_go_there_and_back_over_page_borders() {
        assert_eq!((logical(1019), logical(1024), logical(2048 + 7)), (1019, 1020, 2047));
        for at in [0, 1, 1019, 1020, 1021, 123_456_789] {
            assert_eq!(logical(physical(at)), at);
        }
        assert!(physical(u64::MAX) > u64::MAX / 2, "no overflow");
    }

    #[test]
    fn a_bad_page_stops_only_those_who_need_it() {
        let mut bytes: Vec<u8> = (0..5 * PAGE).map(|i| (i % 251) as u8).collect();
        for page in bytes.chunks_exact_mut(PAGE as usize) {
            let crc = crc32c::crc32c(&page[..DATA as usize]).to_be_bytes();
            page[DATA as usize..].copy_from_slice(&crc);
        }
        bytes[3 * PAGE as usize + 5] ^= 1;
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), &bytes).unwrap();
        let source = Source::open(file.path()).unwrap();
        let mut window = Vec::new();
        let mut pages = Pages::new(&source, &mut window, 64);
        let mut out = [0; 2000];
        pages.read(1000, &mut out).unwrap();
        assert_eq!((out[19], out[20]), (bytes[1019], bytes[1024]));
        pages.read(4 * DATA, &mut out[..10]).unwrap();
        let error = pages.read(3 * DATA - 1, &mut out).unwrap_err();
        assert!(error.to_string().contains("page 3 does not match its checksum (byte 3072)"), "{error}");
        assert!(pages.read(5 * DATA - 1, &mut out[..2]).unwrap_err().to_string().contains("has 5 (byte 5120)"));
    }
}
