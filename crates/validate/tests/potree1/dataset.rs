//! The tiny octree of all octree tests as Potree 1.x, written from the format page by the plainest means.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use pointmill_format::NodeKey;
use pointmill_validate::{Options, Outcome, validate};
use serde_json::{Value, json};

use crate::support::{Cloud, OFFSET, Point, SCALE, SIDE, Sampler};

/// Stored steps of a lattice step.
pub(crate) const FINE: i32 = 4;
pub(crate) const STEP: usize = 2;

/// The files of a dataset, to be broken and written.
#[derive(Debug, Clone)]
pub(crate) struct Files {
    pub(crate) cloud: Value,
    /// Replaces the text of `cloud`.
    pub(crate) text: Option<String>,
    pub(crate) others: BTreeMap<String, Vec<u8>>,
}

/// The good dataset.
pub(crate) fn good() -> Files {
    encode(&Cloud::new(Sampler::Poisson))
}

/// Bytes of a point.
pub(crate) const STRIDE: usize = 18;

fn record(key: NodeKey, point: &Point) -> Vec<u8> {
    let side = SIDE >> key.level;
    let corner = [key.x, key.y, key.z].map(|v| v as i32 * side);
    let mut out = Vec::new();
    (0..3).for_each(|a| out.extend(((point.position[a] - corner[a]) * FINE).to_le_bytes()));
    out.extend(point.rgb.map(|v| ((u32::from(v) * 255 + 32_767) / 65_535) as u8));
    out.push(255);
    out.extend(point.intensity.to_le_bytes());
    out.extend(point.surfel.iter().flat_map(|[x, y, z, ..]| oct16([*x, *y, *z])));
    out
}

/// A normal in two bytes; upwards, if it is none.
fn oct16(normal: [f32; 3]) -> [u8; 2] {
    let [x, y, z] = if normal == [0.0; 3] { [0.0, 0.0, 1.0] } else { normal };
    let s = 1.0 / (x.abs() + y.abs() + z.abs());
    let sign = |v: f32| if v < 0.0 { -1.0 } else { 1.0 };
    let [u, v] = match z >= 0.0 {
        true => [x * s, y * s],
        false => [sign(x) * (1.0 - y.abs() * s), sign(y) * (1.0 - x.abs() * s)],
    };
    [u, v].map(|v| ((v + 1.0) * 128.0).min(255.0) as u8)
}

pub(crate) fn encode(cloud: &Cloud) -> Files {
    let mut others = BTreeMap::new();
    for (key, points) in &cloud.nodes {
        let bytes: Vec<u8> = points.iter().flat_map(|p| record(*key, p)).collect();
        others.insert(path(*key, "bin"), bytes);
        if *key == NodeKey::ROOT || usize::from(key.level).is_multiple_of(STEP) && cloud.is_inner(*key) {
            others.insert(path(*key, "hrc"), index(cloud, *key));
        }
    }
    Files { cloud: description(cloud), text: None, others }
}

/// `data/r/01/r012.bin`
pub(crate) fn path(key: NodeKey, extension: &str) -> String {
    let name = key.to_string();
    let groups = name.as_bytes()[1..].chunks_exact(STEP).map(|group| format!("/{}", String::from_utf8_lossy(group)));
    format!("data/r{}/{name}.{extension}", groups.collect::<String>())
}

/// The levels of the node to [`STEP`] below it.
fn index(cloud: &Cloud, root: NodeKey) -> Vec<u8> {
    let (mut bytes, mut row) = (Vec::new(), vec![root]);
    for _ in 0..=STEP {
        let mut next = Vec::new();
        for key in row {
            let children = (0..8).filter(|c| cloud.nodes.contains_key(&key.child(*c).unwrap()));
            let children: Vec<u8> = children.collect();
            bytes.push(children.iter().fold(0, |mask, child| mask | 1 << child));
            bytes.extend((cloud.nodes[&key].len() as u32).to_le_bytes());
            next.extend(children.into_iter().map(|c| key.child(c).unwrap()));
        }
        row = next;
    }
    bytes
}

fn corners(low: [f64; 3], high: [f64; 3]) -> Value {
    json!({ "lx": low[0], "ly": low[1], "lz": low[2], "ux": high[0], "uy": high[1], "uz": high[2] })
}

fn description(cloud: &Cloud) -> Value {
    let side = f64::from(SIDE) * SCALE;
    let world = |pick: fn(i32, i32) -> i32| {
        [0, 1, 2].map(|a| {
            let steps = cloud.points().map(|p| p.position[a]).reduce(pick).unwrap();
            f64::from(steps) * SCALE + OFFSET[a]
        })
    };
    let mut attributes = vec!["POSITION_CARTESIAN", "COLOR_PACKED", "INTENSITY"];
    attributes.extend(cloud.has_surfels().then_some("NORMAL_OCT16"));
    json!({
        "version": "1.7",
        "octreeDir": "data",
        "projection": "",
        "points": cloud.points().count(),
        "boundingBox": corners(OFFSET, OFFSET.map(|v| v + side)),
        "tightBoundingBox": corners(world(i32::min), world(i32::max)),
        "pointAttributes": attributes,
        "spacing": side / 128.0,
        "scale": SCALE / f64::from(FINE),
        "hierarchyStepSize": STEP,
        "pointmill": {
            "version": "0.1.0", "rgbDepth": "auto", "duplicates": "keep",
            "sampling": if cloud.sampler == Sampler::Poisson { "poisson" } else { "grid" },
            "lattice": { "scale": [SCALE, SCALE, SCALE], "offset": OFFSET },
        },
    })
}

impl Files {
    pub(crate) fn file(&mut self, key: NodeKey, extension: &str) -> &mut Vec<u8> {
        self.others.get_mut(&path(key, extension)).unwrap()
    }

    /// A node whose index is in two files.
    pub(crate) fn border(&self) -> NodeKey {
        let mut names = self.others.keys().filter_map(|name| name.strip_suffix(".hrc")?.rsplit('/').next());
        names.find(|name| name.len() == STEP + 1).unwrap().parse().unwrap()
    }

    /// A leaf of the root's index, and where its record is.
    pub(crate) fn leaf(&self) -> (NodeKey, usize) {
        let records = self.others["data/r/r.hrc"].as_chunks::<5>().0;
        let mut names = vec![NodeKey::ROOT];
        for (i, record) in records.iter().enumerate() {
            let key = names[i];
            if record[0] == 0 {
                return (key, 5 * i);
            }
            if usize::from(key.level) < STEP {
                let children = (0..8).filter(|c| record[0] >> c & 1 == 1);
                names.extend(children.map(|c| key.child(c).unwrap()));
            }
        }
        panic!("no leaf");
    }

    pub(crate) fn write(&self, folder: &Path) {
        let text = self.text.clone().unwrap_or_else(|| self.cloud.to_string());
        fs::write(folder.join("cloud.js"), text).unwrap();
        for (name, bytes) in &self.others {
            let path = folder.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, bytes).unwrap();
        }
    }

    /// Writes and validates.
    pub(crate) fn validate(&self) -> Outcome {
        let folder = tempfile::tempdir().unwrap();
        self.write(folder.path());
        validate(folder.path(), &Options { threads: 2, ..Options::default() }, &|_| {}).unwrap()
    }

    /// Writes and validates against a LAS file.
    pub(crate) fn validate_against(&self, las: &[u8]) -> Outcome {
        let folder = tempfile::tempdir().unwrap();
        self.write(folder.path());
        let source = folder.path().join("source.las");
        fs::write(&source, las).unwrap();
        let options = Options { against: vec![source], threads: 2, ..Options::default() };
        validate(folder.path(), &options, &|_| {}).unwrap()
    }
}
