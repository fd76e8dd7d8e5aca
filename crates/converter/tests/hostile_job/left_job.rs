//! What a run has left for another one to go on with, to be changed: for the tests here and for the fuzz target, which
//! includes this file.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use pointmill_converter::{
    Checkpoint, ConvertError, Events, Phase, Plan, Potree2Settings, Report, Silent, Target, convert,
};
use pointmill_testkit::damage::u32_at;
use pointmill_testkit::las::Las;

const MAGIC: usize = 16;
const HEAD: usize = 12;

/// A job whose run was ended when all scans were read.
pub(crate) struct LeftJob {
    plan: Plan,
    journal: Vec<u8>,
    records: Vec<u8>,
}

/// Asks the run to stop when it builds.
#[derive(Default)]
struct StopAtBuild(AtomicBool);

impl Events for StopAtBuild {
    fn phase(&self, phase: Phase, _: u64) {
        self.0.fetch_or(phase == Phase::Build, Ordering::Relaxed);
    }

    fn stop_requested(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

impl LeftJob {
    /// Of two scans of `points` points, in `folder`.
    pub(crate) fn new(folder: &Path, points: usize) -> Self {
        let scan = |seed: u64| {
            let path = folder.join(format!("{seed}.las"));
            fs::write(&path, Las::terrain(points, seed).bytes()).unwrap();
            path
        };
        let mut plan = Plan::new([1, 2].map(scan).into(), folder.join("out"));
        (plan.threads, plan.checkpoint, plan.checkpoint_points) = (1, Checkpoint::Always, points as u64);
        (plan.memory_bytes, plan.resume) = (400 << 20, true);
        let ended = convert(&plan, &targets(), &StopAtBuild::default());
        assert!(matches!(ended, Err(ConvertError::Interrupted)), "{ended:?}");
        let file = |name: &str| fs::read(folder.join("out.job").join(name)).unwrap();
        let (journal, records) = (file("journal"), file("records-1"));
        Self { plan, journal, records }
    }

    fn folder(&self) -> PathBuf {
        self.plan.output.with_file_name("out.job")
    }

    /// The records that were read.
    pub(crate) fn records(&self) -> &[u8] {
        &self.records
    }

    /// What the journal holds: for what the job was begun, then what each unit has left.
    pub(crate) fn payloads(&self) -> Vec<&[u8]> {
        let (mut rest, mut payloads) = (&self.journal[MAGIC..], Vec::new());
        while !rest.is_empty() {
            let (payload, others) = rest[HEAD..].split_at(u32_at(rest, 0) as usize);
            payloads.push(payload);
            rest = others;
        }
        payloads
    }

    /// A journal that holds this, with the right lengths and checksums.
    pub(crate) fn journal(&self, payloads: &[&[u8]]) -> Vec<u8> {
        let mut journal = self.journal[..MAGIC].to_vec();
        for payload in payloads {
            let [bytes, sum] = [payload.len() as u32, crc32c::crc32c(payload)].map(u32::to_le_bytes);
            let head = [bytes, sum].concat();
            journal.extend([&head[..], &crc32c::crc32c(&head).to_le_bytes(), payload].concat());
        }
        journal
    }

    /// Goes on with these files. Nothing is left of it.
    pub(crate) fn resume(&self, journal: &[u8], records: &[u8]) -> Result<Report, ConvertError> {
        let folder = self.folder();
        fs::create_dir_all(&folder).unwrap();
        for (name, bytes) in [("lock", &[][..]), ("journal", journal), ("records-1", records)] {
            fs::write(folder.join(name), bytes).unwrap();
        }
        let ended = convert(&self.plan, &targets(), &Silent);
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
}

fn targets() -> [Target; 1] {
    [Potree2Settings { leaf_capacity: 300, ..Potree2Settings::default() }.into()]
}
