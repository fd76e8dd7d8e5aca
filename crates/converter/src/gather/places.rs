//! Places that very many points share: what scanners write where they measured nothing, or a transformation that lost
//! its points. They say nothing of a surface, so they are reported, and count once where density or distance decide.

use std::collections::HashMap;

use crate::cloud::{
    Cell, CellHash, Census, CensusCell, Gathered, JobBounds, RecordFrame, SharedPlace, Store, StoredPoint, TREE_BITS,
    position, xyz,
};
use crate::error::ConvertError;
use crate::runtime::Runtime;

/// Fewer points than these are not very many, in whatever cloud.
const LEAST: u64 = 16;

/// Records that are looked at together.
const PIECE_POINTS: u32 = 1 << 14;

/// Very many is at least one point in that many of the cloud.
const SHARE: u64 = 100;

/// Looks into the cells that could hold such a place, at most [`SHARE`] of them, and notes there what was found.
pub(super) fn find(gathered: &mut Gathered, rt: &Runtime<'_>) -> Result<Vec<SharedPlace>, ConvertError> {
    let many = LEAST.max(gathered.stats.points.div_ceil(SHARE));
    let Gathered { frame, store, cells, census, lattice, .. } = gathered;
    let (origin, lattice) = (frame.origin, lattice.lattice);
    let Census { cells: counted, bounds } = census;
    let looks = looks(cells, counted, many);
    let found = rt.in_parallel(
        looks.len(),
        Vec::new,
        |found, i| {
            found.extend(tallied(&looks[i], store, frame, many)?);
            Ok(())
        },
        |found| found,
    )?;
    let mut shared = Vec::new();
    for (cell, tally) in found.into_iter().flatten() {
        let cell = &mut counted[cell];
        for (place, points) in tally.places.into_iter().filter(|(_, points)| *points >= many) {
            cell.repeats += points - 1;
            shared.push(SharedPlace { position: lattice.world(origin.job(place.point()).0), points });
        }
        bounds.insert(cell.key, JobBounds { min: origin.job(tally.min), max: origin.job(tally.max) });
    }
    let bits = |place: &SharedPlace| place.position.map(f64::to_bits);
    shared.sort_by(|a, b| b.points.cmp(&a.points).then_with(|| bits(a).cmp(&bits(b))));
    Ok(shared)
}

/// True if so many of the points of scans with poses lie at their origins that it should be said.
pub(super) fn are_many_at_origin(points: u64, of: u64) -> bool {
    points > 0 && (points >= SHARE || points * SHARE >= of)
}

/// A stored cell, and the cells of the census in it that are full enough, with their indices.
struct Look<'a> {
    stored: &'a Cell,
    full: Vec<(usize, CensusCell)>,
}

/// Both are in Morton order; a cell of the census lies in a stored cell, whole.
fn looks<'a>(cells: &'a [Cell], counted: &[CensusCell], many: u64) -> Vec<Look<'a>> {
    let (mut looks, mut at) = (Vec::new(), 0);
    for stored in cells {
        let is_inside = |cell: &&CensusCell| cell.key.ancestor(stored.key.level) == Some(stored.key);
        let inside = counted[at..].iter().take_while(is_inside).count();
        let full: Vec<_> = (at..at + inside).map(|i| (i, counted[i])).filter(|(_, cell)| cell.points >= many).collect();
        at += inside;
        looks.extend((!full.is_empty()).then_some(Look { stored, full }));
    }
    looks
}

/// How many points the places of each cell have that very many could share.
fn tallied(
    look: &Look<'_>,
    store: &Store,
    frame: &RecordFrame,
    many: u64,
) -> Result<impl Iterator<Item = (usize, Tally)>, ConvertError> {
    let mut tallies: Vec<Tally> = look.full.iter().map(|(_, cell)| Tally::new(cell, many)).collect();
    look.each(store, frame, |i, place| tallies[i].offer(place))?;
    tallies.iter_mut().for_each(Tally::begin_to_count);
    look.each(store, frame, |i, place| tallies[i].count(place))?;
    let indices: Vec<usize> = look.full.iter().map(|(i, _)| *i).collect();
    Ok(indices.into_iter().zip(tallies))
}

impl Look<'_> {
    /// Every record that lies in one of the cells, and in which.
    fn each(
        &self,
        store: &Store,
        frame: &RecordFrame,
        mut work: impl FnMut(usize, StoredPoint),
    ) -> Result<(), ConvertError> {
        let Self { stored, full } = self;
        let is_whole = matches!(full.as_slice(), [(_, only)] if only.points == stored.points);
        let by_cell: HashMap<[u32; 3], usize> = full.iter().enumerate().map(|(i, (_, c))| (xyz(c.key), i)).collect();
        let shift = TREE_BITS - full.first().map_or(0, |(_, cell)| u32::from(cell.key.level));
        let cell_of = |record: &[u8]| by_cell.get(&frame.tree(record).cell(shift)).copied();
        let mut records = Vec::new();
        for segment in stored.segments.iter().flat_map(|s| s.split(PIECE_POINTS)) {
            records.clear();
            store.read(segment, &mut records)?;
            for record in records.chunks_exact(frame.stride) {
                if let Some(cell) = if is_whole { Some(0) } else { cell_of(record) } {
                    work(cell, position(record));
                }
            }
        }
        Ok(())
    }
}

/// A position as a key that is hashed at once. A map of a [`Tally`] has few of them, whatever their values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Place(u64, u32);

impl Place {
    fn new(StoredPoint([x, y, z]): StoredPoint) -> Self {
        Self(u64::from(x.cast_unsigned()) << 32 | u64::from(y.cast_unsigned()), z.cast_unsigned())
    }

    fn point(self) -> StoredPoint {
        let Self(xy, z) = self;
        StoredPoint([((xy >> 32) as u32).cast_signed(), (xy as u32).cast_signed(), z.cast_signed()])
    }
}

impl std::hash::Hash for Place {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        state.write_u64(self.0);
        state.write_u64(u64::from(self.1));
    }
}

/// What is known of the places of a cell: candidates first, then how many points each of them has.
struct Tally {
    /// At most as many candidates.
    most: usize,
    places: HashMap<Place, u64, CellHash>,
    min: StoredPoint,
    max: StoredPoint,
}

impl Tally {
    /// For the places of a cell that `many` points share.
    fn new(cell: &CensusCell, many: u64) -> Self {
        let (min, max) = (StoredPoint([i32::MAX; 3]), StoredPoint([i32::MIN; 3]));
        Self { most: cell.points.div_ceil(many) as usize, places: HashMap::default(), min, max }
    }

    /// Among the candidates is every place that at least one point in `most` has, whatever their order (Misra and Gries:
    /// a point of another place takes one from each).
    fn offer(&mut self, place: StoredPoint) {
        for a in 0..3 {
            self.min[a] = self.min[a].min(place[a]);
            self.max[a] = self.max[a].max(place[a]);
        }
        let place = Place::new(place);
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
        if let Some(count) = self.places.get_mut(&Place::new(place)) {
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
            let counts = tally.places.into_iter().filter(|(_, n)| *n >= 499);
            let mut counts: Vec<_> = counts.map(|(place, n)| (place.point(), n)).collect();
            counts.sort_unstable();
            found.push(counts);
        }
        let expected = vec![(StoredPoint([-8, 1, 2]), 499), (StoredPoint([-7, 1, 2]), 500)];
        assert_eq!(found, [expected.clone(), expected.clone(), expected]);
    }
}
