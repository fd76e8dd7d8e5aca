//! Samples of lists: what is taken and what stays.

use std::sync::Arc;

use pointmill_format::{Lattice, NodeKey};

use super::super::borders::{Borders, UnitBorders};
use super::super::sample::{Sampling, Spacing};
use super::super::sink::NodeEncoder;
use super::super::sinks::Stream;
use super::*;
use crate::cloud::{Checksum, Cube, JobBounds, JobPoint, StoredOrigin, morton};
use crate::runtime::{SystemDisk, TempFiles};

/// Along each axis, in steps; the spacing of the root is a 128th of it.
const SIDE: i32 = 1 << 20;

/// Nothing is written in these tests.
struct NoBytes;

impl NodeEncoder for NoBytes {
    fn encode<'r>(
        &mut self,
        _: NodeKey,
        _: impl ExactSizeIterator<Item = &'r [u8]>,
        _: &mut Checksum,
        _: &mut Vec<u8>,
    ) -> Result<(), ConvertError> {
        Ok(())
    }

    fn take_notes(&mut self) -> Result<Vec<u8>, ConvertError> {
        Ok(Vec::new())
    }

    fn row_bytes(&self) -> Option<u64> {
        None
    }

    fn bytes_per_point(&self) -> u64 {
        0
    }
}

fn frame(stride: usize) -> RecordFrame {
    let lattice = Lattice { scale: [1.0; 3], offset: [0.0; 3] };
    let cube = Cube::around(&JobBounds::new([0; 3], [i64::from(SIDE); 3]), &lattice).unwrap();
    RecordFrame { stride, cube, origin: StoredOrigin(JobPoint([0; 3])) }
}

/// Records of points: the position, a number that tells it from all others, and nothing behind that.
fn records(points: &[([i32; 3], u32)], stride: usize) -> Vec<u8> {
    let mut all = vec![0; points.len() * stride];
    for (record, (q, number)) in all.chunks_exact_mut(stride).zip(points) {
        let words = q.map(i32::cast_unsigned).into_iter().chain([*number]);
        record.as_chunks_mut::<4>().0.iter_mut().zip(words).for_each(|(to, word)| *to = word.to_le_bytes());
    }
    all
}

/// The numbers of a list's records.
fn numbers(lists: &Lists, list: &List) -> Vec<u32> {
    let mut found = Vec::new();
    let add = |records: &[u8]| {
        found.extend(records.chunks_exact(lists.stride).map(|r| u32::from_le_bytes([r[12], r[13], r[14], r[15]])));
        Ok(true)
    };
    lists.each(list, add).unwrap();
    found
}

/// Takes the sample of the root from children of these points, each in Morton order; returns the numbers of what it takes,
/// and of what each child keeps.
fn sample(children: &[Vec<([i32; 3], u32)>], stride: usize, is_on_disk: bool) -> (Vec<u32>, Vec<Vec<u32>>) {
    let memory = Arc::new(Pool::new(if is_on_disk { 0 } else { 1 << 30 }, 1 << 30));
    let temp = TempFiles::new(std::env::temp_dir(), Arc::new(SystemDisk));
    let lists = Lists::new(stride, &memory, &temp);
    let (frame, spacing) = (frame(stride), Spacing::default());
    let borders = Borders::new(spacing, &memory, &temp);
    let mut nodes = ListNodes {
        most_points: u64::MAX,
        frame: &frame,
        pool: &memory,
        lists: &lists,
        sampler: &mut Sampler::new(Sampling::Poisson, spacing),
        encoder: &mut NoBytes,
        memory: &mut ListMemory::new(Reservation::new(&memory, Consumer::Work)),
        borders: &mut UnitBorders::new(&borders, NodeKey::ROOT),
        finished: &mut Finished::new(vec![Stream::default()]),
    };
    let leaf = |(i, points): (usize, &Vec<_>)| {
        let mut list = List::of_chunk(records(points, stride), stride);
        lists.admit(&mut list).unwrap();
        assert_eq!(list.in_memory().is_none(), is_on_disk && !points.is_empty());
        Pending::leaf(NodeKey::ROOT.child(i as u8).unwrap(), list)
    };
    let mut children: Vec<Pending<List>> = children.iter().enumerate().map(leaf).collect();
    let taken = nodes.sample(NodeKey::ROOT, &mut children).unwrap();
    let kept = children.iter().map(|child| numbers(&lists, &child.points)).collect::<Vec<_>>();
    assert!(children.iter().zip(&kept).all(|(child, kept)| child.points.count() == kept.len() as u64));
    (numbers(&lists, &taken), kept)
}

/// What the sampler takes and leaves of all candidates at once, by their numbers.
fn at_once(children: &[Vec<([i32; 3], u32)>], stride: usize) -> (Vec<u32>, Vec<Vec<u32>>) {
    let (frame, mut sampler) = (frame(stride), Sampler::new(Sampling::Poisson, Spacing::default()));
    sampler.begin(NodeKey::ROOT, &[]);
    for child in children {
        sampler.offer(records(child, stride).chunks_exact(stride).map(|record| frame.tree(record)));
    }
    let mut flags = sampler.choose().iter();
    let (mut taken, mut kept) = (Vec::new(), Vec::new());
    for child in children {
        let (mine, others): (Vec<_>, Vec<_>) = child.iter().partition(|_| *flags.next().unwrap());
        taken.extend(mine.iter().map(|(_, number)| *number));
        kept.push(others.iter().map(|(_, number)| *number).collect());
    }
    (taken, kept)
}

#[test]
fn of_a_small_list_all_some_or_none_are_taken_and_the_rest_stays_in_order() {
    let far = |i: i32| [i * SIDE / 8 + 1000, 1000, 1000];
    let near = |i: i32| [i * SIDE / 8 + 1001, 1000, 1000];
    for is_on_disk in [false, true] {
        let of = |children: &[Vec<([i32; 3], u32)>]| sample(children, 16, is_on_disk);
        assert_eq!(of(&[vec![]]), (vec![], vec![vec![]]), "nothing");
        assert_eq!(of(&[vec![(far(0), 7)]]), (vec![7], vec![vec![]]), "one point");
        let apart = (0..4).map(|i| (far(i), i as u32)).collect();
        assert_eq!(of(&[apart]), (vec![0, 1, 2, 3], vec![vec![]]), "all taken");
        let pairs = (0..4).flat_map(|i| [(far(i), 2 * i as u32), (near(i), 2 * i as u32 + 1)]).collect();
        assert_eq!(of(&[pairs]), (vec![0, 2, 4, 6], vec![vec![1, 3, 5, 7]]), "the first of each pair");
        // what the first child gives is too near to all of the second
        let (first, second) = (vec![(far(4), 1)], vec![([far(4)[0], 1001, 1000], 2), ([far(4)[0] + 1, 1001, 1000], 3)]);
        assert_eq!(of(&[first, second]), (vec![1], vec![vec![], vec![2, 3]]), "none taken");
    }
}

/// Points of a thin slab in Morton order, numbered; in two children, where a node may be cut.
fn slab(count: u64, width: u64) -> Vec<Vec<([i32; 3], u32)>> {
    let (frame, mut random) = (frame(16), pointmill_testkit::Random::new(count));
    let tree = |q: [i32; 3]| frame.tree(&records(&[(q, 0)], 16));
    let mut next = || random.below(width) as i32;
    let mut points: Vec<[i32; 3]> = (0..count).map(|_| [next(), next(), next() >> 6]).collect();
    points.sort_by(|a, b| morton::compare(tree(*a).0, tree(*b).0));
    let sampler = Sampler::new(Sampling::Poisson, Spacing::default());
    let cut = points.windows(2).rposition(|w| sampler.may_be_cut(0, tree(w[0]), tree(w[1]))).unwrap();
    let numbered: Vec<([i32; 3], u32)> = points.into_iter().zip(0..).collect();
    let (first, second) = numbered.split_at(cut + 1);
    vec![first.to_vec(), second.to_vec()]
}

#[test]
fn lists_that_are_looked_at_in_parts_give_what_all_at_once_gives() {
    let (narrow, wide) = (SIDE as u64 / 16, SIDE as u64 / 4);
    // 256 records of 8 KiB are a part; the four places of the narrow slab where it may be cut are farther apart
    for (count, stride, width) in
        [(3000, 16, wide), (400, 8192, narrow), (1500, 8192, narrow), (512, 8192, wide), (900, 8192, wide)]
    {
        let children = slab(count, width);
        let (taken, kept) = at_once(&children, stride);
        let mut all: Vec<u32> = taken.iter().chain(kept.iter().flatten()).copied().collect();
        all.sort_unstable();
        assert_eq!(all, (0..count as u32).collect::<Vec<_>>(), "nothing is lost");
        assert!(taken.is_sorted() && kept.iter().all(|kept| kept.is_sorted()));
        assert!(taken.len() > 20 && kept.iter().all(|kept| !kept.is_empty()));
        for is_on_disk in [false, true] {
            let found = sample(&children, stride, is_on_disk);
            assert!(found == (taken.clone(), kept.clone()), "{count} records of {stride} bytes, {is_on_disk}");
        }
    }
}
