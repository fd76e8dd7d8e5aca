//! Bytes of units that are in the output already. A run that keeps a job gives the file that it writes a second name in the job's
//! folder: the bytes outlive the run without being written twice, and a unit leaves no more than where they are, and their sums.

use serde::{Deserialize, Serialize};

use crate::error::ConvertError;
use crate::runtime::DiskFile;
use crate::runtime::os_hints::PART_BYTES;

/// Where bytes are in the output, and their CRC-32C.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Place {
    pub(crate) offset: u64,
    pub(crate) bytes: u64,
    sum: u32,
}

impl Place {
    /// Of bytes that are written at `offset`.
    pub(crate) fn of(offset: u64, bytes: &[u8]) -> Self {
        Self { offset, bytes: bytes.len() as u64, sum: crc32c::crc32c(bytes) }
    }
}

/// A file of the output that a job has, too; offsets count from `start`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct KeptFile<'a> {
    pub(crate) file: &'a DiskFile,
    pub(crate) start: u64,
}

impl KeptFile<'_> {
    /// True if the bytes are there as they were written. Nothing has waited until they were safe.
    pub(crate) fn holds(&self, place: &Place) -> Result<bool, ConvertError> {
        let begin = self.start.checked_add(place.offset);
        let end = begin.and_then(|begin| begin.checked_add(place.bytes));
        let (Some(mut at), Some(end)) = (begin, end) else { return Ok(false) };
        if end > self.file.len("looking at what was built")? {
            return Ok(false);
        }
        let (mut buffer, mut sum) = (vec![0; place.bytes.min(PART_BYTES as u64) as usize], 0);
        while at < end {
            let part = (end - at).min(PART_BYTES as u64);
            let part_of_buffer = &mut buffer[..part as usize];
            self.file.read_at(part_of_buffer, at, "looking at what was built")?;
            sum = crc32c::crc32c_append(sum, part_of_buffer);
            at += part;
        }
        Ok(sum == place.sum)
    }
}

/// A part of the output in which units put bytes where they belong, `P`, and which outlives the run.
pub(crate) trait InPlace<P>: Sync {
    /// Writes bytes; returns where they begin in their file.
    fn write(&self, belong: &P, bytes: &[u8]) -> Result<u64, ConvertError>;

    /// True if bytes that a run before has written are there.
    fn holds(&self, belong: &P, place: &Place) -> Result<bool, ConvertError>;
}

/// One file, in which bytes belong at offsets.
impl InPlace<u64> for KeptFile<'_> {
    fn write(&self, belong: &u64, bytes: &[u8]) -> Result<u64, ConvertError> {
        self.file.write_at(bytes, self.start + belong, "writing what a unit has built")?;
        Ok(*belong)
    }

    fn holds(&self, belong: &u64, place: &Place) -> Result<bool, ConvertError> {
        Ok(*belong == place.offset && KeptFile::holds(self, place)?)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::runtime::{Disk, SystemDisk};

    #[test]
    fn bytes_that_changed_or_are_missing_are_not_held() {
        let dir = tempfile::tempdir().unwrap();
        let (path, disk): (_, Arc<dyn Disk>) = (dir.path().join("file"), Arc::new(SystemDisk));
        let file = DiskFile::create(&path, path.clone(), &disk).unwrap();
        let bytes: Vec<u8> = (0..PART_BYTES as u64 + 77).map(|i| (i % 251) as u8).collect();
        file.write_at(&bytes, 10 + 5, "writing").unwrap();
        let kept = KeptFile { file: &file, start: 10 };
        let place = Place::of(5, &bytes);
        assert!(kept.holds(&place).unwrap() && kept.holds(&Place::of(7, &[])).unwrap());
        for other in [
            Place { offset: 4, ..place },
            Place { offset: u64::MAX, ..place },
            Place { bytes: place.bytes + 1, ..place },
            Place { bytes: u64::MAX, ..place },
            Place { sum: place.sum ^ 1, ..place },
        ] {
            assert!(!kept.holds(&other).unwrap(), "{other:?}");
        }
        for at in [15, 15 + PART_BYTES as u64, 15 + place.bytes - 1] {
            let was = bytes[(at - 15) as usize];
            file.write_at(&[was ^ 8], at, "writing").unwrap();
            assert!(!kept.holds(&place).unwrap(), "byte {at}");
            file.write_at(&[was], at, "writing").unwrap();
        }
        assert!(kept.holds(&place).unwrap());
        file.set_len(15 + place.bytes - 1, "cutting").unwrap();
        assert!(!kept.holds(&place).unwrap(), "cut");
    }
}
