//! A little writer of `.qbatch` files, from the format's page by the plainest means, to plant faults in.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::OnceLock;

use pointmill_testkit::Random;
use pointmill_validate::{Check, Options, Outcome, validate};
use serde_json::{Value, json};

use crate::surfels::{self, Surfel};

pub(crate) const BATCH: usize = 10_240;

/// One point of a source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    pub(crate) x: [i64; 3],
    pub(crate) rgb: [u8; 3],
    pub(crate) intensity: u16,
    pub(crate) class: u8,
    /// What a conversion has computed; of all points or of none.
    pub(crate) surfel: Option<Surfel>,
}

/// Points and how they are to be written.
#[derive(Debug, Clone)]
pub(crate) struct Cloud {
    pub(crate) points: Vec<Point>,
    pub(crate) scale: f64,
    pub(crate) offset: [f64; 3],
    pub(crate) cell: f64,
    pub(crate) planes: usize,
    /// Widens the box of a Morton batch before positions are encoded in it: batch, axis, min, max by ulps.
    pub(crate) loose: Option<(usize, usize, u32, u32)>,
    /// `"rgb"`, `"intensity"`, `"none"`.
    pub(crate) colour: &'static str,
}

/// A terrain of 5 × 5 × 1 units: three full batches and a part of one.
pub(crate) fn terrain() -> Cloud {
    let mut random = Random::new(9);
    let mut next = |below: u64| random.below(below) as i64;
    let points = (0..3 * BATCH + 1000)
        .map(|_| {
            let (x, y) = (next(5000) - 1700, next(5000));
            let z = 300 + ((x as f64 / 700.0).sin() * 200.0) as i64 + y / 9 + next(3);
            Point {
                x: [x, y, z],
                rgb: [next(256) as u8, next(256) as u8, next(256) as u8],
                intensity: 20 + next(1000) as u16,
                class: next(7) as u8,
                surfel: None,
            }
        })
        .collect();
    Cloud {
        points,
        scale: 0.001,
        offset: [637_000.0, -4_428_000.5, -40.0],
        cell: 1.0,
        planes: 3,
        loose: None,
        colour: "rgb",
    }
}

/// The file of [`terrain`].
pub(crate) fn good() -> Parts {
    static GOOD: OnceLock<Parts> = OnceLock::new();
    GOOD.get_or_init(|| terrain().parts()).clone()
}

/// Everything of a file, in storage order, before it becomes bytes.
#[derive(Debug, Clone)]
pub(crate) struct Parts {
    pub(crate) points: usize,
    pub(crate) origin: [f64; 3],
    pub(crate) min: [f64; 3],
    pub(crate) max: [f64; 3],
    pub(crate) cell: f64,
    pub(crate) flags: u32,
    pub(crate) exponent: u32,
    pub(crate) boxes: Vec<[[f32; 3]; 2]>,
    /// hi10, mid10, lo10.
    pub(crate) words: Vec<Vec<u32>>,
    pub(crate) colours: Vec<u32>,
    pub(crate) intensity: Vec<u16>,
    pub(crate) class: Vec<u8>,
    /// In storage order, if points have them.
    pub(crate) surfels: Vec<Surfel>,
    pub(crate) originals: Vec<(u32, u32)>,
    pub(crate) description: Value,
    /// Batches a block of compressed sections.
    pub(crate) block: Option<usize>,
    /// X Y Z in storage order, for tests that look for a point.
    pub(crate) lattice: Vec<[i64; 3]>,
    /// Storage indices in Morton order.
    pub(crate) morton: Vec<usize>,
}

fn code(v: [u64; 3]) -> u128 {
    (0..32).fold(0, |c, k| (0..3).fold(c, |c, a| c | u128::from(v[a] >> k & 1) << (3 * k + a)))
}

/// Where Morton batches go, by the exchanges of the page one by one.
pub(crate) fn slots(batches: usize) -> Vec<usize> {
    let mut slots: Vec<usize> = (0..batches).collect();
    let mut i = 1;
    while 2 * i + 1 < batches {
        slots.swap(i, batches - 1 - i);
        i += 2;
    }
    slots
}

impl Cloud {
    pub(crate) fn world(&self, p: &Point) -> [f64; 3] {
        [0, 1, 2].map(|a| p.x[a] as f64 * self.scale + self.offset[a])
    }

    fn word(&self, p: &Point) -> u32 {
        match self.colour {
            "rgb" => u32::from(p.rgb[0]) | u32::from(p.rgb[1]) << 8 | u32::from(p.rgb[2]) << 16,
            "intensity" => {
                let [lo, hi] = self.intensity_range().map(u32::from);
                ((u32::from(p.intensity) - lo) * 255 + (hi - lo) / 2) / (hi - lo) * 0x01_0101
            }
            _ => 0xff_ffff,
        }
    }

    fn intensity_range(&self) -> [u16; 2] {
        let values = || self.points.iter().map(|p| p.intensity);
        [values().min().unwrap(), values().max().unwrap()]
    }

    /// The file as the page asks for it.
    pub(crate) fn parts(&self) -> Parts {
        let n = self.points.len();
        let world: Vec<[f64; 3]> = self.points.iter().map(|p| self.world(p)).collect();
        let fold = |f: fn(f64, f64) -> f64| [0, 1, 2].map(|a| world.iter().map(|w| w[a]).reduce(f).unwrap());
        let (min, max) = (fold(f64::min), fold(f64::max));
        let origin = min.map(f64::floor);
        let r: Vec<[f64; 3]> = world.iter().map(|w| [0, 1, 2].map(|a| w[a] - origin[a])).collect();
        let u: Vec<[f64; 3]> = r.iter().map(|r| r.map(|r| r / self.cell)).collect();
        let largest = u.iter().flatten().copied().fold(0.0, f64::max);
        let exponent = (0..).find(|e| largest < 2f64.powi(*e)).unwrap();
        let bits = if exponent <= 19 { 21 } else { 32 };
        let codes: Vec<u128> =
            u.iter().map(|u| code(u.map(|u| (u * 2f64.powi(bits - exponent)).floor() as u64))).collect();
        let bytes = |p: &Point| (p.intensity.to_le_bytes(), p.class);
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by_cached_key(|i| {
            let p = &self.points[*i];
            (codes[*i], p.x, self.word(p), bytes(p))
        });

        let (mut lod, mut mean) = (vec![3u32; n], self.points.iter().map(|p| self.word(p)).collect::<Vec<_>>());
        for level in [2, 1, 0] {
            let factor = 2f64.powi(level);
            let mut cells: BTreeMap<[u64; 3], Vec<usize>> = BTreeMap::new();
            for i in &order {
                cells.entry(u[*i].map(|u| (u * factor).floor() as u64)).or_default().push(*i);
            }
            for (k, members) in cells {
                let distance = |i: usize| {
                    let d = [0, 1, 2].map(|a| u[i][a] * factor - (k[a] as f64 + 0.5));
                    (d[0] * d[0] + d[1] * d[1]) + d[2] * d[2]
                };
                let chosen = *members.iter().min_by(|a, b| distance(**a).total_cmp(&distance(**b))).unwrap();
                let count = members.len() as u64;
                lod[chosen] = level as u32;
                mean[chosen] = [0, 8, 16].iter().fold(0, |word, shift| {
                    let sum: u64 = members.iter().map(|i| u64::from(self.word(&self.points[*i]) >> shift & 255)).sum();
                    word | (((sum + count / 2) / count) as u32) << shift
                });
            }
        }

        let batches = n.div_ceil(BATCH);
        let slots = slots(batches);
        let mut parts = Parts {
            points: n,
            origin,
            min,
            max,
            cell: self.cell,
            flags: 15,
            exponent: exponent as u32,
            boxes: vec![[[0.0; 3]; 2]; batches],
            words: vec![vec![0; n]; 3],
            colours: vec![0; n],
            intensity: vec![0; n],
            class: vec![0; n],
            surfels: Vec::new(),
            originals: Vec::new(),
            description: Value::Null,
            block: None,
            lattice: vec![[0; 3]; n],
            morton: Vec::new(),
        };
        let mut figures = [[[0.0f64; 3]; 3]; 2];
        for (m, members) in order.chunks(BATCH).enumerate() {
            let first = slots[m] * BATCH;
            let mut sums = [[0.0; 3]; 3];
            for axis in 0..3 {
                let values = || members.iter().map(|i| r[*i][axis]);
                let [low, high] = [values().reduce(f64::min).unwrap(), values().reduce(f64::max).unwrap()];
                let (mut min, mut max) = (low as f32, high as f32);
                if f64::from(min) > low {
                    min = min.next_down();
                }
                if f64::from(max) < high {
                    max = max.next_up();
                }
                if let Some((batch, loose_axis, down, up)) = self.loose
                    && (batch, loose_axis) == (m, axis)
                {
                    (0..down).for_each(|_| min = min.next_down());
                    (0..up).for_each(|_| max = max.next_up());
                }
                parts.boxes[slots[m]][0][axis] = min;
                parts.boxes[slots[m]][1][axis] = max;
                let (corner, side) = (f64::from(min), f64::from(max) - f64::from(min));
                for (j, i) in members.iter().enumerate() {
                    let q = if side == 0.0 {
                        0
                    } else {
                        (((r[*i][axis] - corner) / side * 2f64.powi(30)).floor() as u64).min((1 << 30) - 1)
                    };
                    for plane in 0..3 {
                        parts.words[plane][first + j] |= (q as u32 >> (20 - 10 * plane) & 1023) << (10 * axis);
                        let b = 10 * (plane as i32 + 1);
                        let t = (q >> (30 - b)) as f64;
                        let decoded = if side == 0.0 { corner } else { corner + (t + 0.5) * side / 2f64.powi(b) };
                        let error = (decoded - r[*i][axis]).abs();
                        figures[0][plane][axis] = figures[0][plane][axis].max(error);
                        sums[plane][axis] += error * error;
                    }
                }
            }
            figures[1].iter_mut().flatten().zip(sums.iter().flatten()).for_each(|(a, b)| *a += b);
            for (j, i) in members.iter().enumerate() {
                let (at, p) = (first + j, &self.points[*i]);
                parts.colours[at] = mean[*i] | lod[*i] << 24;
                parts.intensity[at] = p.intensity;
                parts.class[at] = p.class;
                if let Some(surfel) = p.surfel {
                    parts.surfels.resize(n, [0.0; 5]);
                    parts.surfels[at] = surfel;
                }
                parts.lattice[at] = p.x;
                parts.morton.push(at);
                if mean[*i] != self.word(p) {
                    parts.originals.push((at as u32, self.word(p)));
                }
            }
        }
        parts.originals.sort_unstable();
        if parts.originals.is_empty() {
            parts.flags = 3;
        }
        let errors = (0..self.planes).map(|plane| {
            let rms = figures[1][plane].map(|sum| (sum / n as f64).sqrt());
            ((10 * (plane + 1)).to_string(), json!({ "max": figures[0][plane], "rms": rms }))
        });
        let ([lo, hi], step) = (self.intensity_range(), [self.scale; 3]);
        parts.words.truncate(self.planes);
        let derived = |name: &str| json!({ "name": name, "type": "float", "elements": 1 });
        let derived = surfels::NAMES.iter().filter(|_| !parts.surfels.is_empty()).map(|name| derived(name));
        let mut attributes = vec![
            json!({ "name": "intensity", "type": "uint16", "elements": 1, "min": [lo], "max": [hi] }),
            json!({ "name": "classification", "type": "uint8", "elements": 1 }),
        ];
        attributes.extend(derived);
        parts.description = json!({
            "version": "0.1.0", "name": "terrain", "projection": "",
            "lattice": { "scale": step, "offset": self.offset },
            "attributes": attributes,
            "colour": self.colour,
            "errors": serde_json::Map::from_iter(errors),
            "sourceStep": step,
            "intensityRange": [lo, hi],
        });
        parts
    }
}

impl Parts {
    /// The bytes of the file, and where its sections begin.
    pub(crate) fn bytes(&self) -> (Vec<u8>, BTreeMap<&'static str, usize>) {
        let (mut out, mut places) = (vec![0; 256], BTreeMap::new());
        let mut section = |out: &mut Vec<u8>, name: &'static str, data: &[u8]| {
            out.resize(out.len().next_multiple_of(256), 0);
            places.insert(name, out.len());
            out.extend(data);
        };
        let le = |words: &[u32]| words.iter().flat_map(|w| w.to_le_bytes()).collect::<Vec<u8>>();
        let mut records = Vec::new();
        for (slot, [min, max]) in self.boxes.iter().enumerate() {
            min.iter().for_each(|v| records.extend(v.to_le_bytes()));
            records.extend(((slot * BATCH) as u32).to_le_bytes());
            max.iter().for_each(|v| records.extend(v.to_le_bytes()));
            records.extend((self.points.saturating_sub(slot * BATCH).min(BATCH) as u32).to_le_bytes());
        }
        section(&mut out, "batches", &records);
        section(&mut out, "hi10", &self.pack(&le(&self.words[0]), 4));
        section(&mut out, "colour", &self.pack(&le(&self.colours), 4));
        let intensity: Vec<u8> = self.intensity.iter().flat_map(|v| v.to_le_bytes()).collect();
        let mut extras = vec![("intensity", self.pack(&intensity, 2)), ("classification", self.pack(&self.class, 1))];
        for (i, name) in surfels::NAMES.into_iter().enumerate().filter(|_| !self.surfels.is_empty()) {
            let values: Vec<u8> = self.surfels.iter().flat_map(|surfel| surfel[i].to_le_bytes()).collect();
            extras.push((name, self.pack(&values, 4)));
        }
        extras.iter().for_each(|(name, bytes)| section(&mut out, name, bytes));
        for (plane, name) in [(1, "mid10"), (2, "lo10")] {
            if let Some(words) = self.words.get(plane) {
                section(&mut out, name, &self.pack(&le(words), 4));
            }
        }
        if self.flags & 8 != 0 {
            let mut data = (self.originals.len() as u64).to_le_bytes().to_vec();
            self.originals.iter().for_each(|(i, w)| data.extend(le(&[*i, *w])));
            section(&mut out, "originals", &data);
        }
        let mut description = self.description.clone();
        let listed = description["attributes"].is_array();
        for (i, (_, bytes)) in extras.iter().enumerate() {
            if listed && description["attributes"][i].get("bytes").is_none() {
                description["attributes"][i]["bytes"] = json!(bytes.len());
            }
        }
        // places of attributes are known by now
        section(&mut out, "description", &[]);
        let at = |name: &str| places.get(name).copied().unwrap_or(0) as u64;
        for (i, (name, _)) in extras.iter().enumerate().filter(|_| listed) {
            description["attributes"][i]["offset"] = json!(at(name));
        }
        let text = description.to_string();
        out.extend(text.as_bytes());
        let bits: u32 = if self.exponent <= 19 { 21 } else { 32 };
        let mut header = b"QBATCHES".to_vec();
        header.extend(le(&[1, 256]));
        header.extend((self.points as u64).to_le_bytes());
        header.extend(le(&[BATCH as u32, self.boxes.len() as u32]));
        let numbers = self.origin.iter().chain(&self.min).chain(&self.max).chain([&self.cell]);
        numbers.for_each(|v| header.extend(v.to_le_bytes()));
        header.extend(le(&[self.flags | if self.block.is_some() { 16 } else { 0 }, bits]));
        for name in ["batches", "hi10", "mid10", "lo10", "colour", "originals", "description"] {
            header.extend(at(name).to_le_bytes());
        }
        header.extend((text.len() as u64).to_le_bytes());
        header.extend(le(&[self.exponent, 0]));
        out[..header.len()].copy_from_slice(&header);
        (out, places)
    }

    /// A section as it stands in the file: raw, or zstd blocks.
    fn pack(&self, data: &[u8], stride: usize) -> Vec<u8> {
        let Some(k) = self.block else { return data.to_vec() };
        let frames: Vec<Vec<u8>> =
            data.chunks(k * BATCH * stride).map(|b| zstd::bulk::compress(b, 1).unwrap()).collect();
        let mut out = [(k as u32).to_le_bytes(), (frames.len() as u32).to_le_bytes()].concat();
        let mut at = 16 + 8 * frames.len();
        out.extend((at as u64).to_le_bytes());
        for frame in &frames {
            at += frame.len();
            out.extend((at as u64).to_le_bytes());
        }
        frames.iter().for_each(|f| out.extend(f));
        out
    }

    pub(crate) fn validate(&self) -> Outcome {
        check(&self.bytes().0)
    }

    /// The level of a stored point.
    pub(crate) fn level(&self, at: usize) -> u32 {
        self.colours[at] >> 24
    }

    /// Exchanges all that two points have but their places.
    pub(crate) fn exchange(&mut self, a: usize, b: usize) {
        self.words.iter_mut().for_each(|w| w.swap(a, b));
        self.colours.swap(a, b);
        self.intensity.swap(a, b);
        self.class.swap(a, b);
        self.lattice.swap(a, b);
    }
}

/// Checks the bytes of a file.
pub(crate) fn check(bytes: &[u8]) -> Outcome {
    check_with(bytes, &[])
}

/// Checks the bytes of a file against sources: name and bytes.
pub(crate) fn check_with(bytes: &[u8], sources: &[(&str, Vec<u8>)]) -> Outcome {
    check_reported(bytes, sources, None)
}

/// The same with a report of the conversion.
pub(crate) fn check_reported(bytes: &[u8], sources: &[(&str, Vec<u8>)], report: Option<&str>) -> Outcome {
    let folder = tempfile::tempdir().unwrap();
    report.iter().for_each(|text| std::fs::write(folder.path().join("report.json"), text).unwrap());
    let path = folder.path().join("points.qbatch");
    std::fs::write(&path, bytes).unwrap();
    let mut options = Options { threads: 2, ..Options::default() };
    for (name, bytes) in sources {
        let source = folder.path().join(name);
        std::fs::write(&source, bytes).unwrap();
        options.against.push(source);
    }
    let dataset: &Path = if sources.is_empty() { &path } else { folder.path() };
    validate(dataset, &options, &|_| {}).unwrap()
}

/// The checks that found errors.
pub(crate) fn broken(outcome: &Outcome) -> Vec<Check> {
    outcome.checks.iter().filter(|c| !c.ok).map(|c| c.name).collect()
}

/// Exactly `found` errors, all of one check, and no warnings.
pub(crate) fn assert_only(outcome: &Outcome, check: Check, found: u64) {
    assert_eq!(broken(outcome), [check], "{:#?}", outcome.problems);
    let result = outcome.check(check).unwrap();
    assert_eq!((result.found, result.warnings), (found, 0), "{:#?}", outcome.problems);
    assert!(!outcome.ok);
}
