//! The points around some that lie close together, gathered once for all of them.

use super::boxes::{Box3, Boxes, Waiting};
use super::collect::Collect;
use super::runs::{Lookup, Others};
use super::space::{Space, between, outside, squared};
use crate::error::ConvertError;
use crate::runtime::{Compare, LANES};

/// Points of a leaf of the hierarchy over a unit: two vectors of single precision.
pub(super) const LEAF_POINTS: usize = 16;

/// Points of which a neighbourhood of one point is chosen, for each of them.
const PER_NEIGHBOUR: usize = 12;

/// The least that there is room for.
const LEAST_ROOM: usize = 512;

/// The most: indices have 16 bits, and cheaper than so many is the hierarchy.
const MOST_ROOM: usize = 16_384;

/// All points within a distance of a box: of any point of the box those within that distance are among them.
pub(super) struct Around {
    columns: [Vec<[i32; LANES]>; 3],
    count: usize,
    room: usize,
    /// Squares of distances from the point whose neighbourhood is put together.
    squared: Vec<[f32; LANES]>,
    /// Indices of those that are near enough.
    near: Vec<u16>,
}

/// Where points come from: those of the unit, and others.
pub(super) struct Places<'a> {
    pub(super) columns: [&'a [i32]; 3],
    pub(super) leaves: &'a Boxes,
    pub(super) others: Option<Others<'a>>,
    pub(super) space: &'a Space,
}

/// The points of a leaf.
#[inline(always)]
pub(super) fn leaf(columns: [&[i32]; 3], i: usize) -> [&[i32]; 3] {
    let first = i * LEAF_POINTS;
    columns.map(|axis| &axis[first..(first + LEAF_POINTS).min(axis.len())])
}

impl Around {
    /// For neighbourhoods of so many points, where that is known.
    pub(super) fn new(neighbours: Option<usize>) -> Self {
        let room = neighbours.map_or(MOST_ROOM, |count| (PER_NEIGHBOUR * count).clamp(LEAST_ROOM, MOST_ROOM));
        let vectors = room.div_ceil(LANES) + 1;
        Self {
            columns: [(); 3].map(|()| vec![[0; LANES]; vectors]),
            count: 0,
            room,
            squared: vec![[0.0; LANES]; vectors],
            near: vec![0; (vectors + 1) * LANES],
        }
    }

    /// Gathers all points within the square of a distance of a box. False: there are more than it is worth.
    #[inline(always)]
    pub(super) fn gather(
        &mut self,
        lanes: impl Compare,
        of: Box3,
        within: f32,
        places: &Places<'_>,
        stack: &mut Vec<Waiting>,
        lookup: &mut Lookup,
    ) -> Result<bool, ConvertError> {
        let space = places.space;
        self.count = 0;
        let mut near = places.leaves.near(of, space, &(0..0), stack);
        while let Some(found) = near.next(lanes, within) {
            if !self.add(lanes, &of, within, leaf(places.columns, found as usize), space) {
                return Ok(false);
            }
        }
        let Some(Others { runs, unit }) = places.others else { return Ok(true) };
        let own = runs.of(unit);
        let mut near = runs.boxes.near(of, space, &own, stack);
        while let Some(run) = near.next(lanes, within) {
            if !own.contains(&run) && !self.add(lanes, &of, within, lookup.columns(runs, run)?, space) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Adds those of some points that are near enough; false if there is no more room.
    #[inline(always)]
    fn add(&mut self, lanes: impl Compare, of: &Box3, within: f32, [x, y, z]: [&[i32]; 3], space: &Space) -> bool {
        let distance =
            |place: [i32; 3]| squared([0, 1, 2].map(|a| outside(place[a], of.min[a], of.max[a])), space.scale);
        let mut columns = self.columns.each_mut().map(|axis| axis.as_flattened_mut());
        let mut put = |at: usize, place: [i32; 3]| columns.iter_mut().zip(place).for_each(|(axis, v)| axis[at] = v);
        let ((xs, x_rest), (ys, y_rest), (zs, z_rest)) =
            (x.as_chunks::<LANES>(), y.as_chunks::<LANES>(), z.as_chunks::<LANES>());
        for ((x, y), z) in xs.iter().zip(ys).zip(zs) {
            let distances = std::array::from_fn(|i| distance([x[i], y[i], z[i]]));
            let mut hits = lanes.at_most(&distances, within);
            if self.count + hits.count_ones() as usize > self.room {
                return false;
            }
            while hits != 0 {
                let i = hits.trailing_zeros() as usize % LANES;
                hits &= hits - 1;
                put(self.count, [x[i], y[i], z[i]]);
                self.count += 1;
            }
        }
        for ((x, y), z) in x_rest.iter().zip(y_rest).zip(z_rest) {
            if distance([*x, *y, *z]) <= within {
                if self.count == self.room {
                    return false;
                }
                put(self.count, [*x, *y, *z]);
                self.count += 1;
            }
        }
        true
    }

    /// Offers those within the bound of a neighbourhood, which must not be more than was gathered.
    #[inline(always)]
    pub(super) fn offer_all(&mut self, lanes: impl Compare, q: [i32; 3], space: &Space, collect: &mut impl Collect) {
        let bound = collect.bound();
        let mut near = 0;
        let vectors = self.count.div_ceil(LANES);
        let [xs, ys, zs] = self.columns.each_ref().map(|axis| &axis[..vectors]);
        for (v, (((x, y), z), out)) in xs.iter().zip(ys).zip(zs).zip(&mut self.squared[..vectors]).enumerate() {
            *out = std::array::from_fn(|i| {
                squared([between(x[i], q[0]), between(y[i], q[1]), between(z[i], q[2])], space.scale)
            });
            let mut hits = lanes.at_most(out, bound);
            if v + 1 == vectors {
                hits &= (1u32 << (self.count - v * LANES)) - 1;
            }
            let row = POSITIONS[hits as usize % POSITIONS.len()].map(|i| i + (v * LANES) as u16);
            self.near[near..near + LANES].copy_from_slice(&row);
            near += hits.count_ones() as usize;
        }
        let [xs, ys, zs] = self.columns.each_ref().map(|axis| axis.as_flattened());
        let squares = self.squared.as_flattened();
        for &i in &self.near[..near] {
            let i = usize::from(i);
            if squares[i] <= collect.bound() {
                collect.offer(lanes, squares[i], [xs[i], ys[i], zs[i]]);
            }
        }
    }
}

/// By set of eight bits: the positions of those that are set, first.
static POSITIONS: [[u16; LANES]; 1 << LANES] = {
    let mut all = [[0; LANES]; 1 << LANES];
    let mut set = 0;
    while set < all.len() {
        let (mut bit, mut next) = (0, 0);
        while bit < LANES {
            if set >> bit & 1 == 1 {
                all[set][next] = bit as u16;
                next += 1;
            }
            bit += 1;
        }
        set += 1;
    }
    all
};

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;
    use crate::derive::surface::Surface;
    use crate::runtime::Portable;

    /// Keeps what it is offered.
    struct Offered(f32, Vec<[i32; 3]>);

    impl Collect for Offered {
        fn gathered(&self) -> Option<f32> {
            Some(self.0)
        }

        fn expected(&self, _: Option<f32>) -> f32 {
            self.0
        }

        fn begin_within(&mut self, _: [i32; 3], within: f32) {
            *self = Self(within, Vec::new());
        }

        fn is_complete(&self) -> bool {
            true
        }

        fn begin(&mut self, _: [i32; 3], _: Option<f32>) {}

        fn bound(&self) -> f32 {
            self.0
        }

        fn offer(&mut self, _: impl Compare, _: f32, place: [i32; 3]) {
            self.1.push(place);
        }

        fn surface(&mut self, _: &Space) -> Surface {
            Surface::default()
        }
    }

    #[test]
    fn all_points_around_are_offered_and_no_others_or_there_is_no_room() {
        let mut random = Random::new(12);
        let space = Space::new([0.01, 0.02, 0.01]);
        let (mut stack, mut lookup) = (Vec::new(), Lookup::new());
        let mut around = Around::new(Some(3));
        let mut offered = Offered(0.0, Vec::new());
        let (mut without_room, mut most) = (0, 0);
        for points in [1usize, 7, 16, 17, 100, 3000] {
            let columns: [Vec<i32>; 3] = [(); 3].map(|()| (0..points).map(|_| random.below(200) as i32).collect());
            let columns = columns.each_ref().map(Vec::as_slice);
            let all = || (0..points).map(|i| columns.map(|axis| axis[i]));
            let mut leaves = Boxes::default();
            leaves.build((0..points.div_ceil(LEAF_POINTS)).map(|i| Box3::of(leaf(columns, i))));
            let places = Places { columns, leaves: &leaves, others: None, space: &space };
            for _ in 0..60 {
                let min: [i32; 3] = std::array::from_fn(|_| random.below(200) as i32);
                let some = Box3 { min, max: min.map(|v| v + random.below(20) as i32) };
                let within = random.below(6000) as f32;
                let near = |of: Box3, within: f32| {
                    let outside = move |p: &[i32; 3]| [0, 1, 2].map(|a| outside(p[a], of.min[a], of.max[a]));
                    let mut found: Vec<_> = all().filter(|p| squared(outside(p), space.scale) <= within).collect();
                    found.sort_unstable();
                    found
                };
                let expected = near(some, within).len();
                let is_all = around.gather(Portable, some, within, &places, &mut stack, &mut lookup).unwrap();
                assert_eq!(is_all, expected <= LEAST_ROOM, "{expected} points");
                if !is_all {
                    without_room += 1;
                    continue;
                }
                assert_eq!(around.count, expected);
                most = most.max(expected);
                let q = [0, 1, 2].map(|a| min[a] + random.below((some.max[a] - min[a]) as u64 + 1) as i32);
                for within in [within, within / 2.0, 0.0] {
                    offered.begin_within(q, within);
                    around.offer_all(Portable, q, &space, &mut offered);
                    offered.1.sort_unstable();
                    assert_eq!(offered.1, near(Box3::at(q), within));
                }
            }
        }
        assert!(without_room > 5 && most > LEAST_ROOM / 2, "{without_room}, {most}");
    }
}
