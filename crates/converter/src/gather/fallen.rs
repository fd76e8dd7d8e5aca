//! Points that share a point of the lattice and are apart in the sources: what a coarse step costs beyond distances.

use crate::cloud::{Gathered, Segments, Store, StoredPoint, position};
use crate::error::ConvertError;
use crate::sources::MARK_BYTES;

/// Points that are sorted at once; a cell with more is looked at in so many passes over its records.
const AT_ONCE: u64 = 1 << 20;

/// A cell that would take more passes than this is not counted: it is a mass in few places.
const MOST_PASSES: u64 = 32;

/// Points that share their point of the lattice with another position of the sources; `None` if that is too dear to count.
/// `mark`: where a record has the mark that tells positions apart.
pub(super) fn count(gathered: &Gathered, mark: usize) -> Result<Option<u64>, ConvertError> {
    let mut points = 0;
    for cell in &gathered.cells {
        let passes = cell.points.div_ceil(AT_ONCE).max(1);
        if passes > MOST_PASSES {
            return Ok(None);
        }
        for pass in 0..passes {
            points += in_cell(&gathered.store, &cell.segments, gathered.frame.stride, mark, (pass, passes))?;
        }
    }
    Ok(Some(points))
}

/// The same of the places of a cell whose hash is `pass` of `passes`.
fn in_cell(
    store: &Store,
    segments: &Segments,
    stride: usize,
    mark: usize,
    (pass, passes): (u64, u64),
) -> Result<u64, ConvertError> {
    let (mut records, mut rows) = (Vec::new(), Vec::new());
    for segment in segments {
        records.clear();
        store.read(*segment, &mut records)?;
        for record in records.chunks_exact(stride) {
            let place = position(record);
            if passes == 1 || hash(place) % passes == pass {
                rows.push((place, mark_of(record, mark)));
            }
        }
    }
    rows.sort_unstable();
    let places = rows.chunk_by(|a, b| a.0 == b.0);
    let is_shared = |place: &&[(StoredPoint, u64)]| place.first().map(|p| p.1) != place.last().map(|p| p.1);
    Ok(places.filter(is_shared).map(|place| place.len() as u64).sum())
}

fn mark_of(record: &[u8], at: usize) -> u64 {
    record.get(at..at + MARK_BYTES).and_then(|bytes| bytes.try_into().ok()).map_or(0, u64::from_le_bytes)
}

fn hash(place: StoredPoint) -> u64 {
    place.0.iter().fold(0u64, |h, v| (h ^ *v as u32 as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(31))
}
