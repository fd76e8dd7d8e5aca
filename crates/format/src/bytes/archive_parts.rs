//! What a writer of ZIP archives puts around files that are stored as they are: at any place, in any order, by any thread.

/// Longest archive, file and number of files that need no fields of 64 bits.
const MAX_32: u64 = u32::MAX as u64 - 1;
const MAX_16: u64 = u16::MAX as u64 - 1;

/// Version of a reader that knows fields of 64 bits.
const VERSION_64: u16 = 45;
const VERSION: u16 = 20;

/// The first of January 1980: archives are the same whenever they are made.
const DATE: u16 = 1 << 5 | 1;

/// Names are UTF-8.
const UTF8: u16 = 1 << 11;

/// Marks an extra field that makes room alone.
const PADDING: u16 = 0xD935;

/// Least bytes of padding, if there is some.
pub const MIN_ARCHIVE_PADDING: usize = 4;

/// A file that is stored in an archive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ArchivedFile<'a> {
    /// With forward slashes; fewer than 65,536 bytes.
    pub name: &'a str,
    /// Of the file itself.
    pub bytes: u64,
    /// CRC-32 of these.
    pub crc: u32,
    /// Where its head begins, from the start of the archive.
    pub at: u64,
}

impl ArchivedFile<'_> {
    /// Bytes of the head before the file's own.
    pub fn head_len(&self) -> usize {
        30 + self.name.len() + if self.bytes > MAX_32 { 20 } else { 0 }
    }

    /// Appends the head; the file's bytes follow. `padding`: more bytes, none or [`MIN_ARCHIVE_PADDING`] to 65,000.
    pub fn put_head(&self, padding: usize, out: &mut Vec<u8>) {
        let is_long = self.bytes > MAX_32;
        let extra = if is_long { 20 } else { 0 } + padding;
        out.extend(b"PK\x03\x04");
        let version = if is_long { VERSION_64 } else { VERSION };
        for field in [version, UTF8, 0, 0, DATE] {
            out.extend(field.to_le_bytes());
        }
        let short = low(self.bytes, is_long);
        [self.crc, short, short].iter().for_each(|field| out.extend(field.to_le_bytes()));
        [self.name.len() as u16, extra as u16].iter().for_each(|field| out.extend(field.to_le_bytes()));
        out.extend(self.name.as_bytes());
        if is_long {
            [1u16, 16].iter().for_each(|field| out.extend(field.to_le_bytes()));
            [self.bytes; 2].iter().for_each(|field| out.extend(field.to_le_bytes()));
        }
        if let Some(zeros) = padding.checked_sub(MIN_ARCHIVE_PADDING) {
            [PADDING, zeros as u16].iter().for_each(|field| out.extend(field.to_le_bytes()));
            out.resize(out.len() + zeros, 0);
        }
    }

    /// Appends what the directory of the archive says of it.
    pub fn put_entry(&self, out: &mut Vec<u8>) {
        let (is_long, is_far) = (self.bytes > MAX_32, self.at > MAX_32);
        let mut extra: Vec<u64> = if is_long { vec![self.bytes; 2] } else { Vec::new() };
        extra.extend(is_far.then_some(self.at));
        let extra_len = if extra.is_empty() { 0 } else { 4 + 8 * extra.len() as u16 };
        out.extend(b"PK\x01\x02");
        let version = if extra.is_empty() { VERSION } else { VERSION_64 };
        for field in [3 << 8 | VERSION_64, version, UTF8, 0, 0, DATE] {
            out.extend(field.to_le_bytes());
        }
        let short = low(self.bytes, is_long);
        [self.crc, short, short].iter().for_each(|field| out.extend(field.to_le_bytes()));
        for field in [self.name.len() as u16, extra_len, 0, 0, 0] {
            out.extend(field.to_le_bytes());
        }
        out.extend((0o100_644u32 << 16).to_le_bytes()); // a file that all may read
        out.extend(low(self.at, is_far).to_le_bytes());
        out.extend(self.name.as_bytes());
        if !extra.is_empty() {
            [1, extra_len - 4].iter().for_each(|field| out.extend(field.to_le_bytes()));
            extra.iter().for_each(|field| out.extend(field.to_le_bytes()));
        }
    }
}

/// Appends the end of an archive with so many files, whose directory has `bytes` bytes from byte `at` on.
pub fn put_archive_end(files: u64, at: u64, bytes: u64, out: &mut Vec<u8>) {
    let is_long = files > MAX_16 || at > MAX_32 || bytes > MAX_32;
    if is_long {
        out.extend(b"PK\x06\x06");
        out.extend(44u64.to_le_bytes());
        [VERSION_64; 2].iter().for_each(|field| out.extend(field.to_le_bytes()));
        out.extend([0; 8]);
        [files, files, bytes, at].iter().for_each(|field| out.extend(field.to_le_bytes()));
        out.extend(b"PK\x06\x07");
        out.extend([0; 4]);
        out.extend((at + bytes).to_le_bytes());
        out.extend(1u32.to_le_bytes());
    }
    out.extend(b"PK\x05\x06");
    out.extend([0; 4]);
    let files = if is_long { u16::MAX } else { files as u16 };
    [files; 2].iter().for_each(|field| out.extend(field.to_le_bytes()));
    [low(bytes, is_long), low(at, is_long)].iter().for_each(|field| out.extend(field.to_le_bytes()));
    out.extend([0; 2]);
}

/// A field of 32 bits; all bits where one of 64 says it.
fn low(value: u64, is_elsewhere: bool) -> u32 {
    if is_elsewhere { u32::MAX } else { value as u32 }
}

#[cfg(test)]
mod tests {
    use rawzip::crc32;

    use super::*;
    use crate::bytes::{Archive, ByteSource as _};

    fn archive(files: &[(String, Vec<u8>)], padding: usize) -> Vec<u8> {
        let (mut out, mut list) = (Vec::new(), Vec::new());
        for (name, bytes) in files {
            let file = ArchivedFile { name, bytes: bytes.len() as u64, crc: crc32(bytes), at: out.len() as u64 };
            let before = out.len();
            file.put_head(padding, &mut out);
            assert_eq!(out.len() - before, file.head_len() + padding);
            out.extend(bytes);
            file.put_entry(&mut list);
        }
        let at = out.len() as u64;
        out.extend(&list);
        put_archive_end(files.len() as u64, at, list.len() as u64, &mut out);
        out
    }

    #[test]
    fn what_is_written_is_read_also_with_more_files_than_16_bits_count() {
        let dir = tempfile::tempdir().unwrap();
        for (count, padding) in [(3u32, 0), (3, 4), (3, 100), (70_000, 0)] {
            let files: Vec<_> = (0..count).map(|i| (format!("data/r/{i}.bin"), i.to_le_bytes().to_vec())).collect();
            let path = dir.path().join(format!("{count} {padding}.zip"));
            std::fs::write(&path, archive(&files, padding)).unwrap();
            let read = Archive::open(&path, "data/r/0.bin").unwrap();
            let mut bytes = [0; 4];
            read.read_at(&format!("data/r/{}.bin", count - 1), 0, &mut bytes).unwrap();
            assert_eq!(u32::from_le_bytes(bytes), count - 1);
            assert_eq!(read.files().count(), count as usize);
        }
    }

    #[test]
    fn what_is_beyond_32_bits_stands_in_fields_of_64() {
        let far = ArchivedFile { name: "a", bytes: 7, crc: 1, at: 5_000_000_000 };
        let mut entry = Vec::new();
        far.put_entry(&mut entry);
        assert_eq!(entry[42..46], [0xFF; 4]);
        assert_eq!(entry[47..51], [1, 0, 8, 0]);
        assert_eq!(entry[51..], 5_000_000_000u64.to_le_bytes());
        let long = ArchivedFile { name: "a", bytes: 5_000_000_000, crc: 1, at: 0 };
        let mut head = Vec::new();
        long.put_head(0, &mut head);
        assert_eq!(head.len(), long.head_len());
        assert_eq!((&head[18..26], &head[31..35]), (&[0xFF; 8][..], &[1, 0, 16, 0][..]));
        let mut end = Vec::new();
        put_archive_end(2, 5_000_000_000, 100, &mut end);
        assert_eq!((end.len(), &end[48..56]), (56 + 20 + 22, &5_000_000_000u64.to_le_bytes()[..]));
    }
}
