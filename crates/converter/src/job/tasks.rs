//! Units that need nothing of one another: each puts bytes at places that are known before it is done, and notes what else it
//! came to.

use std::sync::{Mutex, PoisonError};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::in_place::{InPlace, Place};
use super::keeper::GroupUnits;
use super::unit_file::{UnitReader, UnitWriter};
use crate::error::{ConvertError, JobFault};
use crate::runtime::Runtime;

/// Bytes that are put back together.
const PIECE_BYTES: u64 = 4 << 20;

/// Sections of the file of a unit: bytes that belong into the output, and where; what else the unit came to; where its bytes are if
/// they are in the output already.
const BYTES: usize = 0;
const BELONG: usize = 1;
const CAME_TO: usize = 2;
const IN_PLACE: usize = 3;

/// What a unit writes into the output: into its own file instead, with `P` for each piece of bytes, which says where they belong;
/// or into the output at once, where a job has that, too.
pub(crate) struct UnitLog<'a, P> {
    in_place: Option<&'a dyn InPlace<P>>,
    inner: Mutex<Noted<'a, P>>,
}

struct Noted<'a, P> {
    file: &'a mut UnitWriter,
    belong: Vec<(P, u64)>,
    in_place: Vec<(P, Place)>,
}

impl<'a, P: Serialize> UnitLog<'a, P> {
    /// Of a unit whose file was just begun. `in_place`: bytes go into the output at once.
    pub(crate) fn begin(file: &'a mut UnitWriter, in_place: Option<&'a dyn InPlace<P>>) -> Self {
        file.begin();
        Self { in_place, inner: Mutex::new(Noted { file, belong: Vec::new(), in_place: Vec::new() }) }
    }

    /// Notes bytes.
    pub(crate) fn put(&self, place: P, bytes: &[u8]) -> Result<(), ConvertError> {
        let write = |to: &dyn InPlace<P>| to.write(&place, bytes).map(|at| Place::of(at, bytes));
        let written = self.in_place.map(write).transpose()?;
        let mut noted = self.inner.lock().unwrap_or_else(PoisonError::into_inner);
        match written {
            Some(written) => noted.in_place.push((place, written)),
            None => {
                noted.file.write(bytes)?;
                noted.belong.push((place, bytes.len() as u64));
            }
        }
        Ok(())
    }

    /// Ends the file with what else the unit came to.
    pub(crate) fn end(self, came_to: &impl Serialize) -> Result<(), ConvertError> {
        let Noted { file, belong, in_place } = self.inner.into_inner().unwrap_or_else(PoisonError::into_inner);
        file.put(&belong)?;
        file.put(came_to)?;
        file.put(&self.in_place.map(|_| in_place))
    }
}

/// What a unit has left beside its bytes.
pub(crate) struct Said<P, T> {
    /// Where bytes belong, and how many.
    pub(crate) belong: Vec<(P, u64)>,
    /// What else it came to.
    pub(crate) came_to: T,
    /// Bytes that are in the output already.
    pub(crate) in_place: Option<Vec<(P, Place)>>,
}

impl<P: DeserializeOwned, T: DeserializeOwned> Said<P, T> {
    /// `can_be`: whether it can be of the unit. Checksums say that a file is as it was written, not by whom.
    fn read(unit: &UnitReader, can_be: impl FnOnce(&Self) -> bool) -> Result<Self, ConvertError> {
        let said = Self { belong: unit.get(BELONG)?, came_to: unit.get(CAME_TO)?, in_place: unit.get(IN_PLACE)? };
        if can_be(&said) { Ok(said) } else { Err(unit.damaged(0)) }
    }
}

/// Puts the bytes of a unit where they belong, in the order in which they were noted, a large piece in parts of whole rows of
/// `row_bytes`: `put` gets the place, where in the piece they begin, and the bytes. `there` is told of bytes that are in the output
/// already. `can_be`: whether what it says can be of the unit. Returns what else the unit came to. If the file turns out not to be whole, some bytes were put: who makes the unit again
/// puts them there again.
pub(crate) fn put_back<P: DeserializeOwned, T: DeserializeOwned>(
    unit: &UnitReader,
    row_bytes: u64,
    can_be: impl FnOnce(&Said<P, T>) -> bool,
    mut put: impl FnMut(&P, u64, &[u8]) -> Result<(), ConvertError>,
    mut there: impl FnMut(P, Place),
) -> Result<T, ConvertError> {
    let Said { belong, came_to, in_place } = Said::read(unit, can_be)?;
    let mut reader = unit.reader(BYTES)?;
    let part = (PIECE_BYTES / row_bytes.max(1)).max(1) * row_bytes.max(1);
    let mut buffer = Vec::new();
    for (place, bytes) in &belong {
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
    in_place.into_iter().flatten().for_each(|(place, at)| there(place, at));
    Ok(came_to)
}

/// Fails unless the file of a unit is whole and can be of it, and its bytes are in the output.
fn check<P: DeserializeOwned, T: DeserializeOwned>(
    unit: &UnitReader,
    output: Option<&dyn InPlace<P>>,
    can_be: impl FnOnce(&Said<P, T>) -> bool,
) -> Result<(), ConvertError> {
    unit.check()?;
    let said = Said::read(unit, can_be)?;
    for (belong, place) in said.in_place.into_iter().flatten() {
        if !output.map_or(Ok(false), |output| output.holds(&belong, &place))? {
            return Err(unit.damaged(0));
        }
    }
    Ok(())
}

/// Does those units that are to be done here, and leaves them in their files. `points`: of each; `output`: if their bytes are put
/// there at once; `can_be`: whether what one has left can be of it; `make`: fills the file of one.
///
/// # Errors
/// If units of the job are done one by one, how far all of them are: nothing is left to do here then.
pub(crate) fn make_units<P: DeserializeOwned, T: DeserializeOwned>(
    of: GroupUnits<'_>,
    points: &[u64],
    output: Option<&dyn InPlace<P>>,
    rt: &Runtime<'_>,
    can_be: impl Fn(usize, &Said<P, T>) -> bool + Sync,
    make: impl Fn(usize, &mut UnitWriter) -> Result<(), ConvertError> + Sync,
) -> Result<(), ConvertError> {
    let is_wanted = |i: usize| -> Result<bool, ConvertError> {
        let is_here = of.in_parts().is_none_or(|job| job.wants(of.name(i)));
        Ok(is_here && !of.is_done(i, |unit| check(unit, output, |said| can_be(i, said)))?)
    };
    let wanted = rt.in_parallel(
        points.len(),
        Vec::new,
        |wanted, i| {
            wanted.extend(is_wanted(i)?.then_some(i));
            Ok(())
        },
        |wanted| wanted,
    )?;
    let mut wanted: Vec<usize> = wanted.into_iter().flatten().collect();
    wanted.sort_unstable();
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

    use super::super::in_place::KeptFile;
    use super::*;
    use crate::runtime::{Disk, DiskFile, SystemDisk};

    #[test]
    fn bytes_come_back_in_order_with_their_places_large_ones_in_parts() {
        let dir = tempfile::tempdir().unwrap();
        let (path, disk): (_, Arc<dyn Disk>) = (dir.path().join("unit"), Arc::new(SystemDisk));
        let large: Vec<u8> = (0..PIECE_BYTES + 5).map(|i| (i % 253) as u8).collect();
        let pieces = [(7u64, &large[..]), (9, &[]), (1, &[1, 2, 3])];
        let mut file = UnitWriter::create(&path, 0, &disk).unwrap();
        let log = UnitLog::begin(&mut file, None);
        pieces.iter().for_each(|(place, bytes)| log.put(*place, bytes).unwrap());
        log.end(&"the end").unwrap();
        file.finish(true).unwrap();
        let open = |path: &Path| DiskFile::open(path, path.to_path_buf(), &disk).unwrap();
        let unit = UnitReader::open(&path, 0, open(&path), std::fs::metadata(&path).unwrap().len()).unwrap();
        let mut found: Vec<(u64, Vec<u8>)> = Vec::new();
        let put = |place: &u64, from: u64, bytes: &[u8]| {
            assert_eq!(from % 3, 0);
            match found.last_mut() {
                Some((last, all)) if last == place && from > 0 => all.extend_from_slice(bytes),
                _ => found.push((*place, bytes.to_vec())),
            }
            Ok(())
        };
        let came_to: String = put_back(&unit, 3, |_| true, put, |_, _| panic!("nothing is there")).unwrap();
        assert_eq!(came_to, "the end");
        assert_eq!(found, pieces.map(|(place, bytes)| (place, bytes.to_vec())));
        check::<u64, String>(&unit, None, |_| true).unwrap();
        assert!(check::<u64, String>(&unit, None, |_| false).is_err());
    }

    #[test]
    fn bytes_that_went_into_the_output_are_looked_for_there() {
        let dir = tempfile::tempdir().unwrap();
        let disk: Arc<dyn Disk> = Arc::new(SystemDisk);
        let [path, out] = ["unit", "out"].map(|name| dir.path().join(name));
        let out = DiskFile::create(&out, out.clone(), &disk).unwrap();
        let mut file = UnitWriter::create(&path, 0, &disk).unwrap();
        let kept = KeptFile { file: &out, start: 100 };
        let log = UnitLog::begin(&mut file, Some(&kept));
        log.put(7, &[1, 2, 3]).unwrap();
        log.put(50, &[]).unwrap();
        log.put(20, &[9; 30]).unwrap();
        log.end(&1u8).unwrap();
        file.finish(true).unwrap();
        let unit = DiskFile::open(&path, path.clone(), &disk).unwrap();
        let unit = UnitReader::open(&path, 0, unit, std::fs::metadata(&path).unwrap().len()).unwrap();
        let (mut found, put) = (Vec::new(), |_: &u64, _, _: &[u8]| panic!("its bytes are there"));
        let came_to: u8 = put_back(
            &unit,
            1,
            |_| true,
            put,
            |belong, at| {
                found.push((belong, at.offset, at.bytes));
            },
        )
        .unwrap();
        assert_eq!((came_to, found), (1, vec![(7, 7, 3), (50, 50, 0), (20, 20, 30)]));
        let check = |kept: Option<&dyn InPlace<u64>>| check::<u64, u8>(&unit, kept, |_| true);
        check(Some(&kept)).unwrap();
        assert!(check(None).is_err());
        assert!(check(Some(&KeptFile { start: 99, ..kept })).is_err());
        out.write_at(&[8], 125, "writing").unwrap();
        assert!(check(Some(&kept)).is_err());
    }
}
