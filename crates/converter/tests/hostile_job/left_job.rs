//! What a job holds for others to go on with, to be changed and given its checksums again: for the tests here and for the fuzz
//! target, which includes this file.

#[path = "job_file.rs"]
mod job_file;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use job_file::JobFile;
use pointmill_converter::{
    BatchesSettings, BintreeSettings, Checkpoint, ConvertError, CopcSettings, Disk, DiskOperation, JobFault, Plan,
    Potree1Settings, Potree2Settings, Report, Silent, Target, convert, convert_on, finish_job, job_units, plan_job,
    run_units,
};
use pointmill_format::bintree::Layout;
use pointmill_format::{OpenOptions, ReadError, Wanted, open_scan};
use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;
use pointmill_testkit::reader;

/// Kinds of jobs: outputs, each of a job that a run has left, and of one that processes share.
pub(crate) const JOBS: usize = 16;

/// Of the kinds, those whose tree has several units: they have so many more points.
pub(crate) const LARGE: [usize; 2] = [2, 3];
const LARGER: usize = 16;

/// No job takes more rounds of doing what is open: each does a unit, or finds one that is to be done again.
const MOST_ROUNDS: usize = 30;

/// Points of a task of binary trees and batches: there are several.
const TASK_POINTS: u64 = 400;

fn target(kind: usize) -> Target {
    match kind / 2 {
        0 | 1 => Potree2Settings { leaf_capacity: 100, ..Potree2Settings::default() }.into(),
        2 => Potree1Settings { leaf_capacity: 100, ..Potree1Settings::default() }.into(),
        3 => CopcSettings { leaf_capacity: 100, ..CopcSettings::default() }.into(),
        4 => BintreeSettings { capacity: 100, layout: Layout::Files, ..BintreeSettings::default() }.into(),
        5 => BintreeSettings { capacity: 100, layout: Layout::Packed, ..BintreeSettings::default() }.into(),
        6 => BatchesSettings::default().into(),
        _ => BatchesSettings { zstd_level: Some(3), ..BatchesSettings::default() }.into(),
    }
}

/// A part of a file of a job, by the name of the file.
pub(crate) type PartName = (String, usize);

/// Fails from its Nth operation on.
#[derive(Debug)]
struct Ending {
    at: u64,
    asked: AtomicU64,
}

impl Disk for Ending {
    fn permit(&self, _: DiskOperation) -> std::io::Result<()> {
        match self.asked.fetch_add(1, Ordering::Relaxed) < self.at {
            true => Ok(()),
            false => Err(std::io::ErrorKind::StorageFull.into()),
        }
    }
}

/// What an output is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Made {
    /// Its bytes are those of one run.
    Plain,
    /// Its points are.
    SamePoints,
    Other,
}

/// A job, the run or the processes of which have ended when all was read and built, but nothing was put together.
pub(crate) struct LeftJob {
    plan: Plan,
    targets: Vec<Target>,
    /// Several processes have shared it.
    is_shared: bool,
    files: BTreeMap<String, JobFile>,
    /// The files of units have three sections, and bytes of nodes behind them; else these are the first one.
    is_octree: bool,
    /// Bytes are in the files of units, not in the output.
    holds_bytes: bool,
    /// The bytes of one run, its report, and its points.
    plain: (BTreeMap<String, Vec<u8>>, Report, Vec<Vec<i128>>),
}

impl LeftJob {
    /// One of the [`JOBS`].
    pub(crate) fn of(kind: usize, folder: &Path, points: usize) -> Self {
        let points = if LARGE.contains(&kind) { points * LARGER } else { points };
        let mut job = Self::new(kind, folder, points);
        job.files = if job.is_shared { job.share() } else { job.end_late() };
        job
    }

    /// Of two scans of `points` points, in `folder`.
    fn new(kind: usize, folder: &Path, points: usize) -> Self {
        fs::create_dir_all(folder).unwrap();
        let (targets, is_shared, is_octree) = (vec![target(kind)], kind % 2 == 1, kind < 8);
        let holds_bytes = is_shared || !cfg!(unix) || matches!(kind / 2, 2 | 7);
        let scan = |seed: u64| {
            let path = folder.join(format!("{seed}.las"));
            fs::write(&path, Las::terrain(points, seed).bytes()).unwrap();
            path
        };
        let mut plan = Plan::new([1, 2].map(scan).into(), folder.join("out"));
        (plan.threads, plan.checkpoint, plan.checkpoint_points) = (1, Checkpoint::Always, points as u64);
        (plan.memory_bytes, plan.name, plan.task_points) = (400 << 20, "cloud".into(), Some(TASK_POINTS));
        let plain = Plan { checkpoint: Checkpoint::Never, output: folder.join("plain"), ..plan.clone() };
        let report = convert(&plain, &targets, &Silent).unwrap();
        let plain = (dataset(&plain.output), report, points_of(&plain.output).unwrap());
        Self { plan, targets, is_shared, files: BTreeMap::new(), is_octree, holds_bytes, plain }
    }

    /// Lets a run end as late as units are there. The journal is written by a thread of its own: which operation is the Nth differs.
    fn end_late(&mut self) -> BTreeMap<String, JobFile> {
        let (operations, _) = self.end_at(u64::MAX);
        (0..20)
            .flat_map(|_| (0..operations).rev())
            .find_map(|at| self.left_at(at))
            .expect("a run leaves a job with units")
    }

    /// What a run leaves that ends at an operation, if a unit is of use.
    fn left_at(&mut self, at: u64) -> Option<BTreeMap<String, JobFile>> {
        self.plan.resume = false;
        if !self.end_at(at).1 || !self.folder().exists() {
            return None;
        }
        let files = files_of(&self.folder());
        fs::remove_dir_all(self.folder()).unwrap();
        if !files.keys().any(|name| name.starts_with("build-")) {
            return None;
        }
        self.plan.resume = true;
        let (report, made) = self.go_on(&files).unwrap();
        assert_eq!(made, Made::Plain, "ended at operation {at}");
        (report.recalled_units > 0).then_some(files)
    }

    fn end_at(&self, at: u64) -> (u64, bool) {
        let disk = Arc::new(Ending { at, asked: AtomicU64::new(0) });
        let is_ended = convert_on(Arc::clone(&disk) as _, &self.plan, &self.targets, &Silent).is_err();
        let _ = fs::remove_dir_all(&self.plan.output);
        (disk.asked.load(Ordering::Relaxed), is_ended)
    }

    /// Does all units of a new job; of a tree with several, that at the top is left to be done again.
    fn share(&self) -> BTreeMap<String, JobFile> {
        let folder = self.folder();
        plan_job(&self.plan, &self.targets, &folder, &Silent).unwrap();
        self.do_units().unwrap();
        let mut files = files_of(&folder);
        fs::remove_dir_all(folder).unwrap();
        let number = |name: &str| name.strip_prefix("units/build-0-").and_then(|number| number.parse().ok());
        if let Some(top) = files.keys().filter_map(|name| number(name)).max().filter(|top: &u32| *top > 0) {
            files.remove(&format!("units/build-0-{top}"));
        }
        files
    }

    /// Does the units of the job that are not done.
    fn do_units(&self) -> Result<(), ConvertError> {
        let folder = self.folder();
        for _ in 0..MOST_ROUNDS {
            let known = job_units(&self.plan, &self.targets, &folder, &Silent)?;
            if known.complete {
                return Ok(());
            }
            let ready: Vec<_> = known.ready().map(|unit| unit.name).collect();
            assert!(!ready.is_empty(), "{known:?}");
            run_units(&self.plan, &self.targets, &folder, &ready, None, &Silent)?;
        }
        panic!("the units of a job do not come to an end");
    }

    /// Does the units of the job that are not done, or turn out not to be, and puts all together.
    fn finish(&self) -> Result<Report, ConvertError> {
        for _ in 0..MOST_ROUNDS {
            self.do_units()?;
            match finish_job(&self.plan, &self.targets, &self.folder(), &Silent, &|_| Ok(())) {
                Err(ConvertError::Job(JobFault::Unfinished { .. })) => {}
                ended => return ended,
            }
        }
        panic!("a job does not come to an end");
    }

    fn folder(&self) -> PathBuf {
        self.plan.output.with_file_name(if self.is_shared { "job" } else { "out.job" })
    }

    /// Parts that say something. Bytes of the output among them are left out: with right checksums, nothing tells them from others.
    pub(crate) fn parts(&self) -> Vec<PartName> {
        let says = |name: &str, part: usize| match (name.contains("build-"), self.is_octree) {
            (true, true) => part < 3 || !self.holds_bytes,
            (true, false) => part > 0,
            (false, _) => true,
        };
        let of = |(name, file): (&String, &JobFile)| {
            let parts = (0..file.parts().len()).filter(|part| says(name, *part));
            parts.map(|part| (name.clone(), part)).collect::<Vec<_>>()
        };
        self.files.iter().flat_map(of).collect()
    }

    /// A part as it was left.
    pub(crate) fn part(&self, (file, part): &PartName) -> &[u8] {
        &self.files[file].parts()[*part]
    }

    /// The files, with other bytes in the place of some parts.
    pub(crate) fn with(&self, changed: &[(PartName, Vec<u8>)]) -> BTreeMap<String, JobFile> {
        let mut files = self.files.clone();
        for ((file, part), bytes) in changed {
            files.get_mut(file).unwrap().parts_mut()[*part].clone_from(bytes);
        }
        files
    }

    /// Goes on with these files. Nothing is left of it. Also returns what the output was.
    ///
    /// # Errors
    /// As the run.
    ///
    /// # Panics
    /// The error is no line, there is half an output, or the sums of its points are not those of the scans.
    pub(crate) fn go_on(&self, files: &BTreeMap<String, JobFile>) -> Result<(Report, Made), ConvertError> {
        self.write(files);
        let folder = self.folder();
        let ended = match self.is_shared {
            true => self.finish(),
            false => convert(&self.plan, &self.targets, &Silent),
        };
        let ended = ended.map(|report| {
            let made = self.made(&report);
            (report, made)
        });
        if let Err(error) = &ended {
            let line = error.to_string();
            assert!(!line.is_empty() && !line.contains('\n'), "{line}");
            assert!(!self.plan.output.exists(), "{line}: and there is an output");
        }
        for left in [folder, self.plan.output.clone()].iter().filter(|left| left.exists()) {
            fs::remove_dir_all(left).unwrap();
        }
        ended
    }

    fn made(&self, report: &Report) -> Made {
        let sums = |report: &Report| -> Vec<(u64, String)> {
            report.outputs.iter().map(|output| (output.points, output.checksum.clone())).collect()
        };
        assert_eq!(sums(report), sums(&self.plain.1));
        match dataset(&self.plan.output) == self.plain.0 {
            true => Made::Plain,
            false if points_of(&self.plan.output).is_ok_and(|points| points == self.plain.2) => Made::SamePoints,
            false => Made::Other,
        }
    }

    fn write(&self, files: &BTreeMap<String, JobFile>) {
        for (name, file) in files {
            let path = self.folder().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, file.bytes()).unwrap();
        }
    }
}

/// The points of a dataset, in no order: positions in millimetres, and all attributes.
fn points_of(folder: &Path) -> Result<Vec<Vec<i128>>, ReadError> {
    let scan = open_scan(folder, &OpenOptions::default())?;
    let mut cloud = reader::read(scan.as_ref(), &Wanted::all(scan.info()));
    cloud.errors.pop().map_or(Ok(()), Err)?;
    let (scale, offset) = cloud.info.lattice.map_or(([1.0; 3], [0.0; 3]), |l| (l.scale, l.offset));
    let steps = |a: usize| cloud.xyz[a].iter().map(|v| ((v * scale[a] + offset[a]) * 1000.0).round() as i128).collect();
    let mut columns: Vec<Vec<i128>> = (0..3).map(steps).collect();
    columns.extend(cloud.columns.iter().map(reader::integers));
    let elements = |column: &Vec<i128>| column.len() / cloud.len();
    let row = |i: usize| columns.iter().flat_map(|c| c[i * elements(c)..(i + 1) * elements(c)].to_vec()).collect();
    let mut rows: Vec<Vec<i128>> = (0..cloud.len()).map(row).collect();
    rows.sort_unstable();
    Ok(rows)
}

/// All files of a folder, by their path in it.
fn files_of(folder: &Path) -> BTreeMap<String, JobFile> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            files.extend(files_of(&path).into_iter().map(|(inner, file)| (format!("{name}/{inner}"), file)));
        } else {
            files.insert(name, JobFile::of(fs::read(path).unwrap()));
        }
    }
    files
}
