//! Units that need nothing of one another: each puts bytes at places that are known before it is done, and notes what else it
//! came to.

use std::sync::{Mutex, PoisonError};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::keeper::GroupUnits;
use super::unit_file::{UnitReader, UnitWriter};
use crate::error::{ConvertError, JobFault};
use crate::runtime::Runtime;

/// Bytes that are put back together.
const PIECE_BYTES: u64 = 4 << 20;

/// What a unit would write into the output, into its file instead: the bytes, and `P` for each piece of them, which says where
/// they belong.
pub(crate) struct UnitLog<'a, P> {
    inner: Mutex<(&'a mut UnitWriter, Vec<(P, u64)>)>,
}

impl<'a, P: Serialize> UnitLog<'a, P> {
    /// Of a unit whose file was just begun.
    pub(crate) fn begin(file: &'a mut UnitWriter) -> Self {
        file.begin();
        Self { inner: Mutex::new((file, Vec::new())) }
    }

    /// Notes bytes.
    pub(crate) fn put(&self, place: P, bytes: &[u8]) -> Result<(), ConvertError> {
        let mut inner = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        inner.0.write(bytes)?;
        inner.1.push((place, bytes.len() as u64));
        Ok(())
    }

    /// Ends the file with what else the unit came to.
    pub(crate) fn end(self, came_to: &impl Serialize) -> Result<(), ConvertError> {
        let (file, places) = self.inner.into_inner().unwrap_or_else(PoisonError::into_inner);
        file.put(&places)?;
        file.put(came_to)
    }
}

/// Puts the bytes of a unit where they belong, in the order in which they were noted, a large piece in parts of whole rows of
/// `row_bytes`: `put` gets the place, where in the piece they begin, and the bytes. Returns what else the unit
/// came to. If the file turns out not to be whole, some bytes were put: who makes the unit again puts them there again.
pub(crate) fn put_back<P: DeserializeOwned, T: DeserializeOwned>(
    unit: &UnitReader,
    row_bytes: u64,
    mut put: impl FnMut(&P, u64, &[u8]) -> Result<(), ConvertError>,
) -> Result<T, ConvertError> {
    let places: Vec<(P, u64)> = unit.get(1)?;
    let came_to = unit.get(2)?;
    let mut reader = unit.reader(0)?;
    let part = (PIECE_BYTES / row_bytes.max(1)).max(1) * row_bytes.max(1);
    let mut buffer = Vec::new();
    for (place, bytes) in &places {
        let mut done = 0;
        while done < *bytes || *bytes == 0 {
            buffer.resize((bytes - done).min(part) as usize, 0);
            reader.read(&mut buffer)?;
            put(place, done, &buffer)?;
            done += buffer.len() as u64;
            if *bytes == 0 {
                break;
            }
        }
    }
    reader.end()?;
    Ok(came_to)
}

/// Does those units that are to be done here, and leaves them in their files. `points`: of each; `make`: fills the file of one.
///
/// # Errors
/// If units of the job are done one by one, how far all of them are: nothing is left to do here then.
pub(crate) fn make_units(
    of: GroupUnits<'_>,
    points: &[u64],
    rt: &Runtime<'_>,
    make: impl Fn(usize, &mut UnitWriter) -> Result<(), ConvertError> + Sync,
) -> Result<(), ConvertError> {
    let mut wanted = Vec::new();
    for i in 0..points.len() {
        if of.in_parts().is_none_or(|job| job.wants(of.name(i))) && !of.is_done(i)? {
            wanted.push(i);
        }
    }
    if of.in_parts().is_none() {
        of.all_done(points.len())?;
    }
    of.count_recalled(points.len() - wanted.len());
    rt.in_parallel(
        wanted.len(),
        || (),
        |(), i| {
            of.keep(wanted[i], |file| make(wanted[i], file))?;
            rt.advance(points[wanted[i]]);
            Ok(())
        },
        |()| (),
    )?;
    let Some(job) = of.in_parts() else { return Ok(()) };
    let listed = points.iter().enumerate().map(|(i, points)| of.listed(job, i, *points, Vec::new()));
    Err(JobFault::Unfinished { units: listed.collect() }.into())
}

#[cfg(test)]
mod tests {
    use std::path::Path;
    use std::sync::Arc;

    use super::*;
    use crate::runtime::{Disk, DiskFile, SystemDisk};

    #[test]
    fn bytes_come_back_in_order_with_their_places_large_ones_in_parts() {
        let dir = tempfile::tempdir().unwrap();
        let (path, disk): (_, Arc<dyn Disk>) = (dir.path().join("unit"), Arc::new(SystemDisk));
        let large: Vec<u8> = (0..PIECE_BYTES + 5).map(|i| (i % 253) as u8).collect();
        let pieces = [(7u64, &large[..]), (9, &[]), (1, &[1, 2, 3])];
        let mut file = UnitWriter::create(&path, 0, &disk).unwrap();
        let log = UnitLog::begin(&mut file);
        pieces.iter().for_each(|(place, bytes)| log.put(*place, bytes).unwrap());
        log.end(&"the end").unwrap();
        file.finish(true).unwrap();
        let open = |path: &Path| DiskFile::open(path, path.to_path_buf(), &disk).unwrap();
        let unit = UnitReader::open(&path, 0, open(&path), std::fs::metadata(&path).unwrap().len()).unwrap();
        let mut found: Vec<(u64, Vec<u8>)> = Vec::new();
        let came_to: String = put_back(&unit, 3, |place: &u64, from, bytes| {
            assert_eq!(from % 3, 0);
            match found.last_mut() {
                Some((last, all)) if last == place && from > 0 => all.extend_from_slice(bytes),
                _ => found.push((*place, bytes.to_vec())),
            }
            Ok(())
        })
        .unwrap();
        assert_eq!(came_to, "the end");
        assert_eq!(found, pieces.map(|(place, bytes)| (place, bytes.to_vec())));
    }
}
