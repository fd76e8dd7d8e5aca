//! The file that a unit leaves: sections with a checksum each, and a table of them at its end. It gets its name once it is complete.
//!
//! ```text
//! magic, 16 bytes │ section │ section │ … │ table │ length of the table u32 │ CRC-32C of the table u32 │ label u32 │ magic, 16 bytes
//! table: offset u64, length u64, CRC-32C u32 of each section
//! ```
//!
//! All little-endian. The label tells what the file is of: one that was given the name of another is not whole. A file that is cut, or has another byte anywhere, is not whole: the unit is done again.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::error::{ConvertError, JobFault};
use crate::runtime::disk::{rename, sync_folder};
use crate::runtime::os_hints::PART_BYTES;
use crate::runtime::{Disk, DiskFile};

const MAGIC: &[u8; 16] = b"pointmill unit 1";
const TAIL_BYTES: u64 = 28;
const ENTRY_BYTES: usize = 20;

/// A section of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Section {
    offset: u64,
    bytes: u64,
    sum: u32,
}

/// A file while it is written.
#[derive(Debug)]
pub(crate) struct UnitWriter {
    file: DiskFile,
    /// What it is called until it is complete, and from then on.
    new: PathBuf,
    path: PathBuf,
    disk: Arc<dyn Disk>,
    sections: Vec<Section>,
    buffer: Vec<u8>,
    label: u32,
    /// Bytes that are in the file.
    written: u64,
    is_done: bool,
}

impl UnitWriter {
    /// Begins the file `path`; several processes may do so at once. `label`: what it is of.
    pub(crate) fn create(path: &Path, label: u32, disk: &Arc<dyn Disk>) -> Result<Self, ConvertError> {
        let new = new_name(path);
        let file = DiskFile::create(&new, path.to_path_buf(), disk)?;
        Ok(Self {
            file,
            new,
            path: path.to_path_buf(),
            disk: Arc::clone(disk),
            sections: Vec::new(),
            buffer: MAGIC.to_vec(),
            label,
            written: 0,
            is_done: false,
        })
    }

    /// Begins a section, empty.
    pub(crate) fn begin(&mut self) {
        let offset = self.written + self.buffer.len() as u64;
        self.sections.push(Section { offset, bytes: 0, sum: 0 });
    }

    /// Appends to the section.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<(), ConvertError> {
        if let Some(section) = self.sections.last_mut() {
            section.sum = crc32c::crc32c_append(section.sum, bytes);
            section.bytes += bytes.len() as u64;
        }
        self.append(bytes)
    }

    /// A section of its own.
    pub(crate) fn put(&mut self, value: &impl Serialize) -> Result<(), ConvertError> {
        let bytes = super::encode(value)?;
        self.begin();
        self.write(&bytes)
    }

    /// Holds no memory until it goes on.
    pub(crate) fn pause(&mut self) -> Result<(), ConvertError> {
        self.flush()?;
        self.buffer = Vec::new();
        Ok(())
    }

    fn append(&mut self, bytes: &[u8]) -> Result<(), ConvertError> {
        if self.buffer.len() + bytes.len() > PART_BYTES {
            self.flush()?;
        }
        if bytes.len() > PART_BYTES {
            self.file.write_at(bytes, self.written, "writing a unit")?;
            self.written += bytes.len() as u64;
        } else {
            self.buffer.extend_from_slice(bytes);
        }
        Ok(())
    }

    fn flush(&mut self) -> Result<(), ConvertError> {
        self.file.write_at(&self.buffer, self.written, "writing a unit")?;
        self.written += self.buffer.len() as u64;
        self.buffer.clear();
        Ok(())
    }

    /// Ends the file and gives it its name. `is_safe`: waits until the disk has it; a file that is lost is found out by its sums.
    pub(crate) fn finish(mut self, is_safe: bool) -> Result<(), ConvertError> {
        let mut table = Vec::with_capacity(self.sections.len() * ENTRY_BYTES);
        for Section { offset, bytes, sum } in &self.sections {
            table.extend_from_slice(&offset.to_le_bytes());
            table.extend_from_slice(&bytes.to_le_bytes());
            table.extend_from_slice(&sum.to_le_bytes());
        }
        let tail = [
            &(table.len() as u32).to_le_bytes()[..],
            &crc32c::crc32c(&table).to_le_bytes(),
            &self.label.to_le_bytes(),
            MAGIC,
        ]
        .concat();
        self.append(&table)?;
        self.append(&tail)?;
        self.flush()?;
        if is_safe {
            self.file.sync("syncing a unit")?;
        }
        let fail = |e| ConvertError::io(&self.path, "giving a unit its name", e);
        rename(&*self.disk, &self.new, &self.path).map_err(fail)?;
        self.is_done = true;
        match self.path.parent().filter(|_| is_safe) {
            Some(folder) => sync_folder(&*self.disk, folder).map_err(fail),
            None => Ok(()),
        }
    }
}

impl Drop for UnitWriter {
    fn drop(&mut self) {
        if !self.is_done {
            let _ = std::fs::remove_file(&self.new); // what stays is no unit, and goes with the job
        }
    }
}

/// A name that no other process takes.
fn new_name(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{name}.{}", super::unique()))
}

/// A file that is complete.
#[derive(Debug)]
pub(crate) struct UnitReader {
    file: Arc<DiskFile>,
    path: PathBuf,
    sections: Vec<Section>,
}

impl UnitReader {
    /// Opens a file that is there.
    ///
    /// # Errors
    /// It is not whole, of something else, or cannot be read.
    pub(crate) fn open(path: &Path, label: u32, file: DiskFile, length: u64) -> Result<Self, ConvertError> {
        let broken = |byte: u64| ConvertError::Job(JobFault::Damaged { file: path.to_path_buf(), byte });
        let Some(at) = length.checked_sub(TAIL_BYTES).filter(|at| *at >= MAGIC.len() as u64) else {
            return Err(broken(length));
        };
        let mut tail = [0; TAIL_BYTES as usize];
        file.read_at(&mut tail, at, "reading a unit")?;
        let word = |i: usize| u32::from_le_bytes([0, 1, 2, 3].map(|j| tail[i + j]));
        let (bytes, sum) = (u64::from(word(0)), word(4));
        let start = at
            .checked_sub(bytes)
            .filter(|start| *start >= MAGIC.len() as u64 && tail[12..] == *MAGIC && word(8) == label);
        let start = start.filter(|_| bytes % ENTRY_BYTES as u64 == 0).ok_or_else(|| broken(at))?;
        let mut table = vec![0; bytes as usize];
        file.read_at(&mut table, start, "reading a unit")?;
        if crc32c::crc32c(&table) != sum {
            return Err(broken(start));
        }
        let section = |entry: &[u8; ENTRY_BYTES]| Section {
            offset: u64::from_le_bytes(std::array::from_fn(|i| entry[i])),
            bytes: u64::from_le_bytes(std::array::from_fn(|i| entry[8 + i])),
            sum: u32::from_le_bytes(std::array::from_fn(|i| entry[16 + i])),
        };
        let sections: Vec<Section> = table.as_chunks::<ENTRY_BYTES>().0.iter().map(section).collect();
        let is_inside = |s: &Section| s.offset.checked_add(s.bytes).is_some_and(|end| end <= start);
        if !sections.iter().all(is_inside) {
            return Err(broken(start));
        }
        Ok(Self { file: Arc::new(file), path: path.to_path_buf(), sections })
    }

    /// Number of sections.
    pub(crate) fn sections(&self) -> usize {
        self.sections.len()
    }

    /// Bytes of a section.
    pub(crate) fn len(&self, index: usize) -> u64 {
        self.sections.get(index).map_or(0, |section| section.bytes)
    }

    /// The bytes of a section.
    pub(crate) fn bytes(&self, index: usize) -> Result<Vec<u8>, ConvertError> {
        let section = self.section(index)?;
        let mut bytes = vec![0; section.bytes as usize];
        self.file.read_at(&mut bytes, section.offset, "reading a unit")?;
        if crc32c::crc32c(&bytes) == section.sum { Ok(bytes) } else { Err(self.damaged(section.offset)) }
    }

    /// The value of a section.
    pub(crate) fn get<T: DeserializeOwned>(&self, index: usize) -> Result<T, ConvertError> {
        let bytes = self.bytes(index)?;
        postcard::from_bytes(&bytes).map_err(|_| self.damaged(self.sections[index].offset))
    }

    /// The file, and where a section begins in it, once its bytes were found whole.
    pub(crate) fn place(&self, index: usize) -> Result<(Arc<DiskFile>, u64), ConvertError> {
        let mut reader = self.reader(index)?;
        let mut buffer = vec![0; reader.left().min(PART_BYTES as u64) as usize];
        while reader.left() > 0 {
            let part = reader.left().min(PART_BYTES as u64) as usize;
            reader.read(&mut buffer[..part])?;
        }
        reader.end()?;
        Ok((Arc::clone(&self.file), self.section(index)?.offset))
    }

    /// Reads a section from front to back; whether its bytes are those that were written is known at the end.
    pub(crate) fn reader(&self, index: usize) -> Result<SectionReader<'_>, ConvertError> {
        Ok(SectionReader { unit: self, section: self.section(index)?, read: 0, sum: 0 })
    }

    /// Fails unless every section is whole.
    pub(crate) fn check(&self) -> Result<(), ConvertError> {
        (0..self.sections()).try_for_each(|index| self.place(index).map(drop))
    }

    fn section(&self, index: usize) -> Result<Section, ConvertError> {
        self.sections.get(index).copied().ok_or_else(|| self.damaged(0))
    }

    /// The error for a file that is not as it was written.
    pub(crate) fn damaged(&self, byte: u64) -> ConvertError {
        JobFault::Damaged { file: self.path.clone(), byte }.into()
    }
}

/// A section while it is read.
pub(crate) struct SectionReader<'a> {
    unit: &'a UnitReader,
    section: Section,
    read: u64,
    /// Of what was read.
    sum: u32,
}

impl SectionReader<'_> {
    /// Bytes that were not read yet.
    pub(crate) fn left(&self) -> u64 {
        self.section.bytes - self.read
    }

    /// Reads the next bytes, as many as `out` has.
    pub(crate) fn read(&mut self, out: &mut [u8]) -> Result<(), ConvertError> {
        if out.len() as u64 > self.left() {
            return Err(self.unit.damaged(self.section.offset));
        }
        self.unit.file.read_at(out, self.section.offset + self.read, "reading a unit")?;
        self.sum = crc32c::crc32c_append(self.sum, out);
        self.read += out.len() as u64;
        Ok(())
    }

    /// Fails unless all of the section was read and is as it was written.
    pub(crate) fn end(self) -> Result<(), ConvertError> {
        let is_whole = self.left() == 0 && self.sum == self.section.sum;
        if is_whole { Ok(()) } else { Err(self.unit.damaged(self.section.offset)) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::SystemDisk;

    fn open(path: &Path) -> Result<UnitReader, ConvertError> {
        let disk: Arc<dyn Disk> = Arc::new(SystemDisk);
        let length = std::fs::metadata(path).unwrap().len();
        UnitReader::open(path, 7, DiskFile::open(path, path.to_path_buf(), &disk).unwrap(), length)
    }

    fn read(path: &Path) -> Result<(Vec<u32>, Vec<u8>, u64), ConvertError> {
        let unit = open(path)?;
        let (_, start) = unit.place(1)?;
        Ok((unit.get(0)?, unit.bytes(1)?, start))
    }

    #[test]
    fn a_unit_comes_back_and_any_change_is_found() {
        let dir = tempfile::tempdir().unwrap();
        let (path, disk): (_, Arc<dyn Disk>) = (dir.path().join("unit"), Arc::new(SystemDisk));
        let large: Vec<u8> = (0..2_500_000u32).map(|i| (i % 251) as u8).collect();
        for bytes in [&large[..], &large[..100], &[]] {
            let mut unit = UnitWriter::create(&path, 7, &disk).unwrap();
            unit.put(&vec![1u32, 70_000]).unwrap();
            unit.begin();
            bytes.chunks(900_001).for_each(|part| unit.write(part).unwrap());
            unit.finish(true).unwrap();
            let (numbers, back, _) = read(&path).unwrap();
            assert!(numbers == [1, 70_000] && back == bytes);
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "nothing is left beside it");
        let mut unit = UnitWriter::create(&path, 7, &disk).unwrap();
        unit.put(&vec![1u32, 70_000]).unwrap();
        unit.begin();
        unit.write(&large[..100]).unwrap();
        unit.finish(false).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for at in MAGIC.len()..whole.len() {
            let mut changed = whole.clone();
            changed[at] ^= 4;
            std::fs::write(&path, &changed).unwrap();
            assert!(matches!(read(&path), Err(ConvertError::Job(JobFault::Damaged { .. }))), "byte {at}");
            std::fs::write(&path, &whole[..at]).unwrap();
            assert!(matches!(read(&path), Err(ConvertError::Job(JobFault::Damaged { .. }))), "cut at {at}");
        }
        std::fs::write(&path, &whole).unwrap();
        let length = whole.len() as u64;
        let other = UnitReader::open(&path, 8, DiskFile::open(&path, path.clone(), &disk).unwrap(), length);
        assert!(matches!(other, Err(ConvertError::Job(JobFault::Damaged { .. }))), "of something else");
        drop(UnitWriter::create(&path, 7, &disk).unwrap());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1, "one that was not finished is removed");
    }
}
