//! Places that very many points share: what scanners write where they measured nothing, or a transformation that lost
//! its points. They say nothing of a surface, so they are reported, and count once where density or distance decide.

use std::collections::HashMap;

use crate::cloud::{Gathered, JobBounds, Segments, SharedPlace, Store, StoredPoint, position};
use crate::error::ConvertError;

/// Fewer points than these are not very many, in whatever cloud.
const LEAST: u64 = 16;

/// Very many is at least one point in that many of the cloud.
const SHARE: u64 = 100;

/// Looks into the cells that could hold such a place, at most [`SHARE`] of them, and notes there what was found.
pub(super) fn find(gathered: &mut Gathered) -> Result<Vec<SharedPlace>, ConvertError> {
    let many = LEAST.max(gathered.stats.points.div_ceil(SHARE));
    let (stride, origin, lattice) = (gathered.frame.stride, gathered.frame.origin, gathered.lattice.lattice);
    let mut shared = Vec::new();
    for cell in gathered.cells.iter_mut().filter(|cell| cell.points >= many) {
        let look = Look { store: &gathered.store, stride, segments: &cell.segments };
        let (candidates, [min, max]) = look.candidates(cell.points.div_ceil(many) as usize)?;
        let bounds = JobBounds { min: origin.job(min), max: origin.job(max) };
        let places = look.count(candidates)?;
        for (place, points) in places.into_iter().filter(|(_, points)| *points >= many) {
            cell.repeats += points - 1;
            shared.push(SharedPlace { position: lattice.world(origin.job(place).0), points });
        }
        cell.is_one_place = bounds.min == bounds.max;
        cell.bounds = Some(bounds);
    }
    let bits = |place: &SharedPlace| place.position.map(f64::to_bits);
    shared.sort_by(|a, b| b.points.cmp(&a.points).then_with(|| bits(a).cmp(&bits(b))));
    Ok(shared)
}

/// True if so many of the points of scans with poses lie at their origins that it should be said.
pub(super) fn are_many_at_origin(points: u64, of: u64) -> bool {
    points > 0 && (points >= SHARE || points * SHARE >= of)
}

/// The records of a cell.
struct Look<'a> {
    store: &'a Store,
    stride: usize,
    segments: &'a Segments,
}

impl Look<'_> {
    fn each(&self, mut work: impl FnMut(StoredPoint)) -> Result<(), ConvertError> {
        let mut records = Vec::new();
        for segment in self.segments {
            records.clear();
            self.store.read(*segment, &mut records)?;
            records.chunks_exact(self.stride).for_each(|record| work(position(record)));
        }
        Ok(())
    }

    /// At most `most` places, among them every one that at least one point in `most` has, whatever their order (Misra and
    /// Gries: a point of another place takes one from each). And the extremes of all.
    fn candidates(&self, most: usize) -> Result<(HashMap<StoredPoint, u64>, [StoredPoint; 2]), ConvertError> {
        let mut counts: HashMap<StoredPoint, u64> = HashMap::new();
        let (mut min, mut max) = (StoredPoint([i32::MAX; 3]), StoredPoint([i32::MIN; 3]));
        self.each(|place| {
            for a in 0..3 {
                min[a] = min[a].min(place[a]);
                max[a] = max[a].max(place[a]);
            }
            if let Some(count) = counts.get_mut(&place) {
                *count += 1;
            } else if counts.len() < most {
                counts.insert(place, 1);
            } else {
                counts.retain(|_, count| {
                    *count -= 1;
                    *count > 0
                });
            }
        })?;
        Ok((counts, [min, max]))
    }

    /// How many points each of the places has.
    fn count(&self, mut places: HashMap<StoredPoint, u64>) -> Result<HashMap<StoredPoint, u64>, ConvertError> {
        places.values_mut().for_each(|count| *count = 0);
        if !places.is_empty() {
            self.each(|place| {
                if let Some(count) = places.get_mut(&place) {
                    *count += 1;
                }
            })?;
        }
        Ok(places)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::Segment;
    use crate::runtime::{SystemDisk, TempFiles};
    use std::sync::Arc;

    #[test]
    fn places_that_many_share_are_found_in_any_order_and_counted_exactly() {
        let dir = tempfile::tempdir().unwrap();
        let temp = TempFiles::new(dir.path().to_path_buf(), Arc::new(SystemDisk));
        let store = Store::new(temp, 12, 1, 1 << 20);
        let mut places: Vec<i32> = (0..9_000).collect();
        places.extend([-7; 500]);
        places.extend([-8; 499]);
        let mut found = Vec::new();
        for order in 0..3 {
            match order {
                0 => places.sort_unstable(),
                1 => places.reverse(),
                _ => places.sort_unstable_by_key(|p| p.wrapping_mul(0x9e37_79b1u32 as i32)),
            }
            let block = store.open(0).unwrap();
            let mut records: Vec<u8> = places.iter().flat_map(|x| [*x, 1, 2]).flat_map(i32::to_le_bytes).collect();
            store.fill(block, &mut records).unwrap();
            let mut segments = Segments::default();
            segments.push(Segment { block, start: 0, count: places.len() as u32 });
            let look = Look { store: &store, stride: 12, segments: &segments };
            let (candidates, extremes) = look.candidates(20).unwrap();
            assert_eq!(extremes, [StoredPoint([-8, 1, 2]), StoredPoint([8_999, 1, 2])]);
            let mut counts: Vec<_> = look.count(candidates).unwrap().into_iter().filter(|(_, n)| *n >= 499).collect();
            counts.sort_unstable();
            found.push(counts);
        }
        let expected = vec![(StoredPoint([-8, 1, 2]), 499), (StoredPoint([-7, 1, 2]), 500)];
        assert_eq!(found, [expected.clone(), expected.clone(), expected]);
    }
}
