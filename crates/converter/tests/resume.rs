//! A run that ends anywhere leaves what the next one goes on with, and that one ends in the same bytes.

use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill_converter::{
    BatchesSettings, BintreeSettings, Checkpoint, ConvertError, CopcSettings, Disk, DiskOperation, Events, JobFault,
    Phase, Plan, Potree2Settings, Silent, Target, convert, convert_on,
};
use pointmill_format::bintree::Layout;
use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

/// Fails from its Nth operation on, as a disk that is full and stays so, or a process that is gone.
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

struct Bench {
    dir: tempfile::TempDir,
    plan: Plan,
}

impl Bench {
    /// Five scans, read in units of two.
    fn new() -> Self {
        Self::of(4000)
    }

    /// The same of so many points each.
    fn of(points: usize) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let scan = |seed: u64| {
            let path = dir.path().join(format!("{seed}.las"));
            fs::write(&path, Las::terrain(points, seed).bytes()).unwrap();
            path
        };
        let mut plan = Plan::new((1..=5).map(scan).collect(), dir.path().join("out"));
        (plan.threads, plan.checkpoint, plan.checkpoint_points) = (2, Checkpoint::Always, 2 * points as u64);
        plan.name = "cloud".into();
        Self { dir, plan }
    }

    fn job(&self) -> PathBuf {
        self.dir.path().join("out.job")
    }

    /// A run that ends at an operation of the disk; how many it asked for.
    fn end_at(&self, plan: &Plan, targets: &[Target], at: u64) -> (u64, Result<(), ConvertError>) {
        let disk = Arc::new(Ending { at, asked: AtomicU64::new(0) });
        let ended = convert_on(Arc::clone(&disk) as _, plan, targets, &Silent).map(|_| ());
        (disk.asked.load(Ordering::Relaxed), ended)
    }

    /// A job with some units.
    fn with_job(&self) {
        self.with_job_of(&targets(), "journal", |_| true);
    }

    /// A job of the run that ended as late as possible, with a file whose name begins so, if it `suits`.
    fn with_job_of(&self, targets: &[Target], file: &str, suits: impl Fn(&Self) -> bool) {
        let (operations, _) = self.end_at(&self.plan, targets, u64::MAX);
        fs::remove_dir_all(&self.plan.output).unwrap();
        for at in (0..operations).rev() {
            let (_, ended) = self.end_at(&self.plan, targets, at);
            let has = |names: Vec<String>| names.iter().any(|name| name.starts_with(file));
            if ended.is_err() && self.job().exists() && has(names(&self.job())) && suits(self) {
                return;
            }
            let _ = fs::remove_dir_all(&self.plan.output);
        }
        panic!("no run left a job with {file}");
    }

    fn resumed(&self) -> Plan {
        Plan { resume: true, ..self.plan.clone() }
    }

    fn fault(&self, plan: &Plan) -> JobFault {
        match convert(plan, &targets(), &Silent) {
            Err(ConvertError::Job(fault)) => fault,
            other => panic!("{other:?}"),
        }
    }
}

fn targets() -> [Target; 1] {
    [Potree2Settings::default().into()]
}

fn names(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn a_run_that_ends_at_any_operation_is_gone_on_with_to_the_same_bytes() {
    let formats: [(&str, Vec<Target>, Option<u64>); 6] = [
        ("potree2", targets().into(), None),
        ("spilled", targets().into(), Some(0)),
        ("bintree", vec![BintreeSettings::default().into()], Some(0)),
        ("two", vec![Potree2Settings::default().into(), BatchesSettings::default().into()], None),
        ("one tree", vec![Potree2Settings::default().into(), CopcSettings::default().into()], Some(0)),
        ("batches", vec![BatchesSettings::default().into()], Some(0)),
    ];
    for (name, targets, waiting) in formats {
        let mut bench = Bench::new();
        bench.plan.waiting_bytes = waiting;
        let plain =
            Plan { checkpoint: Checkpoint::Never, output: bench.dir.path().join("plain"), ..bench.plan.clone() };
        convert(&plain, &targets, &Silent).unwrap();
        let expected = dataset(&plain.output);
        let (operations, ended) = bench.end_at(&bench.plan, &targets, u64::MAX);
        ended.unwrap();
        assert!(dataset(&bench.plan.output) == expected && !bench.job().exists(), "{name}");
        fs::remove_dir_all(&bench.plan.output).unwrap();
        let (mut most, mut least) = (0, u64::MAX);
        for at in (0..operations).step_by((operations / 10).max(1) as usize) {
            let (_, ended) = bench.end_at(&bench.plan, &targets, at);
            if ended.is_ok() {
                fs::remove_dir_all(&bench.plan.output).unwrap(); // what was refused was the name of something temporary
                continue;
            }
            // a second run that ends, too, a little later
            let _ = bench.end_at(&bench.resumed(), &targets, at / 2 + 10);
            if bench.plan.output.exists() {
                fs::remove_dir_all(&bench.plan.output).unwrap();
            }
            let report = convert(&bench.resumed(), &targets, &Silent).unwrap();
            assert!(dataset(&bench.plan.output) == expected, "{name}, operation {at}");
            (most, least) = (most.max(report.recalled_points), least.min(report.recalled_points));
            assert_eq!(report.points.read, 20_000);
            assert_eq!(names(bench.dir.path()), ["1.las", "2.las", "3.las", "4.las", "5.las", "out", "plain"]);
            fs::remove_dir_all(&bench.plan.output).unwrap();
        }
        assert_eq!((least, most), (0, 20_000), "{name}: points that were not read again");
    }
}

#[test]
fn an_append_that_ends_anywhere_is_gone_on_with() {
    let mut bench = Bench::of(3000);
    bench.plan.subtree_points = Some(500);
    let targets = [Potree2Settings { leaf_capacity: 60, spacing: Some(1.0), ..Potree2Settings::default() }.into()];
    convert(&Plan { checkpoint: Checkpoint::Never, ..bench.plan.clone() }, &targets, &Silent).unwrap();
    let (out, base) = (bench.plan.output.clone(), bench.dir.path().join("base"));
    fs::rename(&out, &base).unwrap();
    let restore = || {
        let _ = fs::remove_dir_all(&out);
        fs::create_dir(&out).unwrap();
        for name in names(&base) {
            fs::copy(base.join(&name), out.join(&name)).unwrap();
        }
    };
    let mut corner = Las::terrain(3000, 1);
    let least = |a: usize| corner.points.iter().map(|point| point.xyz[a]).min().unwrap();
    let end = [least(0) + 300, least(1) + 300];
    corner.points.retain(|point| point.xyz[0] < end[0] && point.xyz[1] < end[1]);
    let more = bench.dir.path().join("more.las");
    fs::write(&more, corner.bytes()).unwrap();
    bench.plan.inputs.push(more.clone());
    let whole = Plan { checkpoint: Checkpoint::Never, output: bench.dir.path().join("whole"), ..bench.plan.clone() };
    convert(&whole, &targets, &Silent).unwrap();
    let expected = dataset(&whole.output);
    (bench.plan.inputs, bench.plan.append, bench.plan.overwrite) = (vec![more, out.clone()], true, true);
    restore();
    let (operations, ended) = bench.end_at(&bench.plan, &targets, u64::MAX);
    ended.unwrap();
    let (mut taken, mut recalled) = (0, 0);
    for at in (0..operations).step_by((operations / 12).max(1) as usize) {
        restore();
        if bench.end_at(&bench.plan, &targets, at).1.is_ok() {
            continue; // what was refused was the name of something temporary
        }
        let report = convert(&bench.resumed(), &targets, &Silent).unwrap();
        assert!(dataset(&out) == expected, "operation {at}");
        (taken, recalled) = (taken + report.outputs[0].taken_over.unwrap().nodes, recalled + report.recalled_units);
    }
    assert!(taken > 0 && recalled > 0, "{taken} nodes, {recalled} units");
}

#[test]
fn another_input_option_or_version_is_refused_with_the_reason_and_the_job_stays() {
    let bench = Bench::new();
    bench.with_job();
    let resumed = bench.resumed();
    let mut other = resumed.clone();
    other.attributes = pointmill_converter::AttributeChoice::List(vec!["intensity".into()]);
    assert!(matches!(bench.fault(&other), JobFault::Setting { name, .. } if name == "attributes"));
    let mut fewer = resumed.clone();
    fewer.inputs.pop();
    assert!(matches!(bench.fault(&fewer), JobFault::OtherInputs { path } if path.ends_with("5.las")));
    let before = fs::read(bench.dir.path().join("3.las")).unwrap();
    fs::write(bench.dir.path().join("3.las"), Las::terrain(4000, 33).bytes()).unwrap();
    assert!(matches!(bench.fault(&resumed), JobFault::ChangedInput { path } if path.ends_with("3.las")));
    fs::write(bench.dir.path().join("3.las"), before).unwrap();
    // the time of its last change is another
    assert!(matches!(bench.fault(&resumed), JobFault::ChangedInput { .. }));
    assert!(bench.job().join("journal").exists());
    // a run that does not resume begins anew, and resources may differ
    convert(&Plan { threads: 1, ..bench.plan.clone() }, &targets(), &Silent).unwrap();
    assert!(!bench.job().exists());
}

#[test]
fn records_that_changed_are_found_where_they_are_needed() {
    let bench = Bench::new();
    let is_built = |bench: &Bench| names(&bench.job()).iter().any(|name| name == "build-0-0");
    bench.with_job_of(&targets(), if cfg!(unix) { "output-" } else { "journal" }, is_built);
    let records = bench.job().join("records-1");
    let whole = fs::read(&records).unwrap();
    let mut changed = whole.clone();
    changed.iter_mut().step_by(5000).for_each(|byte| *byte ^= 1);
    let built: Vec<_> = names(&bench.job()).into_iter().filter(|name| name.starts_with("build-")).collect();
    let built: Vec<_> =
        built.into_iter().map(|name| bench.job().join(name)).map(|p| (fs::read(&p).unwrap(), p)).collect();
    built.iter().for_each(|(_, path)| fs::remove_file(path).unwrap());
    for bytes in [&changed[..], &whole[..2000], &[]] {
        fs::write(&records, bytes).unwrap();
        assert!(matches!(bench.fault(&bench.resumed()), JobFault::Damaged { file, .. } if file == records));
    }
    fs::write(&records, whole).unwrap();
    built.iter().for_each(|(bytes, path)| fs::write(path, bytes).unwrap());
    let report = convert(&bench.resumed(), &targets(), &Silent).unwrap();
    assert_eq!(report.recalled_units, u64::from(cfg!(unix)));
}

/// Removes the job when all is built.
struct Removing(PathBuf);

impl Events for Removing {
    fn phase(&self, phase: Phase, _: u64) {
        if phase == Phase::Finish {
            fs::remove_dir_all(&self.0).unwrap();
        }
    }
}

#[test]
fn a_run_whose_job_somebody_removes_ends_well() {
    let bench = Bench::new();
    convert(&bench.plan, &targets(), &Removing(bench.job())).unwrap();
    assert_eq!(names(bench.dir.path()), ["1.las", "2.las", "3.las", "4.las", "5.las", "out"]);
}

#[test]
fn without_a_job_the_run_begins_anew_and_a_folder_of_others_is_left_alone() {
    let bench = Bench::new();
    let report = convert(&bench.resumed(), &targets(), &Silent).unwrap();
    assert!(report.warnings.iter().any(|w| w.kind() == "begins_anew"));
    fs::remove_dir_all(&bench.plan.output).unwrap();
    fs::create_dir(bench.job()).unwrap();
    fs::write(bench.job().join("letter.txt"), "dear").unwrap();
    assert!(matches!(bench.fault(&bench.plan), JobFault::NoJob { .. }));
    assert_eq!(fs::read(bench.job().join("letter.txt")).unwrap(), b"dear");
}

/// Outputs whose bytes a job keeps where they belong, and how the names begin of the files.
#[cfg(unix)]
fn in_place() -> [(Target, &'static str); 5] {
    let bintree = |layout| BintreeSettings { layout, ..BintreeSettings::default() };
    [
        (Potree2Settings::default().into(), "output-potree2-octree.bin"),
        (CopcSettings::default().into(), "output-copc-points.copc.laz"),
        (bintree(Layout::Packed).into(), "output-bintree-leaves.bin"),
        (bintree(Layout::Files).into(), "output-bintree-n"),
        (BatchesSettings::default().into(), "output-batches-points.qbatch"),
    ]
}

/// A job that can be put back as it was.
#[cfg(unix)]
#[derive(Clone)]
struct Job {
    folder: PathBuf,
    files: Vec<(String, Vec<u8>)>,
}

#[cfg(unix)]
impl Job {
    fn new(folder: PathBuf) -> Self {
        let files = names(&folder).into_iter().map(|name| (name.clone(), fs::read(folder.join(name)).unwrap()));
        Self { files: files.collect(), folder }
    }

    fn put_back(&self) {
        fs::create_dir(&self.folder).unwrap();
        self.files.iter().for_each(|(name, bytes)| fs::write(self.folder.join(name), bytes).unwrap());
    }

    fn bytes(&self, begin: &str) -> usize {
        self.files.iter().filter(|(name, _)| name.starts_with(begin)).map(|(_, bytes)| bytes.len()).sum()
    }
}

#[cfg(unix)]
#[test]
fn what_was_built_stays_in_the_file_of_the_output_and_is_built_again_where_that_changed() {
    for (target, file) in in_place() {
        let targets = [target];
        let bench = Bench::of(20_000);
        let plain =
            Plan { checkpoint: Checkpoint::Never, output: bench.dir.path().join("plain"), ..bench.plan.clone() };
        convert(&plain, &targets, &Silent).unwrap();
        let expected = dataset(&plain.output);
        let job = RefCell::new(None);
        bench.with_job_of(&targets, file, |bench| {
            let kept = job.borrow_mut().insert(Job::new(bench.job())).clone();
            let units = convert(&bench.resumed(), &targets, &Silent).unwrap().recalled_units;
            fs::remove_dir_all(&bench.plan.output).unwrap();
            kept.put_back();
            units > 0 // the end of batches changes what units have written
        });
        let job = job.into_inner().unwrap();
        let (kept, built) = (job.bytes(file), job.bytes("build-"));
        assert!(kept > 500_000 && built < kept / 3 * 2, "{file}: {built} beside {kept} bytes");
        fs::remove_dir_all(bench.job()).unwrap();
        let recalled = |change: &dyn Fn(&mut Vec<u8>)| {
            job.put_back();
            for (name, bytes) in job.files.iter().filter(|(name, _)| name.starts_with(file)) {
                let mut bytes = bytes.clone();
                change(&mut bytes);
                fs::write(bench.job().join(name), bytes).unwrap();
            }
            let report = convert(&bench.resumed(), &targets, &Silent).unwrap();
            assert!(dataset(&bench.plan.output) == expected && !bench.job().exists(), "{file}");
            fs::remove_dir_all(&bench.plan.output).unwrap();
            report.recalled_units
        };
        let all = recalled(&|_| {});
        assert!(all > 0, "{file}");
        assert_eq!(recalled(&|bytes| bytes.iter_mut().step_by(1000).for_each(|byte| *byte ^= 1)), 0, "{file}");
        // as after a power failure: zeros, or nothing
        assert_eq!(recalled(&|bytes| bytes.fill(0)), 0, "{file}");
        assert!(recalled(&|bytes| bytes.truncate(bytes.len() / 2)) < all, "{file}");
        assert_eq!(recalled(&Vec::clear), 0, "{file}");
        // whatever a run has left behind the end
        let behind = recalled(&|bytes| bytes.resize(bytes.len() + (1 << 20), 0xaa));
        assert_eq!(behind, all, "{file}");
    }
}

#[cfg(unix)]
#[test]
fn a_file_that_is_part_of_a_complete_output_is_not_written_to() {
    for (target, file) in in_place() {
        let targets = [target];
        let bench = Bench::new();
        bench.with_job_of(&targets, file, |_| true);
        // as if the run had been killed between the two: it has given the output its name, and the job is still there
        let kept = names(&bench.job()).into_iter().filter(|name| name.starts_with(file));
        let published = kept.map(|name| {
            let published = bench.dir.path().join(&name);
            fs::hard_link(bench.job().join(name), &published).unwrap();
            (published.clone(), fs::read(published).unwrap())
        });
        let published: Vec<_> = published.collect();
        let report = convert(&bench.resumed(), &targets, &Silent).unwrap();
        assert_eq!(report.recalled_units, 0, "{file}");
        assert!(published.iter().all(|(path, before)| fs::read(path).unwrap() == *before), "{file}");
    }
}

#[cfg(unix)]
#[test]
fn what_cannot_be_gone_on_with_is_made_anew_and_modes_are_those_of_a_new_file() {
    use std::os::unix::fs::PermissionsExt as _;
    for (target, file) in in_place() {
        let targets = [target];
        let bench = Bench::new();
        let plain =
            Plan { checkpoint: Checkpoint::Never, output: bench.dir.path().join("plain"), ..bench.plan.clone() };
        convert(&plain, &targets, &Silent).unwrap();
        let mode = |folder: &Path, name: &str| fs::metadata(folder.join(name)).unwrap().permissions().mode();
        for fault in ["mode", "folder", "link", "nothing"] {
            bench.with_job_of(&targets, file, |_| true);
            let victim = bench.dir.path().join("victim");
            fs::write(&victim, "a letter").unwrap();
            for name in names(&bench.job()).into_iter().filter(|name| name.starts_with(file)) {
                let kept = bench.job().join(name);
                if fault == "mode" {
                    fs::set_permissions(&kept, fs::Permissions::from_mode(0o600)).unwrap();
                    continue;
                }
                fs::remove_file(&kept).unwrap();
                match fault {
                    "folder" => fs::create_dir(&kept).unwrap(),
                    "link" => std::os::unix::fs::symlink(&victim, &kept).unwrap(),
                    _ => {}
                }
            }
            convert(&bench.resumed(), &targets, &Silent).unwrap();
            assert!(dataset(&bench.plan.output) == dataset(&plain.output), "{file}, {fault}");
            assert_eq!(fs::read(&victim).unwrap(), b"a letter");
            for name in names(&plain.output) {
                assert_eq!(mode(&bench.plan.output, &name), mode(&plain.output, &name), "{name}, {fault}");
            }
            fs::remove_dir_all(&bench.plan.output).unwrap();
            let _ = fs::remove_dir_all(bench.job());
        }
    }
}

#[cfg(unix)]
#[test]
fn an_output_that_is_complete_has_no_second_name() {
    use std::os::unix::fs::MetadataExt as _;
    for (target, _) in in_place() {
        let bench = Bench::new();
        convert(&bench.plan, &[target], &Silent).unwrap();
        for name in names(&bench.plan.output) {
            assert_eq!(fs::metadata(bench.plan.output.join(&name)).unwrap().nlink(), 1, "{name}");
        }
    }
}
