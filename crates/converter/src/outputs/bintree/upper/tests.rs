//! Splits against plain lists of all points.

use std::sync::Arc;

use pointmill_testkit::Random;

use super::*;
use crate::runtime::{Pool, SystemDisk, TempFiles};

const STRIDE: usize = 13;

/// Parts of these points, each in segments of a few blocks.
fn parts(store: &Store, all: &[Vec<i32>]) -> Vec<Part> {
    let part = |values: &Vec<i32>| {
        let mut part = Part { points: values.len() as u64, segments: Segments::default(), moments: Moments::default() };
        for (source, some) in values.chunks(values.len().div_ceil(3)).enumerate() {
            let block = store.open(source as u32).unwrap();
            let record = |v: &i32| [[*v, 7, !v].map(i32::to_le_bytes).concat(), vec![1]].concat();
            store.fill(block, &mut some.iter().flat_map(record).collect()).unwrap();
            part.segments.push(Segment { block, start: 0, count: some.len() as u32 });
        }
        values.iter().for_each(|v| part.moments.add(JobPoint([*v, 7, !v].map(i64::from))));
        part
    };
    all.iter().map(part).collect()
}

fn store() -> Arc<Store> {
    let temp = TempFiles::new(std::env::temp_dir(), Arc::new(SystemDisk));
    Store::new(temp, STRIDE, 1, &Arc::new(Pool::new(1 << 30, 1 << 30)))
}

/// Values of several parts that overlap: few and many, near and far, most of them the greatest.
fn shapes() -> Vec<Vec<Vec<i32>>> {
    let mut random = Random::new(7);
    let mut values = |count: usize, least: i64, span: u64| -> Vec<i32> {
        (0..count).map(|_| (least + (random.unit() * span as f64) as i64) as i32).collect()
    };
    let far = vec![values(500, i64::from(i32::MIN), (1 << 32) - 9), values(800, -40, 80), vec![i32::MIN, i32::MAX]];
    let near = vec![values(70_000, 0, 90), values(3, 60, 50), values(1000, -500, 520)];
    let top =
        vec![[values(40, 10, 60), vec![99; 90]].concat(), vec![99; 30], [values(30, 95, 5), vec![99; 4]].concat()];
    let two = vec![vec![3, 4, 4], vec![4, 3, 4, 4]];
    vec![far, near, top, two]
}

#[test]
fn values_and_medians_are_those_of_all_points_in_order() {
    for shape in shapes() {
        let store = store();
        let parts = parts(&store, &shape);
        let mut all: Vec<i64> = shape.iter().flatten().map(|v| i64::from(*v)).collect();
        all.sort_unstable();
        for axis in [0, 2] {
            let cut = Cut { store: &store, stride: STRIDE, origin: StoredOrigin(JobPoint([0; 3])), axis };
            let mut all = if axis == 0 { all.clone() } else { all.iter().map(|v| !v).collect() };
            all.sort_unstable();
            let (min, max) = (all[0], all[all.len() - 1]);
            for rank in (0..all.len()).step_by((all.len() / 40).max(1)).chain([all.len() - 1]) {
                let value = all[rank];
                assert_eq!(cut.value_at(&parts, min, max, rank as u64).unwrap(), value, "rank {rank}");
                let below = all.partition_point(|v| *v < value) as u64;
                assert_eq!(cut.count_below(&parts, value).unwrap(), below, "below {value}");
                assert_eq!(cut.count_below(&parts, value + 1).unwrap(), all.partition_point(|v| *v <= value) as u64);
            }
            let median = all[(all.len() - 1) / 2];
            let expected = if median == max { *all.iter().rfind(|v| **v < max).unwrap() } else { median };
            let moments = moments(&parts);
            assert_eq!(cut.median(&parts, &moments, all.len() as u64).unwrap(), expected);
        }
    }
}

#[test]
fn both_sides_of_a_cut_hold_their_points_once() {
    for shape in shapes() {
        let store = store();
        let parts = parts(&store, &shape);
        let mut all: Vec<i64> = shape.iter().flatten().map(|v| i64::from(*v)).collect();
        all.sort_unstable();
        let m = all[all.len() / 4]; // below the greatest
        let cut = Cut { store: &store, stride: STRIDE, origin: StoredOrigin(JobPoint([0; 3])), axis: 0 };
        let sides = cut.divide(parts, m).unwrap();
        let at = all.partition_point(|v| *v <= m);
        for (side, expected) in sides.iter().zip([&all[..at], &all[at..]]) {
            let (mut found, mut records) = (Vec::new(), Vec::new());
            side.iter().for_each(|part| cut.each(part, &mut records, |v| found.push(v)).unwrap());
            found.sort_unstable();
            assert!(found == expected, "{} points of {}", found.len(), expected.len());
            let moments = moments(side);
            assert_eq!(moments.sum[0], expected.iter().map(|v| i128::from(*v)).sum::<i128>());
            assert_eq!((moments.bounds.min[0], moments.bounds.max[0]), (expected[0], expected[expected.len() - 1]));
        }
    }
}
