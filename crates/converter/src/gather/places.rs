//! Places that very many points share: what scanners write where they measured nothing, or a transformation that lost
//! its points. They say nothing of a surface, so they are reported, and count once where density or distance decide.

use std::collections::HashMap;

use crate::cloud::{
    Cell, Census, CensusCell, Gathered, JobBounds, RecordFrame, SharedPlace, Store, StoredPoint, TREE_BITS, position,
    xyz,
};
use crate::error::ConvertError;

/// Fewer points than these are not very many, in whatever cloud.
const LEAST: u64 = 16;

/// Records that are looked at together.
const PIECE_POINTS: u32 = 1 << 14;

/// Very many is at least one point in that many of the cloud.
const SHARE: u64 = 100;

/// Looks into the cells that could hold such a place, at most [`SHARE`] of them, and notes there what was found.
pub(super) fn find(gathered: &mut Gathered) -> Result<Vec<SharedPlace>, ConvertError> {
    let many = LEAST.max(gathered.stats.points.div_ceil(SHARE));
    let Gathered { frame, store, cells, census, lattice, .. } = gathered;
    let (origin, lattice) = (frame.origin, lattice.lattice);
    let mut shared = Vec::new();
    let Census { cells: counted, bounds } = census;
    let mut rest = &mut counted[..];
    for stored in cells.iter() {
        let inside = rest.iter().take_while(|cell| cell.key.ancestor(stored.key.level) == Some(stored.key)).count();
        let (mine, others) = std::mem::take(&mut rest).split_at_mut(inside);
        rest = others;
        let mut full: Vec<&mut CensusCell> = mine.iter_mut().filter(|cell| cell.points >= many).collect();
        if full.is_empty() {
            continue;
        }
        let look = Look { store, frame, stored, level: full[0].key.level };
        let mut tallies: Vec<Tally> = full.iter().map(|cell| Tally::new(cell, many)).collect();
        look.each(&full, |i, place| tallies[i].offer(place))?;
        tallies.iter_mut().for_each(Tally::begin_to_count);
        look.each(&full, |i, place| tallies[i].count(place))?;
        for (cell, tally) in full.iter_mut().zip(tallies) {
            for (place, points) in tally.places.into_iter().filter(|(_, points)| *points >= many) {
                cell.repeats += points - 1;
                shared.push(SharedPlace { position: lattice.world(origin.job(place).0), points });
            }
            bounds.insert(cell.key, JobBounds { min: origin.job(tally.min), max: origin.job(tally.max) });
        }
    }
    let bits = |place: &SharedPlace| place.position.map(f64::to_bits);
    shared.sort_by(|a, b| b.points.cmp(&a.points).then_with(|| bits(a).cmp(&bits(b))));
    Ok(shared)
}

/// True if so many of the points of scans with poses lie at their origins that it should be said.
pub(super) fn are_many_at_origin(points: u64, of: u64) -> bool {
    points > 0 && (points >= SHARE || points * SHARE >= of)
}

/// The records of a stored cell, and the level of the cells of the census in it.
struct Look<'a> {
    store: &'a Store,
    frame: &'a RecordFrame,
    stored: &'a Cell,
    level: u8,
}

impl Look<'_> {
    /// Every record that lies in one of the cells, and in which.
    fn each(&self, cells: &[&mut CensusCell], mut work: impl FnMut(usize, StoredPoint)) -> Result<(), ConvertError> {
        let is_whole = matches!(cells, [only] if only.points == self.stored.points);
        let shift = TREE_BITS - u32::from(self.level);
        let by_cell: HashMap<[u32; 3], usize> = cells.iter().enumerate().map(|(i, cell)| (xyz(cell.key), i)).collect();
        let cell_of = |record: &[u8]| by_cell.get(&self.frame.tree(record).cell(shift)).copied();
        let mut records = Vec::new();
        for segment in self.stored.segments.iter().flat_map(|s| s.split(PIECE_POINTS)) {
            records.clear();
            self.store.read(segment, &mut records)?;
            for record in records.chunks_exact(self.frame.stride) {
                if let Some(cell) = if is_whole { Some(0) } else { cell_of(record) } {
                    work(cell, position(record));
                }
            }
        }
        Ok(())
    }
}

/// What is known of the places of a cell: candidates first, then how many points each of them has.
struct Tally {
    /// At most as many candidates.
    most: usize,
    places: HashMap<StoredPoint, u64>,
    min: StoredPoint,
    max: StoredPoint,
}

impl Tally {
    /// For the places of a cell that `many` points share.
    fn new(cell: &CensusCell, many: u64) -> Self {
        let (min, max) = (StoredPoint([i32::MAX; 3]), StoredPoint([i32::MIN; 3]));
        Self { most: cell.points.div_ceil(many) as usize, places: HashMap::new(), min, max }
    }

    /// Among the candidates is every place that at least one point in `most` has, whatever their order (Misra and Gries:
    /// a point of another place takes one from each).
    fn offer(&mut self, place: StoredPoint) {
        for a in 0..3 {
            self.min[a] = self.min[a].min(place[a]);
            self.max[a] = self.max[a].max(place[a]);
        }
        if let Some(count) = self.places.get_mut(&place) {
            *count += 1;
        } else if self.places.len() < self.most {
            self.places.insert(place, 1);
        } else {
            self.places.retain(|_, count| {
                *count -= 1;
                *count > 0
            });
        }
    }

    fn begin_to_count(&mut self) {
        self.places.values_mut().for_each(|count| *count = 0);
    }

    fn count(&mut self, place: StoredPoint) {
        if let Some(count) = self.places.get_mut(&place) {
            *count += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pointmill_format::NodeKey;

    #[test]
    fn places_that_many_share_are_found_in_any_order_and_counted_exactly() {
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
            let cell = CensusCell { key: NodeKey::ROOT, points: places.len() as u64, repeats: 0 };
            let mut tally = Tally::new(&cell, 499);
            let at = |x: &i32| StoredPoint([*x, 1, 2]);
            places.iter().for_each(|x| tally.offer(at(x)));
            assert_eq!((tally.min, tally.max), (StoredPoint([-8, 1, 2]), StoredPoint([8_999, 1, 2])));
            tally.begin_to_count();
            places.iter().for_each(|x| tally.count(at(x)));
            let mut counts: Vec<_> = tally.places.into_iter().filter(|(_, n)| *n >= 499).collect();
            counts.sort_unstable();
            found.push(counts);
        }
        let expected = vec![(StoredPoint([-8, 1, 2]), 499), (StoredPoint([-7, 1, 2]), 500)];
        assert_eq!(found, [expected.clone(), expected.clone(), expected]);
    }
}
