//! A tiny correct binary tree, written from the format page by the plainest means, to plant faults in.

use std::collections::BTreeMap;
use std::path::Path;

use pointmill_testkit::Random;
use pointmill_testkit::las::{self, Las};
use pointmill_validate::{Check, Options, Outcome, validate};
use serde_json::{Map, Value, json};

use crate::surfels::{self, Surfel};

pub(crate) const STRIDE: usize = 40;

/// One point: lattice integers and attributes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    pub(crate) step: [i64; 3],
    pub(crate) class: f32,
    pub(crate) rgb: [u16; 3],
    pub(crate) intensity: u16,
    pub(crate) gps_time: f64,
    /// What a conversion has computed; of all points or of none.
    pub(crate) surfel: Option<Surfel>,
}

impl Point {
    pub(crate) fn at(step: [i64; 3]) -> Self {
        Self { step, class: 2.0, rgb: [256, 2, 65_535], intensity: 7, gps_time: 0.5, surfel: None }
    }

    /// From byte 12 of the record on: class, rgb at 16, intensity at 22, rgba at 24, gps-time at 32.
    fn tail(&self) -> Vec<u8> {
        let mut out = self.class.to_le_bytes().to_vec();
        self.rgb.iter().for_each(|v| out.extend(v.to_le_bytes()));
        out.extend(self.intensity.to_le_bytes());
        out.extend(self.rgb.map(|v| ((u32::from(v) * 255 + 32_767) / 65_535) as u8));
        out.extend([255, 0, 0, 0, 0]);
        out.extend(self.gps_time.to_le_bytes());
        // at 40, and a record is whole words of 8 bytes
        self.surfel.iter().for_each(|surfel| {
            surfel.iter().for_each(|v| out.extend(v.to_le_bytes()));
            out.extend([0; 4]);
        });
        out
    }
}

/// What to make of points.
#[derive(Debug, Clone)]
pub(crate) struct Cloud {
    pub(crate) points: Vec<Point>,
    pub(crate) capacity: usize,
    pub(crate) rule: &'static str,
    pub(crate) packed: bool,
    pub(crate) scale: [f64; 3],
    pub(crate) offset: [f64; 3],
    /// Where medians begin.
    pub(crate) median_depth: usize,
    /// Planted: the plane of the node at this path is that many steps off, sides as it says.
    pub(crate) plane_off: Option<(&'static str, i64)>,
    /// Planted: the node at this path is split along this axis.
    pub(crate) axis: Option<(&'static str, usize)>,
    /// Planted: points of one place are cut into runs of that many.
    pub(crate) run: Option<usize>,
}

/// A sloping corridor with a place of 50 points: depth 7 or so.
pub(crate) fn scene() -> Vec<Point> {
    let mut random = Random::new(7);
    let mut next = |below: u64| random.below(below) as i64;
    let mut points = Vec::new();
    for i in 0..700 {
        let x = if i % 5 == 0 { next(200_000) } else { next(30_000) } - 40_000;
        points.push(Point {
            step: [x, next(20_000), x / 100 + next(300)],
            class: [2.0, 5.0, 6.0, 17.0][next(4) as usize],
            rgb: [next(65_536) as u16, next(65_536) as u16, next(65_536) as u16],
            intensity: next(4000) as u16,
            gps_time: 245_000.0 + i as f64 * 0.125,
            surfel: None,
        });
    }
    for i in 0..50 {
        points.push(Point { intensity: i * 9 % 50, ..Point::at([150_000, -3000, 40]) });
    }
    points
}

impl Default for Cloud {
    fn default() -> Self {
        Self {
            points: scene(),
            capacity: 20,
            rule: "mean",
            packed: false,
            scale: [0.001, 0.001, 0.01],
            offset: [637_000.0, 4_849_000.0, -5.0],
            median_depth: 64,
            plane_off: None,
            axis: None,
            run: None,
        }
    }
}

type Box3 = [[f64; 3]; 2];

/// The files of a dataset, to be broken and written.
#[derive(Debug, Clone)]
pub(crate) struct Files {
    pub(crate) head: Map<String, Value>,
    pub(crate) nodes: Vec<Value>,
    /// Path of a leaf to its bytes.
    pub(crate) leaves: BTreeMap<String, Vec<u8>>,
    /// Path of each node.
    pub(crate) paths: Vec<String>,
    pub(crate) packed: bool,
    /// Text instead of `head` and `nodes`.
    pub(crate) text: Option<String>,
}

impl Cloud {
    pub(crate) fn world(&self, step: [i64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|a| step[a] as f64 * self.scale[a] + self.offset[a])
    }

    pub(crate) fn build(&self) -> Files {
        let mut files = Files {
            head: Map::new(),
            nodes: Vec::new(),
            leaves: BTreeMap::new(),
            paths: Vec::new(),
            packed: self.packed,
            text: None,
        };
        let bounds = (!self.points.is_empty()).then(|| self.node(self.points.clone(), "n".into(), None, &mut files));
        let origin = bounds.map_or([0.0; 3], |(_, b)| b[0].map(f64::floor));
        let column = |name: &str, ty: &str, elements: usize, offset: usize| json!({ "name": name, "type": ty, "elements": elements, "offset": offset });
        let has_surfels = self.points.iter().any(|p| p.surfel.is_some());
        let mut columns = vec![
            column("x", "float", 1, 0),
            column("y", "float", 1, 4),
            column("z", "float", 1, 8),
            column("classification", "float", 1, 12),
            column("rgb", "uint16", 3, 16),
            column("intensity", "uint16", 1, 22),
            column("rgba", "uint8", 4, 24),
            column("gps-time", "double", 1, 32),
        ];
        let derived = surfels::NAMES.iter().enumerate().filter(|_| has_surfels);
        columns.extend(derived.map(|(i, name)| column(name, "float", 1, STRIDE + 4 * i)));
        let head = json!({
            "format": "pointmill-bintree", "version": 1, "generator": "test", "name": "corridor",
            "points": self.points.len(), "capacity": self.capacity,
            "layout": if self.packed { "packed" } else { "files" }, "split": self.rule,
            "origin": origin, "projection": "", "lattice": { "scale": self.scale, "offset": self.offset },
            "pointmill": { "rgbDepth": "16" },
            "attributes": columns,
            "stride": if has_surfels { STRIDE + 24 } else { STRIDE },
        });
        files.head = head.as_object().unwrap().clone();
        files
    }

    /// Adds the node of `points` and all below; `runs`: they are at one place and make that many leaves. Its index and
    /// box.
    fn node(&self, mut points: Vec<Point>, path: String, runs: Option<usize>, files: &mut Files) -> (usize, Box3) {
        let index = files.nodes.len();
        files.nodes.push(Value::Null);
        files.paths.push(path.clone());
        let n = points.len();
        if runs == Some(1) || (runs.is_none() && n <= self.capacity) {
            let bounds = self.leaf(points, path, index, files);
            return (index, bounds);
        }
        let range = |axis: usize| {
            let values = || points.iter().map(|p| p.step[axis]);
            (values().min().unwrap(), values().max().unwrap())
        };
        let extent = |axis: usize| (range(axis).1 - range(axis).0) as f64 * self.scale[axis];
        let mut axis = (1..3).fold(0, |best, a| if extent(a) > extent(best) { a } else { best });
        let (mut node, low, high, low_runs, high_runs);
        if extent(axis) == 0.0 {
            if runs.is_none() {
                points.sort_by_key(Point::tail);
            }
            let k = runs.unwrap_or(n.div_ceil(self.capacity));
            let low_k = k.div_ceil(2);
            // larger runs come first
            let low_points = self.run.map_or(low_k * (n / k) + low_k.min(n % k), |run| run * low_k);
            high = points.split_off(low_points);
            low = points;
            (low_runs, high_runs) = (Some(low_k), Some(k - low_k));
            node = json!({ "axis": -1, "degenerate": true });
        } else {
            if let Some((_, other)) = self.axis.filter(|(p, _)| *p == path) {
                axis = other;
            }
            let mut m = self.plane(points.iter().map(|p| p.step[axis]).collect(), path.len() - 1);
            if let Some((_, off)) = self.plane_off.filter(|(p, _)| *p == path) {
                m += off;
            }
            (low, high) = points.into_iter().partition(|p| p.step[axis] <= m);
            (low_runs, high_runs) = (None, None);
            node = json!({ "axis": axis, "split": m as f64 * self.scale[axis] + self.offset[axis] });
        }
        let (low, a) = self.node(low, format!("{path}0"), low_runs, files);
        let (high, b) = self.node(high, format!("{path}1"), high_runs, files);
        let bounds = [[0, 1, 2].map(|i| a[0][i].min(b[0][i])), [0, 1, 2].map(|i| a[1][i].max(b[1][i]))];
        node["min"] = json!(bounds[0]);
        node["max"] = json!(bounds[1]);
        node["count"] = json!(n);
        node["children"] = json!([low, high]);
        files.nodes[index] = node;
        (index, bounds)
    }

    fn plane(&self, mut values: Vec<i64>, depth: usize) -> i64 {
        values.sort_unstable();
        let (min, max) = (values[0], values[values.len() - 1]);
        match self.rule {
            "mean" if depth < self.median_depth => values.iter().sum::<i64>().div_euclid(values.len() as i64),
            "midpoint" if depth < self.median_depth => (min + max).div_euclid(2),
            _ => match values[(values.len() - 1) / 2] {
                median if median == max => *values.iter().rfind(|v| **v < max).unwrap(),
                median => median,
            },
        }
    }

    fn leaf(&self, mut points: Vec<Point>, path: String, index: usize, files: &mut Files) -> Box3 {
        let min = [0, 1, 2].map(|a| points.iter().map(|p| p.step[a]).min().unwrap());
        let max = [0, 1, 2].map(|a| points.iter().map(|p| p.step[a]).max().unwrap());
        points.sort_by_key(|p| (code([0, 1, 2].map(|a| (p.step[a] - min[a]) as u64)), p.tail()));
        let (low, high) = (self.world(min), self.world(max));
        let center = [0, 1, 2].map(|a| (low[a] + high[a]) / 2.0);
        let mut bounds = [[f64::INFINITY; 3], [f64::NEG_INFINITY; 3]];
        let mut bytes = Vec::new();
        for p in &points {
            let world = self.world(p.step);
            for a in 0..3 {
                let d = (world[a] - center[a]) as f32;
                let decoded = center[a] + f64::from(d);
                bounds[0][a] = bounds[0][a].min(decoded);
                bounds[1][a] = bounds[1][a].max(decoded);
                bytes.extend(d.to_le_bytes());
            }
            bytes.extend(p.tail());
        }
        let mut node = json!({ "min": bounds[0], "max": bounds[1], "count": points.len(), "center": center });
        if self.packed {
            node["start"] = json!(files.leaves.values().map(Vec::len).sum::<usize>());
        } else {
            node["file"] = json!(format!("{path}.bin"));
        }
        files.nodes[index] = node;
        files.leaves.insert(path, bytes);
        bounds
    }
}

/// Bits of x above y above z.
fn code(v: [u64; 3]) -> u128 {
    (0..42).fold(0, |code, bit| {
        let bit_of = |axis: usize, place: u32| u128::from(v[axis] >> bit & 1) << (3 * bit + place);
        code | bit_of(0, 2) | bit_of(1, 1) | bit_of(2, 0)
    })
}

impl Files {
    /// The node at the end of a path ("n01").
    pub(crate) fn node(&mut self, path: &str) -> &mut Value {
        let index = self.paths.iter().position(|p| p == path).unwrap();
        &mut self.nodes[index]
    }

    /// The bytes of a leaf.
    pub(crate) fn leaf(&mut self, path: &str) -> &mut Vec<u8> {
        self.leaves.get_mut(path).unwrap()
    }

    /// The leaf of the most points that has all three extents.
    pub(crate) fn some_leaf(&self) -> String {
        let extended =
            |node: &Value| (0..3).all(|a| node["min"][a] != node["max"][a]) && node.get("children").is_none();
        let leaves = self.nodes.iter().zip(&self.paths).filter(|(node, _)| extended(node));
        leaves.max_by_key(|(node, _)| node["count"].as_u64()).unwrap().1.clone()
    }

    pub(crate) fn text(&self) -> String {
        // serde_json sorts keys; the page has an order
        let order = "format version generator name points capacity layout split origin projection lattice pointmill \
                     attributes stride";
        let keys = order.split(' ').filter_map(|key| Some(format!("\"{key}\":{}", self.head.get(key)?)));
        let nodes: Vec<String> = self.nodes.iter().map(Value::to_string).collect();
        format!("{{{},\"nodes\":[{}]}}", keys.collect::<Vec<_>>().join(","), nodes.join(",\n"))
    }

    pub(crate) fn write(&self, folder: &Path) {
        let text = self.text.clone().unwrap_or_else(|| self.text());
        std::fs::write(folder.join("index.json"), text).unwrap();
        if self.packed {
            let bytes: Vec<u8> = self.leaves.values().flatten().copied().collect();
            std::fs::write(folder.join("leaves.bin"), bytes).unwrap();
        } else {
            self.leaves.iter().for_each(|(p, b)| std::fs::write(folder.join(format!("{p}.bin")), b).unwrap());
        }
    }

    pub(crate) fn validate(&self) -> Outcome {
        let folder = tempfile::tempdir().unwrap();
        self.write(folder.path());
        check(folder.path())
    }

    /// Compares with a LAS file of these points.
    pub(crate) fn validate_against(&self, cloud: &Cloud, points: &[Point]) -> Outcome {
        self.validate_reported(cloud, points, None)
    }

    /// The same with a report of the conversion.
    pub(crate) fn validate_reported(&self, cloud: &Cloud, points: &[Point], report: Option<&str>) -> Outcome {
        let folder = tempfile::tempdir().unwrap();
        self.write(folder.path());
        report.iter().for_each(|text| std::fs::write(folder.path().join("report.json"), text).unwrap());
        let scan = folder.path().join("scan.las");
        std::fs::write(&scan, las(cloud, points)).unwrap();
        let options = Options { against: vec![scan], threads: 2, ..Options::default() };
        validate(folder.path(), &options, &|_| {}).unwrap()
    }
}

pub(crate) fn check(folder: &Path) -> Outcome {
    validate(folder, &Options { threads: 2, ..Options::default() }, &|_| {}).unwrap()
}

/// Checks that found errors, with their number.
pub(crate) fn broken(outcome: &Outcome) -> Vec<(Check, u64)> {
    outcome.checks.iter().filter(|c| !c.ok).map(|c| (c.name, c.found)).collect()
}

/// Asserts that exactly these checks found that many errors, and nothing was warned of.
#[track_caller]
pub(crate) fn assert_only(outcome: &Outcome, expected: &[(Check, u64)]) {
    let lines: Vec<String> = outcome.problems.iter().map(ToString::to_string).collect();
    assert_eq!(broken(outcome), expected, "{lines:#?}");
    assert!(outcome.checks.iter().all(|c| c.warnings == 0), "{lines:#?}");
    assert_eq!(outcome.ok, expected.is_empty());
}

/// A LAS file of these points.
fn las(cloud: &Cloud, points: &[Point]) -> Vec<u8> {
    let point = |p: &Point| las::Point {
        intensity: p.intensity,
        class: p.class as u8,
        gps_time: p.gps_time,
        rgb: p.rgb,
        ..las::Point::at(p.step.map(|v| v as i32))
    };
    Las { scale: cloud.scale, offset: cloud.offset, ..Las::new(points.iter().map(point).collect()) }.bytes()
}
