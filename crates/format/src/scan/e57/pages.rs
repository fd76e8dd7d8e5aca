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

/// The logical length of the file. Of a last page that is not whole, what is there counts.
pub(super) fn logical_len(source: &Source) -> u64 {
    source.len() / PAGE * DATA + (source.len() % PAGE).min(DATA)
}

/// Pages of the file, a last one that is not whole among them.
fn page_count(source: &Source) -> u64 {
    source.len().div_ceil(PAGE)
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
    /// Bytes of these.
    len: usize,
}

impl<'a> Pages<'a> {
    /// `window`: memory to use; `ahead`: pages that one read fetches, ≥ 1.
    pub(super) fn new(source: &'a Source, window: &'a mut Vec<u8>, ahead: u64) -> Self {
        Self { source, window, ahead, first: 0, good: 0, len: 0 }
    }

    /// Fills `out` from the logical offset `at`.
    ///
    /// # Errors
    /// The file ends before, or a page that holds some of the bytes does not match its checksum.
    pub(super) fn read(&mut self, mut at: u64, out: &mut [u8]) -> Result<(), ReadError> {
        let mut filled = 0;
        while filled < out.len() {
            let page = self.page(at / DATA)?;
            let bytes = page.get((at % DATA) as usize..).unwrap_or_default();
            if bytes.is_empty() {
                return Err(self.ends_before(at / DATA));
            }
            let n = bytes.len().min(out.len() - filled);
            out[filled..filled + n].copy_from_slice(&bytes[..n]);
            filled += n;
            at += n as u64;
        }
        Ok(())
    }

    /// The data of one page; of the last one what is there.
    fn page(&mut self, index: u64) -> Result<&[u8], ReadError> {
        if index < self.first || index - self.first >= self.good {
            self.load(index)?;
        }
        let start = ((index - self.first) * PAGE) as usize;
        Ok(&self.window[start..(start + DATA as usize).min(self.len)])
    }

    fn ends_before(&self, index: u64) -> ReadError {
        let (len, path) = (self.source.len(), self.source.path());
        let what = match (len / PAGE, len % PAGE) {
            (whole, 0) => format!("page {index} is wanted, the file has {whole}"),
            (whole, rest) => format!("page {index} is wanted, the file has {whole} and {rest} bytes of another"),
        };
        ReadError::broken(path, len, what).advise(Advice::CutShort)
    }

    /// Reads the window that starts with page `index`. It ends before the next bad page, which is an error only when
    /// it is requested.
    fn load(&mut self, index: u64) -> Result<(), ReadError> {
        let pages = self.ahead.min(page_count(self.source).saturating_sub(index));
        if pages == 0 {
            return Err(self.ends_before(index));
        }
        self.good = 0;
        let len = (pages * PAGE).min(self.source.len() - index * PAGE);
        let bytes = self.source.slice_at(index * PAGE, len, self.window)?;
        let good = bytes.chunks(PAGE as usize).take_while(|page| is_sound(page)).count() as u64;
        if good == 0 {
            return Err(ReadError::broken(self.source.path(), index * PAGE, Fault::Checksum { page: index })
                .advise(Advice::Damaged));
        }
        (self.first, self.good, self.len) = (index, good, (good * PAGE).min(len) as usize);
        Ok(())
    }
}

/// True if a page matches its checksum, as far as that is there: the last page of a file may lack bytes of it.
fn is_sound(page: &[u8]) -> bool {
    let Some((data, stored)) = page.split_at_checked(DATA as usize) else { return true };
    stored.is_empty() || crc32c::crc32c(data).to_be_bytes().starts_with(stored)
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

    #[test]
    fn a_last_page_that_is_not_whole_gives_what_is_there() {
        let mut page: Vec<u8> = (0..DATA).map(|i| (i % 249) as u8).collect();
        page.extend(crc32c::crc32c(&page).to_be_bytes());
        let two = [page.as_slice(), &page].concat();
        // as many bytes of the second page as are there, of which so many are data
        for (there, data) in [(1, 1), (700, 700), (1020, 1020), (1021, 1020), (1023, 1020)] {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), &two[..1024 + there]).unwrap();
            let source = Source::open(file.path()).unwrap();
            assert_eq!(logical_len(&source), DATA + data as u64);
            let (mut window, mut out) = (Vec::new(), vec![0; 1020 + data]);
            let mut pages = Pages::new(&source, &mut window, 64);
            pages.read(0, &mut out).unwrap();
            assert_eq!(out[1020..], page[..data]);
            let error = pages.read(1020, &mut vec![0; data + 1]).unwrap_err().to_string();
            assert!(
                error.contains(if data < 1020 { "page 1 is wanted, the file has 1 and" } else { "page 2" }),
                "{error}"
            );
        }
        let mut bytes = two[..2046].to_vec();
        bytes[2045] ^= 1;
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), &bytes).unwrap();
        let source = Source::open(file.path()).unwrap();
        let error = Pages::new(&source, &mut Vec::new(), 64).read(1020, &mut [0]).unwrap_err();
        assert!(
            error.to_string().contains("page 1 does not match its checksum"),
            "what is there of it counts: {error}"
        );
    }
}
