//! What the tests share.

use std::path::PathBuf;

use pointmill_format::bintree::{Bintree, Layout};
use pointmill_format::bytes::Memory;
use pointmill_format::{Lattice, NodePoints, ReadError};
use pointmill_testkit::Random;
use pointmill_testkit::files::fixture;

use crate::build::{Builder, Point, header};

/// The folder of the golden dataset in that layout.
pub(crate) fn golden(layout: &str) -> PathBuf {
    fixture("bintree").join(layout)
}

/// The files of the golden dataset, to be changed.
pub(crate) fn load(layout: &str) -> Memory {
    let files = std::fs::read_dir(golden(layout)).unwrap().map(|entry| entry.unwrap().path());
    files.map(|f| (f.file_name().unwrap().to_str().unwrap().to_owned(), std::fs::read(&f).unwrap())).collect()
}

pub(crate) fn open(files: &Memory) -> Result<Bintree, ReadError> {
    Bintree::from_source(files.clone())
}

/// Millimetres around a place far from the origin.
pub(crate) const FAR: Lattice = Lattice { scale: [0.001; 3], offset: [4_428_000.0, 512_000.0, -20.0] };

/// The class that [`files_of`] gives to a point.
pub(crate) fn class_of(id: u32) -> f64 {
    f64::from(id % 19)
}

/// A dataset of these points, of the core alone.
pub(crate) fn files_of(points: &mut [Point], capacity: u64, layout: Layout, lattice: Lattice) -> Memory {
    let header = header(points.len() as u64, capacity, layout, lattice);
    Builder { header, class: &class_of, extras: &|_, _| {} }.files(points)
}

/// Points along a wavy corridor `length` lattice units long: clumps, lines and lonely ones.
pub(crate) fn corridor(n: usize, length: f64, seed: u64) -> Vec<Point> {
    let random = &mut Random::new(seed);
    let point = |id| {
        let along = random.between(0.0, length);
        let wire = random.index(3) as f64;
        let q = match random.index(10) {
            0 => [along, random.between(-40_000.0, 40_000.0), random.between(0.0, 30_000.0)],
            1..=4 => [along, (along / 50_000.0).sin() * 9000.0 + wire * 4000.0, 20_000.0 + wire * 100.0],
            _ => [along, random.between(-30_000.0, 30_000.0), random.between(0.0, 2000.0) * (along / 9000.0).cos()],
        };
        Point { q: q.map(|v| v as i32), id }
    };
    (0..n as u32).map(point).collect()
}

/// A point as read: world position, class, leaf, index in the leaf.
pub(crate) type Found = ([f64; 3], f32, u32, u32);

/// All points, in preorder of the leaves.
pub(crate) fn read_all(tree: &Bintree) -> Result<Vec<Found>, ReadError> {
    let (mut all, mut points) = (Vec::new(), NodePoints::default());
    for leaf in tree.leaves() {
        tree.read_leaf(leaf, &mut points)?;
        let found = |i| (points.world(i).unwrap(), points.column::<f32>("classification").unwrap()[i], leaf, i as u32);
        all.extend((0..points.len()).map(found));
    }
    Ok(all)
}
