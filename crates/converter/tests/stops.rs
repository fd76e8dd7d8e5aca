//! A request to stop, in every phase and of every output: the run ends within a second, and nothing is left.

use std::fs;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use pointmill_converter::{
    AttributeChoice, BatchesSettings, BintreeSettings, ConvertError, Encoding, Events, Phase, Plan, Potree2Settings,
    Target, convert,
};
use pointmill_format::bintree::Layout;
use pointmill_testkit::las::Las;

/// The promise.
const AT_MOST: Duration = Duration::from_secs(1);

/// Asks the run to stop in a phase, once it has been asked some times there.
struct StopsIn {
    phase: Phase,
    after: u32,
    now: Mutex<Option<Phase>>,
    questions: AtomicU32,
    requested: Mutex<Option<Instant>>,
    /// When the run began to remove what it had made.
    heard: Mutex<Option<Instant>>,
}

impl StopsIn {
    fn new(phase: Phase, after: u32) -> Self {
        let [requested, heard] = [Mutex::new(None), Mutex::new(None)];
        Self { phase, after, now: Mutex::new(None), questions: AtomicU32::new(0), requested, heard }
    }
}

impl Events for StopsIn {
    fn phase(&self, phase: Phase, _: u64) {
        *self.now.lock().unwrap() = Some(phase);
        if phase == Phase::CleanUp {
            *self.heard.lock().unwrap() = Some(Instant::now());
        }
        if phase == self.phase && self.after == 0 {
            self.requested.lock().unwrap().get_or_insert_with(Instant::now);
        }
    }

    fn stop_requested(&self) -> bool {
        let mut requested = self.requested.lock().unwrap();
        if requested.is_none()
            && *self.now.lock().unwrap() == Some(self.phase)
            && self.questions.fetch_add(1, Ordering::Relaxed) >= self.after
        {
            *requested = Some(Instant::now());
        }
        requested.is_some()
    }
}

fn check(what: &str, points: usize, targets: &[Target]) {
    let dir = tempfile::tempdir().unwrap();
    let (scan, out) = (dir.path().join("a.las"), dir.path().join("out"));
    fs::write(&scan, Las::terrain(points, 3).bytes()).unwrap();
    let mut plan = Plan::new(vec![scan], out);
    (plan.threads, plan.name, plan.attributes) = (2, "cloud".into(), AttributeChoice::All);
    // how long it took to stop; `None`: the run did not ask as often
    let stopped = |phase: Phase, after: u32| {
        let events = StopsIn::new(phase, after);
        match convert(&plan, targets, &events) {
            Err(ConvertError::Interrupted) => {}
            Err(other) => panic!("{what}, {phase:?} {after}: {other}"),
            Ok(_) => {
                assert!(events.requested.lock().unwrap().is_none(), "{what}, {phase:?} {after}: goes on");
                fs::remove_dir_all(&plan.output).unwrap();
                return None;
            }
        }
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "{what}, {phase:?} {after}");
        let requested = events.requested.lock().unwrap().unwrap();
        Some(events.heard.lock().unwrap().unwrap().duration_since(requested))
    };
    let mut stops = 0;
    for (phase, after) in [
        (Phase::Probe, 0),
        (Phase::Read, 0),
        (Phase::Read, 5),
        (Phase::Build, 0),
        (Phase::Build, 1),
        (Phase::Build, 20),
        (Phase::Build, 60),
        (Phase::Finish, 0),
    ] {
        // others may have had the machine: late is what is late whenever it is tried
        let mut late = Vec::new();
        while let Some(took) = stopped(phase, after) {
            if took < AT_MOST {
                stops += 1;
                break;
            }
            late.push(took);
            assert!(late.len() < 4, "{what}, {phase:?} {after}: {late:?}");
        }
    }
    assert!(stops >= 5, "{what}: {stops}");
}

#[test]
fn octrees() {
    check("octree", 300_000, &[Potree2Settings::default().into()]);
    // nodes so large that the library works for many seconds on one of them
    for quality in [6, 9, 10, 11] {
        let brotli = Potree2Settings {
            encoding: Encoding::Brotli { quality },
            leaf_capacity: 60_000,
            ..Potree2Settings::default()
        };
        check(&format!("octree, Brotli {quality}"), 300_000, &[brotli.into()]);
    }
}

#[test]
fn binary_trees() {
    for layout in [Layout::Files, Layout::Packed] {
        let bintree = BintreeSettings { capacity: 500, layout, ..BintreeSettings::default() };
        check(&format!("binary tree, {layout:?}"), 300_000, &[bintree.into()]);
    }
}

#[test]
fn batches() {
    check("batches", 300_000, &[BatchesSettings::default().into()]);
    let zstd = BatchesSettings { zstd_level: Some(19), ..BatchesSettings::default() };
    check("batches, zstd", 300_000, &[zstd.into()]);
}

#[test]
fn three_outputs_of_one_read() {
    let all = [Potree2Settings::default().into(), BintreeSettings::default().into(), BatchesSettings::default().into()];
    check("three outputs", 100_000, &all);
}
