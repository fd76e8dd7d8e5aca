//! A hierarchy of boxes over runs of points: which runs can hold a point that is near enough.

use std::ops::Range;

use super::space::{Space, apart, squared};
use crate::runtime::{Compare, LANES};

/// Children of a node.
const WIDTH: usize = LANES;

/// The box of some points, closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Box3 {
    pub(super) min: [i32; 3],
    pub(super) max: [i32; 3],
}

impl Box3 {
    const EMPTY: Self = Self { min: [i32::MAX; 3], max: [i32::MIN; 3] };

    /// Of one place.
    #[inline(always)]
    pub(super) fn at(place: [i32; 3]) -> Self {
        Self { min: place, max: place }
    }

    /// Of points whose coordinates are in columns.
    pub(super) fn of([x, y, z]: [&[i32]; 3]) -> Self {
        let ends = |axis: &[i32]| axis.iter().fold((i32::MAX, i32::MIN), |(min, max), v| (min.min(*v), max.max(*v)));
        let [x, y, z] = [ends(x), ends(y), ends(z)];
        Self { min: [x.0, y.0, z.0], max: [x.1, y.1, z.1] }
    }

    /// Of some places.
    pub(super) fn around(places: impl Iterator<Item = [i32; 3]>) -> Self {
        places.fold(Self::EMPTY, |mut all, place| {
            all.join(&Self::at(place));
            all
        })
    }

    #[inline(always)]
    pub(super) fn join(&mut self, other: &Self) {
        for a in 0..3 {
            self.min[a] = self.min[a].min(other.min[a]);
            self.max[a] = self.max[a].max(other.max[a]);
        }
    }
}

/// The boxes of eight children, axis by axis.
#[derive(Debug, Clone, Copy)]
struct Node {
    min: [[i32; WIDTH]; 3],
    max: [[i32; WIDTH]; 3],
    /// How many there are.
    children: u32,
}

impl Node {
    /// Squares of the distances of a box from the boxes.
    #[inline(always)]
    fn distances(&self, of: &Box3, space: &Space) -> [f32; WIDTH] {
        let mut sums = [0.0; WIDTH];
        for (i, sum) in sums.iter_mut().enumerate() {
            let beside = [0, 1, 2].map(|a| apart([of.min[a], of.max[a]], [self.min[a][i], self.max[a][i]]));
            *sum = squared(beside, space.scale);
        }
        sums
    }
}

/// Boxes over boxes, eight to one, over runs of points in Morton order.
#[derive(Debug, Default)]
pub(super) struct Boxes {
    /// The nodes of each level; those of the first have the boxes of runs. The last level has one node.
    levels: Vec<Vec<Node>>,
}

/// A node or a run that is still to be looked at.
#[derive(Debug, Clone, Copy)]
pub(super) struct Waiting {
    distance: f32,
    level: u32,
    index: u32,
}

impl Boxes {
    /// Over runs with these boxes; the memory of an earlier hierarchy is used again.
    pub(super) fn build(&mut self, runs: impl Iterator<Item = Box3>) {
        let mut spare = std::mem::take(&mut self.levels).into_iter();
        let mut above = self.level(&mut spare, runs);
        while above.len() > 1 {
            let boxes: Vec<Box3> = std::mem::take(&mut above);
            above = self.level(&mut spare, boxes.into_iter());
        }
    }

    /// Adds a level; returns the boxes of its nodes.
    fn level(
        &mut self,
        spare: &mut impl Iterator<Item = Vec<Node>>,
        mut below: impl Iterator<Item = Box3>,
    ) -> Vec<Box3> {
        let mut nodes = spare.next().unwrap_or_default();
        nodes.clear();
        let mut boxes = Vec::new();
        loop {
            let mut node = Node { min: [[i32::MAX; WIDTH]; 3], max: [[i32::MIN; WIDTH]; 3], children: 0 };
            let mut all = Box3::EMPTY;
            for child in below.by_ref().take(WIDTH) {
                for a in 0..3 {
                    node.min[a][node.children as usize] = child.min[a];
                    node.max[a][node.children as usize] = child.max[a];
                }
                node.children += 1;
                all.join(&child);
            }
            if node.children == 0 {
                break;
            }
            nodes.push(node);
            boxes.push(all);
            if node.children < WIDTH as u32 {
                break;
            }
        }
        self.levels.push(nodes);
        boxes
    }

    /// Bytes of memory.
    pub(super) fn bytes(&self) -> u64 {
        self.levels.iter().map(|nodes| (nodes.capacity() * size_of::<Node>()) as u64).sum()
    }

    /// The runs whose boxes may hold a point that is near enough to a box, but for those in `known`; nearer boxes first, by and large.
    /// `stack` is memory.
    #[inline(always)]
    pub(super) fn near<'a>(
        &'a self,
        of: Box3,
        space: &'a Space,
        known: &'a Range<u32>,
        stack: &'a mut Vec<Waiting>,
    ) -> Near<'a> {
        stack.clear();
        stack.push(Waiting { distance: 0.0, level: self.levels.len() as u32, index: 0 });
        Near { boxes: self, of, space, known, stack }
    }
}

/// A walk through the boxes near one.
pub(super) struct Near<'a> {
    boxes: &'a Boxes,
    of: Box3,
    space: &'a Space,
    known: &'a Range<u32>,
    stack: &'a mut Vec<Waiting>,
}

impl Near<'_> {
    /// The next run whose box is at most as far away as the square of a distance, which may become less from one to the next.
    #[inline(always)]
    pub(super) fn next(&mut self, lanes: impl Compare, bound: f32) -> Option<u32> {
        while let Some(Waiting { distance, level, index }) = self.stack.pop() {
            if distance > bound {
                continue;
            }
            if level == 0 {
                return Some(index);
            }
            let Some(node) = self.boxes.levels.get(level as usize - 1).and_then(|nodes| nodes.get(index as usize))
            else {
                continue;
            };
            let distances = node.distances(&self.of, self.space);
            let base = self.stack.len();
            let mut hits = lanes.at_most(&distances, bound);
            hits &= (1 << node.children) - 1;
            while hits != 0 {
                let i = hits.trailing_zeros() as usize % WIDTH;
                hits &= hits - 1;
                let child =
                    Waiting { distance: distances[i], level: level - 1, index: index * WIDTH as u32 + i as u32 };
                if child.is_within(self.known) {
                    continue;
                }
                // the nearest last: it is looked at first
                let mut at = self.stack.len();
                self.stack.push(child);
                while at > base && self.stack[at - 1].distance < child.distance {
                    self.stack[at] = self.stack[at - 1];
                    at -= 1;
                }
                self.stack[at] = child;
            }
        }
        None
    }
}

impl Waiting {
    /// True if all its runs are among `known`.
    #[inline(always)]
    fn is_within(&self, known: &Range<u32>) -> bool {
        let width = 3 * self.level;
        let first = u64::from(self.index) << width;
        first >= u64::from(known.start) && first + (1 << width) <= u64::from(known.end)
    }
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::Random;

    use super::*;
    use crate::runtime::Portable;

    #[test]
    fn every_run_that_can_be_near_enough_is_found_and_known_ones_are_not() {
        let mut random = Random::new(8);
        let space = Space::new([0.01, 0.01, 0.02]);
        let mut boxes = Boxes::default();
        for runs in [1usize, 2, 7, 8, 9, 64, 65, 700] {
            let all: Vec<Box3> = (0..runs)
                .map(|_| {
                    let min: [i32; 3] = std::array::from_fn(|_| random.below(1000) as i32);
                    Box3 { min, max: min.map(|v| v + random.below(50) as i32) }
                })
                .collect();
            boxes.build(all.iter().copied());
            for _ in 0..50 {
                let of = Box3::at(std::array::from_fn(|_| random.below(1000) as i32));
                let of = Box3 { max: of.max.map(|v| v + random.below(2) as i32 * 40), ..of };
                let bound = random.below(200_000) as f32;
                let known = random.below(runs as u64 + 1) as u32;
                let known = known..known + random.below(u64::from(runs as u32 - known) + 1) as u32;
                let mut found = Vec::new();
                let mut stack = Vec::new();
                let mut near = boxes.near(of, &space, &known, &mut stack);
                while let Some(run) = near.next(Portable, bound) {
                    found.push(run);
                }
                found.retain(|run| !known.contains(run)); // a node may have some of both
                found.sort_unstable();
                let is_near = |run: &u32| {
                    let Box3 { min, max } = all[*run as usize];
                    let beside = std::array::from_fn(|a| apart([of.min[a], of.max[a]], [min[a], max[a]]));
                    squared(beside, space.scale) <= bound && !known.contains(run)
                };
                let expected: Vec<u32> = (0..runs as u32).filter(is_near).collect();
                assert_eq!(found, expected, "{runs} runs");
            }
        }
    }
}
