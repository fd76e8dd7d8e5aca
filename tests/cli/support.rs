//! A folder to work in, the program, and a writer of small LAS files that may say anything.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// One temporary folder per test.
pub(crate) struct Dir(tempfile::TempDir);

impl Dir {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, bytes).unwrap();
        path
    }

    /// Names of everything in the folder, sorted.
    pub(crate) fn names(&self) -> Vec<String> {
        let mut names: Vec<String> =
            fs::read_dir(self.0.path()).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    /// The program, about to be started in this folder.
    pub(crate) fn command<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_pointmill"));
        command.args(args).current_dir(self.0.path()).env_remove("RUST_BACKTRACE");
        command
    }

    /// Runs the program in this folder.
    pub(crate) fn run<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Ended {
        Ended(self.command(args).output().unwrap())
    }

    /// Runs the program, which must succeed.
    pub(crate) fn succeed<S: AsRef<OsStr>>(&self, args: impl IntoIterator<Item = S>) -> Ended {
        let ended = self.run(args);
        assert_eq!(ended.code(), 0, "{}", ended.stderr());
        ended
    }

    /// The run report of a dataset.
    pub(crate) fn report(&self, dataset: &str) -> Value {
        serde_json::from_slice(&fs::read(self.path(dataset).join("report.json")).unwrap()).unwrap()
    }

    /// Proves that the dataset is in order and holds the points of `inputs`.
    pub(crate) fn validate(&self, dataset: &str, inputs: &[&str]) {
        let mut args = vec!["validate", dataset, "-q"];
        if !inputs.is_empty() {
            args.push("--against");
            args.extend(inputs);
        }
        let ended = self.run(args);
        assert_eq!(ended.code(), 0, "{}{}", ended.stdout(), ended.stderr());
    }
}

/// A run that has ended.
pub(crate) struct Ended(pub(crate) Output);

impl Ended {
    pub(crate) fn code(&self) -> i32 {
        self.0.status.code().unwrap_or_else(|| panic!("{:?}: {}", self.0.status, self.stderr()))
    }

    pub(crate) fn stdout(&self) -> String {
        String::from_utf8(self.0.stdout.clone()).unwrap()
    }

    pub(crate) fn stderr(&self) -> String {
        String::from_utf8(self.0.stderr.clone()).unwrap()
    }

    /// Asserts that the run failed with `code` and one line that holds all of `words`.
    pub(crate) fn failed_with(&self, code: i32, words: &[&str]) {
        let stderr = self.stderr();
        assert_eq!(self.code(), code, "{stderr}");
        let line = stderr.lines().last().unwrap_or_default();
        assert!(line.starts_with("pointmill: "), "{stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
        for word in words {
            assert!(line.contains(word), "`{word}` is not in: {line}");
        }
    }
}

/// The three files of a dataset, to be compared byte for byte.
pub(crate) fn dataset_bytes(folder: &Path) -> [Vec<u8>; 3] {
    ["metadata.json", "hierarchy.bin", "octree.bin"].map(|name| fs::read(folder.join(name)).unwrap())
}

/// A file of the collection of real scans, good and broken; `None`, said on standard error, where it is not at hand.
pub(crate) fn corpus(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/corpus").join(name);
    if !path.exists() {
        eprintln!("skipped: {} is not at hand", path.display());
        return None;
    }
    Some(path)
}

/// A file or folder of `fixtures/`.
pub(crate) fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name)
}

/// A LAS 1.2 file, point format 3 (34 bytes a point), written field by field so that any of them can lie.
#[derive(Clone)]
pub(crate) struct Las {
    pub(crate) points: Vec<[i32; 3]>,
    pub(crate) scale: [f64; 3],
    pub(crate) offset: [f64; 3],
    /// Instead of the time that grows with the index.
    pub(crate) gps_time: Option<f64>,
    /// Instead of the number of points.
    pub(crate) points_declared: Option<u32>,
}

impl Las {
    pub(crate) fn new(points: Vec<[i32; 3]>) -> Self {
        Self { points, scale: [0.01; 3], offset: [500_000.0, 5_400_000.0, 0.0], gps_time: None, points_declared: None }
    }

    /// A hilly square of `n` points with ten points a square metre, the same for the same `n` and `seed`.
    pub(crate) fn terrain(n: usize, seed: u64) -> Self {
        let mut state = seed.wrapping_mul(2).wrapping_add(1);
        let mut random = |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        let side = ((n as f64 * 1000.0).sqrt() as u64).max(1);
        let point = |_| {
            let (x, y) = (random(side), random(side));
            let z = (x as f64 / 900.0).sin() * 800.0 + (y as f64 / 700.0).cos() * 500.0;
            [x as i32, y as i32, z as i32 + random(10) as i32]
        };
        Self::new((0..n).map(point).collect())
    }

    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(227 + 34 * self.points.len());
        out.extend(b"LASF");
        out.extend([0; 20]); // source id, encoding, project id
        out.extend([1, 2]);
        out.extend([0; 32 + 32 + 4]); // system, software, date
        out.extend(227u16.to_le_bytes());
        out.extend(227u32.to_le_bytes());
        out.extend(0u32.to_le_bytes()); // variable length records
        out.push(3);
        out.extend(34u16.to_le_bytes());
        let count = self.points.len() as u32;
        out.extend(self.points_declared.unwrap_or(count).to_le_bytes());
        out.extend(self.points_declared.unwrap_or(count).to_le_bytes());
        out.extend([0; 16]); // other returns
        self.scale.iter().chain(&self.offset).for_each(|v| out.extend(v.to_le_bytes()));
        for axis in 0..3 {
            let world = |q: i32| f64::from(q) * self.scale[axis] + self.offset[axis];
            let max = self.points.iter().map(|p| p[axis]).max().unwrap_or(0);
            let min = self.points.iter().map(|p| p[axis]).min().unwrap_or(0);
            out.extend(world(max).to_le_bytes());
            out.extend(world(min).to_le_bytes());
        }
        for (i, point) in self.points.iter().enumerate() {
            point.iter().for_each(|v| out.extend(v.to_le_bytes()));
            out.extend((i as u16).to_le_bytes()); // intensity
            out.extend([0b0000_1001, [2u8, 5, 6][i % 3], (i % 40) as u8, 7]); // returns, class, scan angle, user data
            out.extend(11u16.to_le_bytes());
            out.extend(self.gps_time.unwrap_or(i as f64 * 0.001).to_le_bytes());
            [i as u16, (i >> 8) as u16, 0xFFFF].iter().for_each(|v| out.extend(v.to_le_bytes()));
        }
        out
    }
}

/// A LAS 1.4 file, point format 6, whose 64-bit count says `declared`.
pub(crate) fn las_1_4(points: u8, declared: u64) -> Vec<u8> {
    let mut out = vec![0u8; 375];
    out[..4].copy_from_slice(b"LASF");
    out[24..26].copy_from_slice(&[1, 4]);
    out[94..96].copy_from_slice(&375u16.to_le_bytes());
    out[96..100].copy_from_slice(&375u32.to_le_bytes());
    out[104] = 6;
    out[105..107].copy_from_slice(&30u16.to_le_bytes());
    for axis in 0..3 {
        out[131 + 8 * axis..139 + 8 * axis].copy_from_slice(&0.01f64.to_le_bytes());
        out[179 + 16 * axis..187 + 16 * axis].copy_from_slice(&2.55f64.to_le_bytes()); // highest
    }
    out[247..255].copy_from_slice(&declared.to_le_bytes());
    for i in 0..points {
        let mut record = [0u8; 30];
        [0, 4, 8].into_iter().for_each(|at| record[at] = i.wrapping_mul(37)); // x, y, z
        record[14] = 0x11; // first of one return
        record[16] = 2;
        out.extend(record);
    }
    out
}
