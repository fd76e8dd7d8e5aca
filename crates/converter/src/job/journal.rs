//! The journal of a job: records that are appended, each with its length and a checksum, and synced.
//!
//! ```text
//! magic, 16 bytes │ record │ record │ …
//! record: length of the payload u32 │ CRC-32C of payload u32 │ CRC-32C of these 8 bytes u32 │ payload
//! ```
//!
//! All little-endian. What a run was writing when it ended is cut off: a record that goes beyond the end of the file, or the last
//! one with another checksum. Anything else that does not fit is damage, and refused.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use crate::error::{ConvertError, JobFault};
use crate::runtime::{Disk, DiskFile};

const MAGIC: &[u8; 16] = b"pointmill job 1\n";
const HEAD_BYTES: usize = 12;

/// A record has at most so many bytes; lists of a unit of work are far below.
const MOST_BYTES: u32 = 1 << 30;

/// Where a payload is in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Entry {
    pub(super) offset: u64,
    pub(super) bytes: u32,
}

/// A journal that is open.
#[derive(Debug)]
pub(super) struct Journal {
    file: DiskFile,
    end: u64,
}

impl Journal {
    /// A new one, synced.
    pub(super) fn create(path: &Path, disk: &Arc<dyn Disk>) -> Result<Self, ConvertError> {
        let file = DiskFile::create(path, path.to_path_buf(), disk)?;
        file.write_at(MAGIC, 0, "beginning the journal")?;
        file.sync("beginning the journal")?;
        Ok(Self { file, end: MAGIC.len() as u64 })
    }

    /// One that is there, and what it holds; `None`: it was not even begun. A torn end is cut off.
    pub(super) fn open(path: &Path, disk: &Arc<dyn Disk>) -> Result<Option<(Self, Vec<Entry>)>, ConvertError> {
        let length = fs::metadata(path).map_err(|e| ConvertError::io(path, "opening the journal", e))?.len();
        let file = DiskFile::open(path, path.to_path_buf(), disk)?;
        let mut magic = [0; MAGIC.len()];
        if length < magic.len() as u64 || is_zero(&file, 0, length)? {
            return Ok(None);
        }
        file.read_at(&mut magic, 0, "reading the journal")?;
        if magic != *MAGIC {
            return Err(damaged(path, 0));
        }
        let (mut entries, mut at) = (Vec::new(), magic.len() as u64);
        while let Some(entry) = next(&file, path, at, length)? {
            at = entry.offset + u64::from(entry.bytes);
            entries.push(entry);
        }
        if at < length {
            file.set_len(at, "cutting the journal")?;
        }
        Ok(Some((Self { file, end: at }, entries)))
    }

    /// Appends a record and waits until it is safe.
    pub(super) fn append(&mut self, payload: &[u8]) -> Result<Entry, ConvertError> {
        let too_long = || ConvertError::Internal(format!("a record of {} bytes for the journal", payload.len()));
        let bytes = u32::try_from(payload.len()).ok().filter(|b| *b <= MOST_BYTES).ok_or_else(too_long)?;
        let record = [&head(bytes, crc32c::crc32c(payload))[..], payload].concat();
        self.file.write_at(&record, self.end, "writing the journal")?;
        self.file.sync("writing the journal")?;
        let entry = Entry { offset: self.end + HEAD_BYTES as u64, bytes };
        self.end += record.len() as u64;
        Ok(entry)
    }

    /// The payload of a record.
    pub(super) fn read(&self, entry: Entry) -> Result<Vec<u8>, ConvertError> {
        let mut payload = vec![0; entry.bytes as usize];
        self.file.read_at(&mut payload, entry.offset, "reading the journal")?;
        Ok(payload)
    }
}

fn head(bytes: u32, sum: u32) -> [u8; HEAD_BYTES] {
    let mut head = [0; HEAD_BYTES];
    head[..4].copy_from_slice(&bytes.to_le_bytes());
    head[4..8].copy_from_slice(&sum.to_le_bytes());
    let own = crc32c::crc32c(&head[..8]);
    head[8..].copy_from_slice(&own.to_le_bytes());
    head
}

/// The record at `at` of a file of `length` bytes; `None`: the file ends there, or within it.
fn next(file: &DiskFile, path: &Path, at: u64, length: u64) -> Result<Option<Entry>, ConvertError> {
    let mut head_bytes = [0; HEAD_BYTES];
    let offset = at + HEAD_BYTES as u64;
    if offset > length {
        return Ok(None);
    }
    file.read_at(&mut head_bytes, at, "reading the journal")?;
    let [bytes, sum, _] = [0, 4, 8].map(|i| u32::from_le_bytes([0, 1, 2, 3].map(|j| head_bytes[i + j])));
    if head_bytes != head(bytes, sum) {
        // blocks of zeros are what some file systems leave of a write that did not happen
        let is_hole = is_zero(file, at, length)?;
        return if is_hole { Ok(None) } else { Err(damaged(path, at)) };
    }
    let end = offset + u64::from(bytes);
    if bytes > MOST_BYTES {
        return Err(damaged(path, at));
    }
    if end > length {
        return Ok(None);
    }
    let mut payload = vec![0; bytes as usize];
    file.read_at(&mut payload, offset, "reading the journal")?;
    match crc32c::crc32c(&payload) == sum {
        true => Ok(Some(Entry { offset, bytes })),
        false if end == length => Ok(None),
        false => Err(damaged(path, at)),
    }
}

/// True if nothing but zeros follows.
fn is_zero(file: &DiskFile, mut at: u64, length: u64) -> Result<bool, ConvertError> {
    let mut buffer = vec![0; 64 << 10];
    while at < length {
        let part = (length - at).min(buffer.len() as u64) as usize;
        file.read_at(&mut buffer[..part], at, "reading the journal")?;
        if buffer[..part].iter().any(|b| *b != 0) {
            return Ok(false);
        }
        at += part as u64;
    }
    Ok(true)
}

fn damaged(path: &Path, byte: u64) -> ConvertError {
    ConvertError::Job(JobFault::Damaged { file: path.to_path_buf(), byte })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::SystemDisk;

    fn disk() -> Arc<dyn Disk> {
        Arc::new(SystemDisk)
    }

    /// A journal of three records: its folder, its bytes, and where each record ends.
    fn written() -> (tempfile::TempDir, Vec<u8>, Vec<usize>) {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("journal");
        let mut journal = Journal::create(&path, &disk()).unwrap();
        let payloads = [vec![1, 2, 3], vec![0; 100], (0..200).collect()];
        let ends = payloads.iter().map(|p| {
            let entry = journal.append(p).unwrap();
            assert_eq!(journal.read(entry).unwrap(), *p);
            (entry.offset + u64::from(entry.bytes)) as usize
        });
        let ends = ends.collect();
        (dir, fs::read(path).unwrap(), ends)
    }

    fn open(dir: &tempfile::TempDir, bytes: &[u8]) -> Result<usize, ConvertError> {
        let path = dir.path().join("changed");
        fs::write(&path, bytes).unwrap();
        Ok(Journal::open(&path, &disk())?.map_or(0, |(_, entries)| entries.len()))
    }

    #[test]
    fn a_journal_cut_anywhere_has_the_records_before_and_goes_on_there() {
        let (dir, bytes, ends) = written();
        for cut in MAGIC.len()..=bytes.len() {
            let whole = ends.iter().filter(|end| **end <= cut).count();
            assert_eq!(open(&dir, &bytes[..cut]).unwrap(), whole, "{cut} bytes");
            // as file systems leave what was not written
            let mut zeros = bytes[..cut].to_vec();
            zeros.resize(bytes.len() + 50, 0);
            if ends.contains(&cut) {
                assert_eq!(open(&dir, &zeros).unwrap(), whole, "{cut} bytes and zeros");
            }
            let path = dir.path().join("changed");
            fs::write(&path, &bytes[..cut]).unwrap();
            let (mut journal, _) = Journal::open(&path, &disk()).unwrap().unwrap();
            journal.append(b"more").unwrap();
            let (journal, entries) = Journal::open(&path, &disk()).unwrap().unwrap();
            assert_eq!((entries.len(), journal.read(entries[whole]).unwrap()), (whole + 1, b"more".to_vec()));
        }
        for cut in 0..MAGIC.len() {
            fs::write(dir.path().join("changed"), &bytes[..cut]).unwrap();
            assert!(Journal::open(&dir.path().join("changed"), &disk()).unwrap().is_none(), "{cut} bytes");
        }
    }

    #[test]
    fn a_byte_that_changed_is_damage_or_ends_the_journal_before_it() {
        let (dir, bytes, ends) = written();
        for at in 0..bytes.len() {
            let mut changed = bytes.clone();
            changed[at] ^= 0x10;
            let before = ends.iter().filter(|end| **end <= at).count();
            match open(&dir, &changed) {
                Ok(found) => assert!(found == before && before == 2, "byte {at}: {found} records"),
                Err(ConvertError::Job(JobFault::Damaged { .. })) => {}
                Err(other) => panic!("byte {at}: {other}"),
            }
        }
    }
}
