//! Some points of scans.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

use pointmill_format::{OpenOptions, ReadError, Scratch, Wanted};

use super::{Sample, UNITS, WANTED, spread};
use crate::sources::{Points, ScanFile};
use crate::workers;

/// Scans in fewer pieces are read to their end: some pieces would not show where the others are.
const MANY_PIECES: usize = 32;

/// Every nth point of every piece, or of some pieces of scans that have many. Their declared bounds count where they are not
/// beyond what was seen.
///
/// # Errors
/// Those of reading the scans.
pub(crate) fn of_scans(files: &[ScanFile], options: &OpenOptions, threads: usize) -> Result<Sample, ReadError> {
    let total = files.iter().map(|file| file.points).sum::<u64>();
    let pieces = files.iter().map(|file| file.pieces).sum::<usize>();
    let (read, is_part) =
        if pieces >= MANY_PIECES && files.len() < UNITS { (UNITS.min(pieces), true) } else { (pieces, false) };
    let expected = total.saturating_mul(read as u64) / pieces.max(1) as u64;
    let step = usize::try_from(expected.div_ceil(WANTED as u64)).unwrap_or(usize::MAX).max(1);
    let units = units(files, is_part);
    let found: Mutex<Vec<(usize, Vec<[f64; 3]>)>> = Mutex::default();
    workers::for_each(units.len(), threads, |unit, scratch: &mut Scratch| {
        let Some((file, pieces)) = units.get(unit) else { return Ok(()) };
        let mut positions = Vec::new();
        file.with(options, |scan| {
            let wanted = Wanted::positions(scan.info());
            let all = 0..scan.pieces().len();
            for piece in pieces.map_or(all, |piece| piece..piece + 1) {
                scan.decode(piece, &wanted, scratch, &mut |batch| {
                    let points = Points::of_batch(batch, scan.info().lattice);
                    positions.extend((0..points.len()).step_by(step).filter_map(|i| points.world(i)));
                    ControlFlow::Continue(())
                })?;
            }
            Ok(())
        })?;
        found.lock().unwrap_or_else(PoisonError::into_inner).push((unit, positions));
        Ok::<(), ReadError>(())
    })?;
    let mut found = found.into_inner().unwrap_or_else(PoisonError::into_inner);
    found.sort_unstable_by_key(|(unit, _)| *unit);
    let positions: Vec<[f64; 3]> = found.into_iter().flat_map(|(_, positions)| positions).collect();
    let declared = files
        .iter()
        .map(|file| file.bounds)
        .try_fold(pointmill_format::Aabb::EMPTY, |all, one| one.map(|one| all.union(&one)));
    Ok(Sample::new(positions, declared.filter(|_| is_part)))
}

/// Files, each with a piece or whole.
fn units(files: &[ScanFile], is_part: bool) -> Vec<(&ScanFile, Option<usize>)> {
    let stay_open = files.iter().all(|file| file.is_open());
    if !stay_open {
        return files.iter().map(|file| (file, None)).collect();
    }
    let pieces: Vec<_> = files.iter().flat_map(|file| (0..file.pieces).map(move |piece| (file, Some(piece)))).collect();
    if is_part { spread(pieces.len()).filter_map(|i| pieces.get(i).copied()).collect() } else { pieces }
}
