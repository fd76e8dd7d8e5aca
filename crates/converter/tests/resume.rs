//! A run that ends anywhere leaves what the next one goes on with, and that one ends in the same bytes.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill_converter::{
    BatchesSettings, BintreeSettings, Checkpoint, ConvertError, Disk, DiskOperation, JobFault, Plan, Potree2Settings,
    Silent, Target, convert, convert_on,
};
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
        let dir = tempfile::tempdir().unwrap();
        let scan = |seed: u64| {
            let path = dir.path().join(format!("{seed}.las"));
            fs::write(&path, Las::terrain(4000, seed).bytes()).unwrap();
            path
        };
        let mut plan = Plan::new((1..=5).map(scan).collect(), dir.path().join("out"));
        (plan.threads, plan.checkpoint, plan.checkpoint_points) = (2, Checkpoint::Always, 8000);
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
        let (operations, _) = self.end_at(&self.plan, &targets(), u64::MAX);
        fs::remove_dir_all(&self.plan.output).unwrap();
        for at in (0..operations).rev() {
            let (_, ended) = self.end_at(&self.plan, &targets(), at);
            if ended.is_err() && self.job().exists() {
                return;
            }
            let _ = fs::remove_dir_all(&self.plan.output);
        }
        panic!("no run left a job");
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
    let formats: [(&str, Vec<Target>, Option<u64>); 4] = [
        ("potree2", targets().into(), None),
        ("spilled", targets().into(), Some(0)),
        ("bintree", vec![BintreeSettings::default().into()], Some(0)),
        ("two", vec![Potree2Settings::default().into(), BatchesSettings::default().into()], None),
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
fn records_that_changed_are_found() {
    let bench = Bench::new();
    bench.with_job();
    let records = bench.job().join("records-1");
    let whole = fs::read(&records).unwrap();
    let mut changed = whole.clone();
    changed[1000] ^= 1;
    for bytes in [&changed[..], &whole[..2000], &[]] {
        fs::write(&records, bytes).unwrap();
        assert!(matches!(bench.fault(&bench.resumed()), JobFault::Damaged { file, .. } if file == records));
    }
    fs::write(&records, whole).unwrap();
    convert(&bench.resumed(), &targets(), &Silent).unwrap();
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
