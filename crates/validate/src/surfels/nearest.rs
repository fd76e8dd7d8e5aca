//! The neighbourhood of one point, gathered from all points of a dataset in any order.

use std::collections::BTreeMap;

use super::moments::Moments;

/// Distances that differ by less than this of themselves may be taken for equal: the page compares their squares in single
/// precision, which is a tenth of it.
const TIE: f64 = 1e-6;

/// A place, and how far it is: bits of the square of the distance, which is not negative, ascend as it does. Of equally far ones
/// those with the smaller coordinates are first.
type Key = (u64, [i64; 3]);

/// What is known of a neighbourhood.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found {
    pub(super) moments: Moments,
    /// Distance of the farthest point of it, or that within which all belong to it, world units.
    pub(super) distance: f64,
    /// Least and greatest number of points of it, by what is taken for equally far.
    pub(super) points: [u64; 2],
    /// It is one of several that may be meant.
    pub(super) is_ambiguous: bool,
    /// It, or the least of those that may be meant, is one place.
    pub(super) may_be_one_place: bool,
}

/// The points nearest to one. Points of one place are one entry: which of them belong to the neighbourhood makes no difference.
///
/// Has one entry more than the neighbourhood, the first one beyond it.
#[derive(Debug, Clone)]
pub(super) struct Nearest {
    count: u64,
    places: BTreeMap<Key, u64>,
    total: u64,
    /// Square of the distance beyond which nothing is looked for.
    limit: f64,
}

/// Bytes of an entry, with what the nodes of a map have free.
pub(super) const ENTRY_BYTES: u64 = 96;

impl Nearest {
    /// For the `count` nearest points, none farther than the square root of `limit`.
    pub(super) fn new(count: usize, limit: f64) -> Self {
        Self { count: count as u64, places: BTreeMap::new(), total: 0, limit }
    }

    pub(super) fn limit(&self) -> f64 {
        self.limit
    }

    /// Takes in a point at the distance whose square is `squared`. `difference`: to the point that this is about.
    pub(super) fn offer(&mut self, squared: f64, difference: [i64; 3]) {
        if squared > self.limit {
            return;
        }
        *self.places.entry((squared.to_bits(), difference)).or_default() += 1;
        self.total += 1;
        loop {
            let mut from_last = self.places.iter().rev();
            let Some((last, beyond)) = from_last.next() else { return };
            let last = *last;
            if self.total - beyond < self.count {
                return;
            }
            let is_needed = from_last.next().is_none_or(|(_, own)| self.total - beyond - own < self.count);
            if is_needed {
                self.limit = self.limit.min(f64::from_bits(last.0));
                return;
            }
            self.total -= beyond;
            self.places.remove(&last);
        }
    }

    /// The neighbourhood, once all points were offered.
    pub(super) fn finish(&self) -> Found {
        let mut moments = Moments::default();
        let mut rest = self.count;
        let mut entries = self.places.iter().peekable();
        let mut before = None;
        let (mut distance, mut is_ambiguous) = (0.0, false);
        while rest > 0
            && let Some(((bits, difference), points)) = entries.next()
        {
            let taken = rest.min(*points);
            moments.add(*difference, taken);
            rest -= taken;
            let own = f64::from_bits(*bits).sqrt();
            let are_equal = |a: f64, b: f64| b - a <= TIE * b;
            if rest == 0 {
                let beyond = entries.peek().is_some_and(|((bits, _), _)| are_equal(own, f64::from_bits(*bits).sqrt()));
                let inside = taken < *points && before.is_some_and(|before| are_equal(before, own));
                is_ambiguous = beyond || inside;
            }
            before = Some(own);
            distance = own;
        }
        let may_be_one_place = moments.is_one_place();
        Found { points: [moments.points; 2], moments, distance, is_ambiguous, may_be_one_place }
    }
}

/// All points within a distance.
#[derive(Debug, Clone, Default)]
pub(super) struct Within {
    radius: f64,
    moments: Moments,
    /// Without those points that are so far away that they may be taken for being beyond.
    certain: Moments,
    /// Points beyond that may be taken for being within.
    beyond: u64,
}

impl Within {
    pub(super) fn new(radius: f64) -> Self {
        Self { radius, ..Self::default() }
    }

    /// Square of the distance beyond which nothing is looked for.
    pub(super) fn limit(&self) -> f64 {
        let most = self.radius * (1.0 + TIE);
        most * most
    }

    /// As [`Nearest::offer`].
    pub(super) fn offer(&mut self, squared: f64, difference: [i64; 3]) {
        if squared > self.limit() {
            return;
        }
        if squared.sqrt() < self.radius * (1.0 - TIE) {
            self.certain.add(difference, 1);
        }
        if squared <= self.radius * self.radius {
            self.moments.add(difference, 1);
        } else {
            self.beyond += 1;
        }
    }

    pub(super) fn finish(&self) -> Found {
        let points = [self.certain.points, self.moments.points + self.beyond];
        Found {
            moments: self.moments,
            distance: self.radius,
            points,
            is_ambiguous: points[0] != points[1],
            may_be_one_place: self.certain.is_one_place(),
        }
    }
}

/// A neighbourhood of either kind.
#[derive(Debug, Clone)]
pub(super) enum Neighbourhood {
    Nearest(Nearest),
    Within(Box<Within>),
}

impl Neighbourhood {
    pub(super) fn limit(&self) -> f64 {
        match self {
            Self::Nearest(nearest) => nearest.limit(),
            Self::Within(within) => within.limit(),
        }
    }

    pub(super) fn offer(&mut self, squared: f64, difference: [i64; 3]) {
        match self {
            Self::Nearest(nearest) => nearest.offer(squared, difference),
            Self::Within(within) => within.offer(squared, difference),
        }
    }

    pub(super) fn finish(&self) -> Found {
        match self {
            Self::Nearest(nearest) => nearest.finish(),
            Self::Within(within) => within.finish(),
        }
    }
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;

    fn squared(d: [i64; 3]) -> f64 {
        d.iter().map(|v| (v * v) as f64).sum()
    }

    fn points(reach: u64, count: usize) -> Vec<[i64; 3]> {
        let mut random = Random::new(5);
        let mut next = || random.below(2 * reach + 1) as i64 - reach as i64;
        (0..count).map(|_| [next(), next(), next()]).collect()
    }

    #[test]
    fn the_nearest_are_those_of_a_sort_of_all_whatever_their_order() {
        for (reach, count) in [(1000, 16), (1000, 3), (3, 16), (3, 200), (1000, 2000)] {
            let mut all = points(reach, 1500);
            let mut sorted = all.clone();
            sorted.sort_by(|a, b| squared(*a).total_cmp(&squared(*b)).then(a.cmp(b)));
            let mut expected = Moments::default();
            sorted.iter().take(count).for_each(|d| expected.add(*d, 1));
            let farthest = sorted[count.min(sorted.len()) - 1];
            for _ in 0..2 {
                let mut nearest = Nearest::new(count, f64::INFINITY);
                all.iter().for_each(|d| nearest.offer(squared(*d), *d));
                let found = nearest.finish();
                assert_eq!(found.moments, expected, "{reach} {count}");
                assert_eq!(found.distance, squared(farthest).sqrt());
                assert_eq!(found.points, [expected.points; 2]);
                assert!(nearest.places.len() <= count + 1 && nearest.limit() >= squared(farthest));
                all.reverse();
            }
        }
    }

    #[test]
    fn a_limit_that_enough_points_keep_changes_nothing() {
        let all = points(500, 1000);
        let gather = |limit: f64, all: &[[i64; 3]]| {
            let mut nearest = Nearest::new(16, limit);
            all.iter().for_each(|d| nearest.offer(squared(*d), *d));
            nearest
        };
        let some = gather(f64::INFINITY, &all[..200]);
        assert!(some.limit().is_finite());
        assert_eq!(gather(some.limit(), &all).finish(), gather(f64::INFINITY, &all).finish());
    }

    #[test]
    fn places_that_are_equally_far_leave_a_choice_and_points_of_one_place_do_not() {
        let of = |count: usize, all: &[[i64; 3]]| {
            let mut nearest = Nearest::new(count, f64::INFINITY);
            all.iter().for_each(|d| nearest.offer(squared(*d), *d));
            nearest.finish().is_ambiguous
        };
        assert!(of(2, &[[0; 3], [5, 0, 0], [0, 5, 0]]) && of(2, &[[0; 3], [3, 4, 0], [0, 5, 0]]));
        assert!(!of(3, &[[0; 3], [5, 0, 0], [0, 5, 0]]), "all of them");
        assert!(!of(2, &[[0; 3], [5, 0, 0], [5, 0, 0], [6, 0, 0]]), "one place");
        assert!(of(3, &[[0; 3], [-5, 0, 0], [5, 0, 0], [5, 0, 0]]), "a point of one place or the other");
        assert!(!of(2, &[[0; 3], [1_000_000, 0, 0], [1_000_002, 0, 0]]));
        assert!(of(2, &[[0; 3], [10_000_000, 0, 0], [10_000_002, 0, 0]]), "by less than single precision");
    }

    #[test]
    fn all_points_within_a_distance_are_a_neighbourhood() {
        let mut within = Within::new(5.0);
        for d in [[0; 3], [3, 3, 2], [4, 3, 1], [0, 0, 9]] {
            within.offer(squared(d), d);
        }
        let found = within.finish();
        assert_eq!((found.points, found.is_ambiguous, found.distance), ([2, 2], false, 5.0));
        within.offer(25.0, [3, 4, 0]);
        assert_eq!((within.finish().points, within.finish().is_ambiguous), ([2, 3], true));
        within.offer(25.000_001, [5, 0, 0]);
        assert_eq!((within.finish().points, within.finish().moments.points), ([2, 4], 3));
    }
}
