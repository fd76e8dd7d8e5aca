//! A tiny correct octree, written from the format page by the plainest means, to plant faults in.
#![allow(dead_code, unreachable_pub)] // each test binary uses a part

pub mod surfels;

use std::collections::BTreeMap;
use std::path::Path;

use pointmill_format::potree2::{
    AttributeStats, BrotliScratch, Encoding, Metadata, NodeEntry, NodeRecord, encode_brotli, encode_hierarchy,
};
use pointmill_format::{Aabb, Attribute, AttributeType, Lattice, NodeKey};
use pointmill_testkit::Random;
use pointmill_testkit::las::{self, Las};
use pointmill_validate::{Check, Options, Outcome, validate};

/// Side of the cube in lattice steps; the spacing of the root is 128 steps.
pub const SIDE: i32 = 1 << 14;
pub const SCALE: f64 = 0.01;
pub const OFFSET: [f64; 3] = [637_000.0, 849_000.0, -40.0];
const CAPACITY: usize = 150;

/// One point with all its attributes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    pub position: [i32; 3],
    pub rgb: [u16; 3],
    pub intensity: u16,
    pub classification: u8,
    pub scan_angle: i8,
    pub gps_time: f64,
    /// What a conversion has computed; of all points or of none.
    pub surfel: Option<surfels::Surfel>,
}

/// Bytes of a point without computed attributes, DEFAULT.
pub const STRIDE: usize = 12 + 6 + 2 + 1 + 1 + 8;

impl Point {
    pub fn bytes(&self) -> Vec<u8> {
        let mut out = Vec::new();
        self.position.iter().for_each(|v| out.extend(v.to_le_bytes()));
        self.rgb.iter().for_each(|v| out.extend(v.to_le_bytes()));
        out.extend(self.intensity.to_le_bytes());
        out.extend([self.classification, self.scan_angle as u8]);
        out.extend(self.gps_time.to_le_bytes());
        self.surfel.iter().flatten().for_each(|v| out.extend(v.to_le_bytes()));
        out
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Sampler {
    Poisson,
    Grid,
}

/// A dense hill in one corner of a plain: five levels, sparse and dense places.
pub fn scene() -> Vec<Point> {
    let mut random = Random::new(7);
    let mut next = |below: u64| random.below(below) as i32;
    let mut points = Vec::new();
    for i in 0..6000 {
        let reach = if i % 6 == 0 { SIDE as u64 } else { 1400 };
        let (x, y) = (next(reach), next(reach));
        let z = 3000 + ((f64::from(x) / 300.0).sin() * 200.0) as i32 + y / 9 + next(3);
        points.push(Point {
            position: [x, y, z],
            rgb: [next(65_536) as u16, next(65_536) as u16, next(65_536) as u16],
            intensity: next(4000) as u16,
            classification: [2, 5, 6, 64][next(4) as usize],
            scan_angle: (next(60) - 30) as i8,
            gps_time: 245_000.0 + f64::from(i) * 0.125,
            surfel: None,
        });
    }
    points
}

/// Points of [`surfel_scene`] that have neither normal nor radius: they share one place.
pub const FLAT: u64 = 20;

/// [`scene`] with right normals, curvatures and radii.
pub fn surfel_scene() -> Vec<Point> {
    let mut points = scene();
    points.iter_mut().for_each(|p| p.classification = 2);
    let one = Point { position: [9000, 9000, 5000], ..points[0] };
    points.extend((0..FLAT).map(|i| Point { intensity: i as u16, ..one }));
    let steps: Vec<[i64; 3]> = points.iter().map(|p| p.position.map(i64::from)).collect();
    let right = surfels::right(&steps, [SCALE; 3]);
    points.iter_mut().zip(right).for_each(|(p, surfel)| p.surfel = Some(surfel));
    points
}

/// A dense floor with a little noise on the plane between nodes, from level 2 down.
pub fn floor() -> Vec<Point> {
    let mut random = Random::new(11);
    let mut next = |below: u64| random.below(below) as i32;
    let template = scene()[0];
    (0..8000).map(|_| Point { position: [next(1024), next(1024), SIDE / 4 - 3 + next(6)], ..template }).collect()
}

/// Points by node.
#[derive(Debug, Clone)]
pub struct Cloud {
    pub nodes: BTreeMap<NodeKey, Vec<Point>>,
    pub sampler: Sampler,
    /// Stored instead of what a node's points encode to.
    pub payload: Option<(NodeKey, Vec<u8>)>,
    /// Planted: nodes are sampled as if they were alone.
    alone: bool,
    /// What nodes took for themselves so far, by level.
    taken: [Vec<Point>; 32],
}

impl Cloud {
    /// The octree of [`scene`].
    pub fn new(sampler: Sampler) -> Self {
        Self::of(scene(), sampler)
    }

    /// The octree of any points.
    pub fn of(points: Vec<Point>, sampler: Sampler) -> Self {
        Self::sampled(points, sampler, false)
    }

    /// The octree of any points, sampled by nodes that do not look over their borders if they are `alone`.
    pub fn sampled(points: Vec<Point>, sampler: Sampler, alone: bool) -> Self {
        let taken = Default::default();
        let mut cloud = Self { nodes: BTreeMap::new(), sampler, payload: None, alone, taken };
        cloud.build(NodeKey::ROOT, points);
        cloud
    }

    fn build(&mut self, key: NodeKey, points: Vec<Point>) {
        if points.len() <= CAPACITY {
            self.nodes.insert(key, points);
            return;
        }
        let mut octants: [Vec<Point>; 8] = Default::default();
        for p in points {
            octants[octant(p.position, key.level + 1)].push(p);
        }
        let mut taken: Vec<Point> = Vec::new();
        let others = self.taken_around(key);
        for (child, points) in octants.into_iter().enumerate().filter(|(_, p)| !p.is_empty()) {
            let child = key.child(child as u8).unwrap();
            self.build(child, points);
            let inner = (0..8).any(|c| self.nodes.contains_key(&child.child(c).unwrap()));
            let mut left = self.nodes.remove(&child).unwrap();
            let mut count = left.len();
            left.retain(|p| {
                let wanted = !(inner && count == 1)
                    && fits(&taken, p, key.level, self.sampler)
                    && fits(&others, p, key.level, Sampler::Poisson);
                if wanted {
                    taken.push(*p);
                    count -= 1;
                }
                !wanted
            });
            if !left.is_empty() {
                self.nodes.insert(child, left);
            }
        }
        if taken.is_empty() {
            // its neighbours cover all of it: a point comes back, because no node is empty
            let children = (0..8).map(|c| key.child(c).unwrap()).filter(|c| self.nodes.contains_key(c));
            let most = children.max_by_key(|c| self.nodes[c].len()).unwrap();
            taken.extend(self.nodes.get_mut(&most).unwrap().pop());
        }
        self.taken[usize::from(key.level)].extend(&taken);
        self.nodes.insert(key, taken);
    }

    /// What earlier nodes of the level took, as far as it is not farther from this node than the spacing.
    fn taken_around(&self, key: NodeKey) -> Vec<Point> {
        let (side, spacing) = (SIDE >> key.level, (SIDE >> key.level) / 128);
        let min = [key.x, key.y, key.z].map(|v| v as i32 * side);
        let near = |p: &&Point| (0..3).all(|a| (min[a] - spacing..=min[a] + side + spacing).contains(&p.position[a]));
        let of_level = if self.alone { &[][..] } else { &self.taken[usize::from(key.level)] };
        of_level.iter().filter(near).copied().collect()
    }

    /// True if the node has children.
    pub fn is_inner(&self, key: NodeKey) -> bool {
        (0..8).any(|c| self.nodes.contains_key(&key.child(c).unwrap()))
    }

    /// The leaf whose box holds a position, if the tree goes down there.
    pub fn leaf_at(&self, position: [i32; 3]) -> Option<NodeKey> {
        let mut key = NodeKey::ROOT;
        while self.is_inner(key) {
            key = key.child(octant(position, key.level + 1) as u8).unwrap();
            self.nodes.get(&key)?;
        }
        Some(key)
    }

    /// Moves the first point of the leaves that `wanted` takes, beside the points of the root, up to the root.
    pub fn raise(&mut self, wanted: impl Fn(&Point, &[Point]) -> bool) {
        let root = self.nodes[&NodeKey::ROOT].clone();
        let leaves = self.nodes.keys().copied().filter(|k| !self.is_inner(*k) && self.nodes[k].len() > 1);
        for leaf in leaves.collect::<Vec<_>>() {
            let points = self.nodes.get_mut(&leaf).unwrap();
            if let Some(i) = points.iter().position(|p| wanted(p, &root)) {
                let point = points.remove(i);
                self.nodes.get_mut(&NodeKey::ROOT).unwrap().push(point);
                return;
            }
        }
        panic!("no such point");
    }

    /// Moves the points of the root around the hill down to leaves.
    pub fn make_hole(&mut self) {
        let root = self.nodes[&NodeKey::ROOT].clone();
        let centre = Point { position: [700, 700, 3150], ..root[0] };
        for p in root {
            let near = distance_squared(&p, &centre) < 600 * 600;
            if let (true, Some(leaf)) = (near, self.leaf_at(p.position)) {
                self.nodes.get_mut(&NodeKey::ROOT).unwrap().retain(|q| *q != p);
                self.nodes.get_mut(&leaf).unwrap().push(p);
            }
        }
    }

    /// True if points have attributes that a conversion has computed.
    pub fn has_surfels(&self) -> bool {
        self.points().any(|p| p.surfel.is_some())
    }

    /// All points, in the order of nodes.
    pub fn points(&self) -> impl Iterator<Item = &Point> {
        self.nodes.values().flatten()
    }

    /// The three files, correct.
    pub fn encode(&self, encoding: Encoding) -> Files {
        let attributes = self.attributes();
        let mut octree = Vec::new();
        let mut scratch = BrotliScratch::default();
        let mut entries = Vec::new();
        for (key, points) in &self.nodes {
            let records: Vec<u8> = points.iter().flat_map(Point::bytes).collect();
            let mut payload = Vec::new();
            match encoding {
                _ if points.is_empty() => {}
                _ if self.payload.as_ref().is_some_and(|(k, _)| k == key) => {
                    payload = self.payload.clone().unwrap().1;
                }
                Encoding::Default => payload = records,
                _ => encode_brotli(&attributes, &records, 4, &mut scratch, &mut payload).unwrap(),
            }
            let (byte_offset, byte_size) = (octree.len() as u64, payload.len() as u64);
            entries.push(NodeEntry::new(*key, points.len() as u32, byte_offset, byte_size));
            octree.extend(payload);
        }
        let hierarchy = encode_hierarchy(&mut entries, 40);
        let side = f64::from(SIDE) * SCALE;
        let (lattice, cube) =
            (Lattice { scale: [SCALE; 3], offset: OFFSET }, Aabb { min: OFFSET, max: OFFSET.map(|v| v + side) });
        let mut metadata = Metadata::new(lattice, cube, side / 128.0, self.stats());
        metadata.name = "hill".into();
        metadata.points = self.points().count() as u64;
        (metadata.first_chunk_size, metadata.depth) = (hierarchy.first_chunk_size, hierarchy.depth);
        metadata.encoding = encoding;
        metadata.extra = serde_json::from_value(serde_json::json!({ "pointmill": {
            "version": "0.1.0", "latticeOffset": OFFSET, "rgbDepth": "auto", "duplicates": "keep",
            "sampling": if self.sampler == Sampler::Poisson { "poisson" } else { "grid" },
        }}))
        .unwrap();
        Files { metadata, text: None, hierarchy: hierarchy.bytes, octree, entries }
    }

    fn attributes(&self) -> Vec<Attribute> {
        let mut attributes = vec![
            Attribute::new("position", AttributeType::Int32, 3),
            Attribute::new("rgb", AttributeType::UInt16, 3),
            Attribute::new("intensity", AttributeType::UInt16, 1),
            Attribute::new("classification", AttributeType::UInt8, 1),
            Attribute::new("scan angle rank", AttributeType::Int8, 1),
            Attribute::new("gps-time", AttributeType::Float64, 1),
        ];
        let derived = surfels::NAMES.iter().filter(|_| self.has_surfels());
        attributes.extend(derived.map(|name| Attribute::new(*name, AttributeType::Float32, 1)));
        attributes
    }

    fn stats(&self) -> Vec<AttributeStats> {
        let columns: [fn(&Point) -> Vec<f64>; 11] = [
            |p| (0..3).map(|a| f64::from(p.position[a]) * SCALE + OFFSET[a]).collect(),
            |p| p.rgb.map(f64::from).to_vec(),
            |p| vec![f64::from(p.intensity)],
            |p| vec![f64::from(p.classification)],
            |p| vec![f64::from(p.scan_angle)],
            |p| vec![p.gps_time],
            |p| vec![f64::from(p.surfel.unwrap()[0])],
            |p| vec![f64::from(p.surfel.unwrap()[1])],
            |p| vec![f64::from(p.surfel.unwrap()[2])],
            |p| vec![f64::from(p.surfel.unwrap()[3])],
            |p| vec![f64::from(p.surfel.unwrap()[4])],
        ];
        let mut stats = Vec::new();
        for (attribute, values) in self.attributes().into_iter().zip(columns) {
            let mut min = vec![f64::INFINITY; attribute.elements];
            let mut max = vec![f64::NEG_INFINITY; attribute.elements];
            for p in self.points() {
                for (i, v) in values(p).into_iter().enumerate() {
                    min[i] = v.min(min[i]);
                    max[i] = v.max(max[i]);
                }
            }
            let mut bins = vec![0; 256];
            self.points().for_each(|p| bins[usize::from(p.classification)] += 1);
            let histogram = (attribute.name == "classification").then_some(bins);
            let mut described = AttributeStats::new(attribute);
            (described.min, described.max, described.histogram) = (min, max, histogram);
            stats.push(described);
        }
        stats
    }
}

fn octant(position: [i32; 3], level: u8) -> usize {
    let bit = |v: i32| ((v / (SIDE >> level)) & 1) as usize;
    4 * bit(position[0]) + 2 * bit(position[1]) + bit(position[2])
}

fn fits(taken: &[Point], p: &Point, level: u8, sampler: Sampler) -> bool {
    let spacing = (SIDE >> level) / 128;
    match sampler {
        Sampler::Poisson => taken.iter().all(|q| distance_squared(p, q) >= i64::from(spacing).pow(2)),
        Sampler::Grid => {
            let cell = |p: &Point| p.position.map(|v| v / spacing);
            taken.iter().all(|q| cell(q) != cell(p))
        }
    }
}

/// Lattice steps, squared.
pub fn distance_squared(p: &Point, q: &Point) -> i64 {
    (0..3).map(|a| i64::from(p.position[a] - q.position[a]).pow(2)).sum()
}

/// The three files of a dataset, to be broken and written.
#[derive(Debug, Clone)]
pub struct Files {
    pub metadata: Metadata,
    /// Replaces the metadata's own text.
    pub text: Option<String>,
    pub hierarchy: Vec<u8>,
    pub octree: Vec<u8>,
    pub entries: Vec<NodeEntry>,
}

impl Files {
    pub fn entry(&self, key: NodeKey) -> &NodeEntry {
        self.entries.iter().find(|e| e.key == key).unwrap()
    }

    /// Where the record that locates the payload of a node stands in `hierarchy.bin`.
    pub fn record_at(&self, key: NodeKey) -> usize {
        let entry = self.entry(key);
        let is_it = |bytes: &[u8]| {
            let record = NodeRecord::from_bytes(bytes.try_into().unwrap());
            !record.is_proxy() && record.byte_offset == entry.byte_offset && record.byte_size == entry.byte_size
        };
        self.hierarchy.chunks_exact(NodeRecord::LEN).position(is_it).unwrap() * NodeRecord::LEN
    }

    /// Where a proxy stands in `hierarchy.bin`.
    pub fn proxy_at(&self) -> usize {
        self.hierarchy.chunks_exact(NodeRecord::LEN).position(|r| r[0] == 2).unwrap() * NodeRecord::LEN
    }

    pub fn write(&self, folder: &Path) {
        let text = self.text.clone().unwrap_or_else(|| self.metadata.to_json());
        std::fs::write(folder.join("metadata.json"), text).unwrap();
        std::fs::write(folder.join("hierarchy.bin"), &self.hierarchy).unwrap();
        std::fs::write(folder.join("octree.bin"), &self.octree).unwrap();
    }

    /// Writes and validates.
    pub fn validate(&self) -> Outcome {
        let folder = tempfile::tempdir().unwrap();
        self.write(folder.path());
        validate(folder.path(), &Options { threads: 2, ..Options::default() }, &|_| {}).unwrap()
    }

    /// Validates against LAS files with these points.
    pub fn validate_against(&self, sources: &[&[Point]]) -> Outcome {
        let folder = tempfile::tempdir().unwrap();
        self.write(folder.path());
        let paths = (0..sources.len()).map(|i| folder.path().join(format!("{i}.las")));
        let against: Vec<_> = paths.collect();
        for (path, points) in against.iter().zip(sources) {
            std::fs::write(path, las(points)).unwrap();
        }
        validate(folder.path(), &Options { against, threads: 2, ..Options::default() }, &|_| {}).unwrap()
    }
}

/// Checks that found errors.
pub fn broken(outcome: &Outcome) -> Vec<Check> {
    outcome.checks.iter().filter(|c| !c.ok).map(|c| c.name).collect()
}

/// Asserts that `check` found `count` errors, no other check found any, and nothing was warned of.
#[track_caller]
pub fn assert_only(outcome: &Outcome, check: Check, count: u64) {
    let lines: Vec<String> = outcome.problems.iter().map(ToString::to_string).collect();
    assert_eq!(broken(outcome), [check], "{lines:#?}");
    assert_eq!(outcome.check(check).unwrap().found, count, "{lines:#?}");
    assert_eq!(outcome.problems.len() as u64, count.min(20), "{lines:#?}");
    assert!(!outcome.ok);
}

/// A LAS file of these points; classes above 31 do not fit.
pub fn las(points: &[Point]) -> Vec<u8> {
    let point = |p: &Point| las::Point {
        intensity: p.intensity,
        class: p.classification & 31,
        scan_angle: p.scan_angle,
        gps_time: p.gps_time,
        rgb: p.rgb,
        ..las::Point::at(p.position)
    };
    Las { scale: [SCALE; 3], offset: OFFSET, ..Las::new(points.iter().map(point).collect()) }.bytes()
}
