//! Any number of inputs: headers on all threads with the result of one, files that are opened again when they are read,
//! little memory for each.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, SystemTime};

use pointmill_converter::{
    ConvertError, Events, InputFault, MemoryNeed, OnFault, Phase, Plan, Potree2Settings, Report, Silent, Warning,
    convert,
};
use pointmill_testkit::las::{Las, Point};

/// More than stay open.
const MANY: usize = 300;

fn one_point(i: usize) -> Vec<u8> {
    let place = [i as i32 % 100, i as i32 / 100, i as i32 % 7];
    Las::new(vec![Point::numbered(i, place)]).bytes()
}

/// Scans of one point each, in order of path.
fn scans(folder: &Path, count: usize) -> Vec<PathBuf> {
    let scan = |i: usize| {
        let path = folder.join(format!("{i:05}.las"));
        fs::write(&path, one_point(i)).unwrap();
        path
    };
    (0..count).map(scan).collect()
}

fn plan(inputs: Vec<PathBuf>, folder: &Path, threads: usize) -> Plan {
    let mut plan = Plan::new(inputs, folder.join(format!("out{threads}")));
    plan.threads = threads;
    plan.memory_bytes = 512 << 20;
    plan
}

fn run(plan: &Plan, events: &dyn Events) -> Result<Report, ConvertError> {
    convert(plan, &[Potree2Settings::default().into()], events)
}

/// Changes a file when the phase of reading begins: after the headers, before the points.
struct Writer {
    path: PathBuf,
    bytes: Vec<u8>,
    modified: SystemTime,
}

impl Events for Writer {
    fn phase(&self, phase: Phase, _total: u64) {
        if phase == Phase::Read {
            fs::write(&self.path, &self.bytes).unwrap();
            fs::File::options().write(true).open(&self.path).unwrap().set_modified(self.modified).unwrap();
        }
    }
}

#[test]
fn a_file_that_is_replaced_between_header_and_points_is_one_clear_error() {
    let dir = tempfile::tempdir().unwrap();
    let inputs = scans(dir.path(), MANY);
    let last = inputs[MANY - 1].clone();
    let modified = fs::metadata(&last).unwrap().modified().unwrap();
    let longer = Las::new(vec![Point::at([1; 3]), Point::at([2; 3])]).bytes();
    let cases = [
        ("another point, later", one_point(MANY), modified + Duration::from_secs(2)),
        ("more points, at the same time", longer, modified),
    ];
    for (what, bytes, modified) in cases {
        let plan = plan(inputs.clone(), dir.path(), 2);
        let error = run(&plan, &Writer { path: last.clone(), bytes, modified }).unwrap_err();
        assert!(
            matches!(&error, ConvertError::Input(InputFault::Changed { path }) if *path == last),
            "{what}: {error}"
        );
        assert!(
            error
                .to_string()
                .ends_with("was changed while it was being read; convert again once nothing writes to the inputs")
        );
        assert!(!plan.output.exists());
        fs::write(&last, one_point(MANY - 1)).unwrap();
    }
    fs::remove_file(&last).unwrap();
    let gone = run(&plan(inputs, dir.path(), 2), &Silent).unwrap_err();
    assert!(matches!(&gone, ConvertError::Read(e) if e.is_io() && e.path() == last), "{gone}");
}

#[test]
fn headers_read_by_many_threads_give_the_report_and_the_errors_of_one() {
    let dir = tempfile::tempdir().unwrap();
    let mut inputs = scans(dir.path(), MANY);
    for i in (0..MANY).step_by(7) {
        let mut las = Las::new(vec![Point::at([i as i32; 3])]);
        las.points_declared = Some(1 + i as u64 % 3);
        fs::write(&inputs[i], las.bytes()).unwrap();
    }
    for i in [40, 41, 230] {
        fs::write(&inputs[i], b"LASF, and nothing else").unwrap();
    }
    inputs.reverse();
    let report = |threads: usize| {
        let mut plan = plan(inputs.clone(), dir.path(), threads);
        plan.unreadable = OnFault::Skip;
        let report = run(&plan, &Silent).unwrap();
        let octree = fs::read(plan.output.join("octree.bin")).unwrap();
        (format!("{:?}", report.inputs), format!("{:?}", report.warnings), report.points.unreadable, octree)
    };
    let (one, many) = (report(1), report(5));
    assert_eq!(one, many);
    assert_eq!(one.1.matches("InputSkipped").count(), 3);
    for threads in [1, 5] {
        let folder = dir.path().join("refused");
        let error = run(&plan(inputs[..250].to_vec(), &folder, threads), &Silent).unwrap_err();
        assert!(error.to_string().contains("00056.las"), "the first in order of path: {error}");
    }
}

/// Asks to stop once that many headers were read.
struct Stopper {
    headers: AtomicU64,
    after: u64,
    is_probe: AtomicBool,
}

impl Events for Stopper {
    fn phase(&self, phase: Phase, total: u64) {
        self.is_probe.store(phase == Phase::Probe, Ordering::Relaxed);
        assert!(phase != Phase::Probe || total == MANY as u64);
    }

    fn advance(&self, steps: u64) {
        if self.is_probe.load(Ordering::Relaxed) {
            self.headers.fetch_add(steps, Ordering::Relaxed);
        }
    }

    fn stop_requested(&self) -> bool {
        self.headers.load(Ordering::Relaxed) >= self.after
    }
}

#[test]
fn a_run_stops_between_two_headers() {
    let dir = tempfile::tempdir().unwrap();
    let inputs = scans(dir.path(), MANY);
    let stopper = |after| Stopper { headers: AtomicU64::new(0), after, is_probe: AtomicBool::new(false) };
    let plan = plan(inputs, dir.path(), 2);
    let early = stopper(20);
    assert!(matches!(run(&plan, &early), Err(ConvertError::Interrupted)));
    let headers = early.headers.into_inner();
    assert!((20..=22).contains(&headers), "{headers}");
    let never = stopper(u64::MAX);
    run(&plan, &never).unwrap();
    assert_eq!(never.headers.into_inner(), MANY as u64);
}

#[test]
fn too_many_inputs_for_the_ceiling_end_before_one_is_opened() {
    let dir = tempfile::tempdir().unwrap();
    let inputs = (0..40_000).map(|i| dir.path().join(format!("{i}.las"))).collect();
    let mut plan = plan(inputs, dir.path(), 1);
    plan.memory_bytes = 50 << 20;
    let Err(ConvertError::Memory { needed, why: MemoryNeed::Inputs { bytes }, .. }) = run(&plan, &Silent) else {
        panic!("no file is there, and none may be looked for")
    };
    assert!((25 << 20..60 << 20).contains(&bytes) && (80 << 20..160 << 20).contains(&needed), "{bytes} {needed}");
    plan.memory_bytes = needed;
    assert!(matches!(run(&plan, &Silent), Err(ConvertError::Read(_))), "with so much they are looked for");
}

#[test]
fn warnings_of_all_inputs_come_in_their_order() {
    let dir = tempfile::tempdir().unwrap();
    let inputs = scans(dir.path(), 40);
    for path in &inputs {
        // bytes after the points that nobody declares
        fs::write(path, [fs::read(path).unwrap(), vec![0; 34]].concat()).unwrap();
    }
    let report = run(&plan(inputs.clone(), dir.path(), 4), &Silent).unwrap();
    let paths: Vec<&PathBuf> = report
        .warnings
        .iter()
        .filter_map(|w| match w {
            Warning::Scan { path, .. } => Some(path),
            _ => None,
        })
        .collect();
    assert_eq!(paths, inputs.iter().collect::<Vec<_>>());
}
