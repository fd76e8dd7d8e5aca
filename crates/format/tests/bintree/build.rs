//! Builds datasets for tests and measurements: section 6 of `docs/formats/bintree.md`, plainly, in memory.

use std::cmp::Ordering;

use pointmill_format::bintree::{
    CORE_BYTES, Header, IndexWriter, Layout, LeafEncoder, Node, NodeKind, SplitRule, leaf_center, leaf_file_name,
};
use pointmill_format::bytes::Memory;
use pointmill_format::{Aabb, Lattice};

/// A lattice point; `id` gives everything else of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    pub(crate) q: [i32; 3],
    pub(crate) id: u32,
}

/// What a dataset is made with.
pub(crate) struct Builder<'a> {
    pub(crate) header: Header,
    /// The class of a point.
    pub(crate) class: &'a dyn Fn(u32) -> f64,
    /// Fills the bytes of a record behind the core.
    pub(crate) extras: &'a dyn Fn(u32, &mut [u8]),
}

/// The nodes in preorder and the bytes of all leaves behind one another.
#[derive(Default)]
pub(crate) struct Built {
    pub(crate) nodes: Vec<Node>,
    pub(crate) leaves: Vec<u8>,
}

/// A header for points on `lattice`, the core alone.
pub(crate) fn header(points: u64, capacity: u64, layout: Layout, lattice: Lattice) -> Header {
    let mut header = Header::new(lattice, capacity, layout);
    (header.generator, header.name, header.points) = ("a test".into(), "made".into(), points);
    header
}

impl Builder<'_> {
    /// The files of a dataset.
    pub(crate) fn files(&self, points: &mut [Point]) -> Memory {
        let built = self.build(points);
        let mut files = Memory::new();
        let stride = self.header.record.stride();
        if self.header.layout == Layout::Packed {
            files.insert("leaves.bin".into(), built.leaves.clone());
        } else {
            let (mut at, mut path) = (0, Vec::new());
            for node in &built.nodes {
                if !node.is_leaf() {
                    path.push(false);
                    continue;
                }
                let end = at + node.count as usize * stride;
                files.insert(leaf_file_name(path.iter().copied()), built.leaves[at..end].to_vec());
                at = end;
                while path.pop_if(|high| *high).is_some() {}
                path.iter_mut().last().into_iter().for_each(|high| *high = true);
            }
        }
        let mut index = IndexWriter::new(Vec::new(), &self.header).unwrap();
        built.nodes.iter().for_each(|node| index.node(node).unwrap());
        files.insert("index.json".into(), index.finish().unwrap());
        files
    }

    pub(crate) fn build(&self, points: &mut [Point]) -> Built {
        let mut built = Built::default();
        if !points.is_empty() {
            self.node(points, 0, &mut built);
        }
        built
    }

    fn node(&self, points: &mut [Point], depth: usize, built: &mut Built) -> Aabb {
        if points.len() as u64 <= self.header.capacity {
            return self.leaf(points, built);
        }
        let (min, max) = box_of(points);
        let extent = [0, 1, 2].map(|a| (i64::from(max[a]) - i64::from(min[a])) as f64 * self.header.lattice.scale[a]);
        let axis = (0..3).fold(0, |best, a| if extent[a] > extent[best] { a } else { best });
        if min == max {
            self.sort(points);
            let (n, runs) = (points.len(), points.len().div_ceil(self.header.capacity as usize));
            let sizes: Vec<usize> = (0..runs).map(|i| n / runs + usize::from(i < n % runs)).collect();
            return self.runs(points, &sizes, built);
        }
        let m = self.plane(points, axis, min[axis], max[axis], depth);
        let mut low = 0;
        for i in 0..points.len() {
            if i64::from(points[i].q[axis]) <= m {
                points.swap(i, low);
                low += 1;
            }
        }
        let split = m as f64 * self.header.lattice.scale[axis] + self.header.lattice.offset[axis];
        let (low, high) = points.split_at_mut(low);
        let kind = |high| NodeKind::Inner { axis: axis as u8, split, high };
        self.inner(built, kind, |b| self.node(low, depth + 1, b), |b| self.node(high, depth + 1, b))
    }

    fn plane(&self, points: &[Point], axis: usize, min: i32, max: i32, depth: usize) -> i64 {
        let rule = if depth < 64 { self.header.split } else { SplitRule::Median };
        match rule {
            SplitRule::Mean => {
                let sum: i128 = points.iter().map(|p| i128::from(p.q[axis])).sum();
                sum.div_euclid(points.len() as i128) as i64
            }
            SplitRule::Midpoint => (i64::from(min) + i64::from(max)).div_euclid(2),
            SplitRule::Median => {
                let mut values: Vec<i32> = points.iter().map(|p| p.q[axis]).collect();
                values.sort_unstable();
                let median = values[(values.len() - 1) / 2];
                let below_max = values.iter().rev().find(|v| **v < max);
                i64::from(if median == max { *below_max.unwrap() } else { median })
            }
        }
    }

    /// Leaves of these sizes under a balanced tree.
    fn runs(&self, points: &mut [Point], sizes: &[usize], built: &mut Built) -> Aabb {
        if sizes.len() == 1 {
            return self.leaf(points, built);
        }
        let (low_sizes, high_sizes) = sizes.split_at(sizes.len().div_ceil(2));
        let (low, high) = points.split_at_mut(low_sizes.iter().sum());
        let kind = |high| NodeKind::Degenerate { high };
        self.inner(built, kind, |b| self.runs(low, low_sizes, b), |b| self.runs(high, high_sizes, b))
    }

    fn inner(
        &self,
        built: &mut Built,
        kind: impl Fn(u32) -> NodeKind,
        low: impl FnOnce(&mut Built) -> Aabb,
        high: impl FnOnce(&mut Built) -> Aabb,
    ) -> Aabb {
        let index = built.nodes.len();
        built.nodes.push(Node::new(Aabb::EMPTY, 0, kind(0)));
        let low = low(built);
        let high_index = built.nodes.len();
        let bounds = low.union(&high(built));
        let count = built.nodes[index + 1].count + built.nodes[high_index].count;
        built.nodes[index] = Node::new(bounds, count, kind(high_index as u32));
        bounds
    }

    fn leaf(&self, points: &mut [Point], built: &mut Built) -> Aabb {
        self.sort(points);
        let (min, max) = box_of(points);
        let world = |q: [i32; 3]| self.header.lattice.world(q.map(i64::from));
        let center = leaf_center(world(min), world(max));
        let start = (self.header.layout == Layout::Packed).then_some(built.leaves.len() as u64);
        let mut leaf = LeafEncoder::new(&self.header.record, center, &mut built.leaves);
        for p in points.iter() {
            (self.extras)(p.id, leaf.push(world(p.q), (self.class)(p.id)));
        }
        let bounds = leaf.finish();
        built.nodes.push(Node::new(bounds, points.len() as u64, NodeKind::Leaf { center, start }));
        bounds
    }

    /// Morton order, then the bytes of the record from the class on.
    fn sort(&self, points: &mut [Point]) {
        let (min, _) = box_of(points);
        let tail = |p: &Point| {
            let mut record = Vec::new();
            let mut leaf = LeafEncoder::new(&self.header.record, [0.0; 3], &mut record);
            (self.extras)(p.id, leaf.push([0.0; 3], (self.class)(p.id)));
            record.split_off(CORE_BYTES - 4)
        };
        points.sort_unstable_by(|a, b| morton_order(a.q, b.q, min).then_with(|| tail(a).cmp(&tail(b))));
    }
}

pub(crate) fn box_of(points: &[Point]) -> ([i32; 3], [i32; 3]) {
    let fold = |pick: fn(i32, i32) -> i32| {
        points.iter().skip(1).fold(points[0].q, |m, p| [0, 1, 2].map(|a| pick(m[a], p.q[a])))
    };
    (fold(i32::min), fold(i32::max))
}

/// The axis with the highest differing bit decides; of equal bits x before y before z.
fn morton_order(a: [i32; 3], b: [i32; 3], min: [i32; 3]) -> Ordering {
    let [a, b] = [a, b].map(|q| [0, 1, 2].map(|i| q[i].wrapping_sub(min[i]) as u32));
    let mut best = (0, 0);
    for i in 0..3 {
        let differ = a[i] ^ b[i];
        if differ.checked_ilog2().map_or(0, |bit| bit + 1) > best.0 {
            best = (differ.ilog2() + 1, i);
        }
    }
    a[best.1].cmp(&b[best.1])
}
