//! Places that very many points share: what scanners write where they measured nothing, or a transformation that lost
//! its points. They say nothing of a surface, so they are reported, and count once where density or distance decide.

use std::collections::HashMap;

use crate::cloud::{Cell, Gathered, SharedPlace, Store, StoredPoint, position};
use crate::error::ConvertError;

/// Fewer points than these are not very many, in whatever cloud.
const LEAST: u64 = 16;

/// Very many is at least one point in that many of the cloud.
const SHARE: u64 = 100;

/// Records of a cell that are looked at first.
const SAMPLE: u64 = 4096;

/// Finds the places and notes in their cells how many points repeat one.
///
/// Only cells that could hold such a place are looked at, at most [`SHARE`] of them, and read in full only if a sample
/// shows one.
pub(super) fn find(gathered: &mut Gathered) -> Result<Vec<SharedPlace>, ConvertError> {
    let many = LEAST.max(gathered.stats.points.div_ceil(SHARE));
    let (stride, origin, lattice) = (gathered.frame.stride, gathered.frame.origin, gathered.lattice.lattice);
    let mut shared = Vec::new();
    for cell in gathered.cells.iter_mut().filter(|cell| cell.points >= many) {
        for (place, points) in crowded(&gathered.store, stride, cell, many)? {
            cell.repeats += points - 1;
            cell.is_one_place = points == cell.points;
            shared.push(SharedPlace { position: lattice.world(origin.job(place).0), points });
        }
    }
    shared.sort_by(|a, b| {
        b.points.cmp(&a.points).then_with(|| a.position.map(f64::to_bits).cmp(&b.position.map(f64::to_bits)))
    });
    Ok(shared)
}

/// True if so many of the points of scans with poses lie at their origins that it should be said.
pub(super) fn are_many_at_origin(points: u64, of: u64) -> bool {
    points > 0 && (points >= SHARE || points * SHARE >= of)
}

/// The places of a cell that at least `many` points share, with their numbers of points.
fn crowded(store: &Store, stride: usize, cell: &Cell, many: u64) -> Result<Vec<(StoredPoint, u64)>, ConvertError> {
    // In a sample of n / step points a place of `many` has many / step on average; half of them are enough of a sign.
    let step = (cell.points / SAMPLE).max(1);
    let sign = (many / step / 2).max(2);
    let mut counts: HashMap<StoredPoint, u64> = HashMap::new();
    let (mut records, mut next) = (Vec::new(), 0);
    for segment in &cell.segments {
        while next < u64::from(segment.count) {
            records.clear();
            store.read(segment.one(next as u32), &mut records)?;
            *counts.entry(position(&records)).or_default() += 1;
            next += step;
        }
        next -= u64::from(segment.count);
    }
    counts.retain(|_, count| *count >= sign);
    if counts.is_empty() {
        return Ok(Vec::new());
    }
    counts.values_mut().for_each(|count| *count = 0);
    for segment in &cell.segments {
        records.clear();
        store.read(*segment, &mut records)?;
        for record in records.chunks_exact(stride) {
            if let Some(count) = counts.get_mut(&position(record)) {
                *count += 1;
            }
        }
    }
    Ok(counts.into_iter().filter(|(_, count)| *count >= many).collect())
}
