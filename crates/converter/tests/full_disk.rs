//! A disk that fails once, at its Nth operation: whatever was being made, the run ends with the error of the disk, the old
//! output is as it was, and nothing is left beside it. Later operations succeed, so that no error can hide behind another.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use pointmill_converter::{
    AttributeChoice, BatchesSettings, BintreeSettings, ConvertError, Disk, DiskOperation, Encoding, Plan,
    Potree1Settings, Potree2Settings, Replacing, Silent, Target, convert_on,
};
use pointmill_format::bintree::Layout;

/// Reports a full disk once, for one operation.
#[derive(Debug)]
struct FailingDisk {
    fails_at: u64,
    asked: AtomicU64,
    replacing: Replacing,
}

impl FailingDisk {
    fn at(operation: u64, replacing: Replacing) -> Arc<Self> {
        Arc::new(Self { fails_at: operation, asked: AtomicU64::new(0), replacing })
    }

    fn never() -> Arc<Self> {
        Self::at(u64::MAX, Replacing::AtOnce)
    }
}

impl Disk for FailingDisk {
    fn permit(&self, _: DiskOperation) -> io::Result<()> {
        if self.asked.fetch_add(1, Ordering::Relaxed) == self.fails_at {
            Err(io::ErrorKind::StorageFull.into())
        } else {
            Ok(())
        }
    }

    fn replacing(&self) -> Replacing {
        self.replacing
    }
}

/// All files of a folder but the report, whose times differ from run to run.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()) {
            if entry.is_dir() {
                open.push(entry);
            } else if entry.file_name().unwrap() != "report.json" {
                files.insert(entry.clone(), fs::read(&entry).unwrap());
            }
        }
    }
    files
}

fn points(count: u32) -> String {
    (0..count).map(|i| format!("{} {} {} {}\n", i * 7919 % 10_007, i * 104_729 % 9_973, i % 7, i % 256)).collect()
}

/// About this many operations are tried for one kind of run, spread evenly, and the last, which replace the old
/// output.
const TRIES: u64 = 40;

fn check(what: &str, targets: &[Target], change: impl Fn(&mut Plan)) {
    let dir = tempfile::tempdir().unwrap();
    let (scan, out) = (dir.path().join("scan.xyz"), dir.path().join("out"));
    fs::write(&scan, points(20_000)).unwrap();
    let mut plan = Plan::new(vec![scan], out.clone());
    (plan.threads, plan.overwrite, plan.name) = (2, true, "cloud".into());
    plan.attributes = AttributeChoice::All;
    change(&mut plan);
    let run = |disk: Arc<FailingDisk>| convert_on(disk, &plan, targets, &Silent);

    let ways = [Replacing::AtOnce, Replacing::InTwoSteps, Replacing::EntryByEntry];
    let counting = FailingDisk::at(u64::MAX, Replacing::EntryByEntry); // the most operations
    run(Arc::clone(&counting)).unwrap();
    let operations = counting.asked.load(Ordering::Relaxed);
    let step = (operations / TRIES).max(1);
    for operation in (0..operations).step_by(step as usize).chain(operations.saturating_sub(24)..operations) {
        fs::remove_dir_all(&out).unwrap();
        fs::create_dir(&out).unwrap();
        // an old dataset, and one that the new one differs from
        fs::write(
            out.join("metadata.json"),
            format!("{{\"hierarchy\": {{}}, \"pointmill\": {{\"is\": {operation}}}}}"),
        )
        .unwrap();
        let old = contents(&out);
        let disk = FailingDisk::at(operation, ways[operation as usize % ways.len()]);
        match run(Arc::clone(&disk)) {
            Err(ConvertError::Io { error, .. }) => assert_eq!(error.kind(), io::ErrorKind::StorageFull, "{what}"),
            Err(other) => panic!("{what}, at {operation} of {operations}: {other}"),
            // threads may need a few operations more or less
            Ok(_) => {
                assert!(
                    disk.asked.load(Ordering::Relaxed) <= operation,
                    "{what}, at {operation}: an error was overlooked"
                );
                continue;
            }
        }
        let found = contents(&out);
        assert!(found == old, "{what}, at {operation} of {operations}: {:?}", found.keys());
        let mut beside: Vec<_> = fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
        beside.sort();
        assert_eq!(beside, ["out", "scan.xyz"], "{what}, at {operation} of {operations}");
    }
}

fn potree2() -> Target {
    Potree2Settings { leaf_capacity: 500, ..Potree2Settings::default() }.into()
}

fn potree1() -> Target {
    Potree1Settings { leaf_capacity: 2000, ..Potree1Settings::default() }.into()
}

fn bintree(layout: Layout) -> Target {
    BintreeSettings { capacity: 1000, layout, ..BintreeSettings::default() }.into()
}

#[test]
fn an_octree() {
    check("octree", &[potree2()], |_| ());
    let brotli = Potree2Settings { encoding: Encoding::Brotli { quality: 1 }, ..Potree2Settings::default() };
    check("octree, Brotli", &[brotli.into()], |_| ());
}

#[test]
fn an_octree_with_a_file_for_each_node() {
    check("files of nodes", &[potree1()], |_| ());
    check("files of nodes beside others", &[potree2(), potree1()], |_| ());
}

/// A PLY whose points are so wide that few of them exceed the memory.
fn wide_scan(path: &Path) {
    const COLUMNS: usize = 300;
    let names: String = (0..COLUMNS).map(|i| format!("property double q{i}\n")).collect();
    let axes = "property double x\nproperty double y\nproperty double z\n";
    let head = format!("ply\nformat binary_little_endian 1.0\nelement vertex 6000\n{axes}{names}end_header\n");
    let mut bytes = head.into_bytes();
    for i in 0..6000u32 {
        let q = [i * 7919 % 10_007, i * 104_729 % 9_973, i % 7].map(f64::from);
        let wide = (0..COLUMNS as u32).map(|c| f64::from(i ^ c));
        bytes.extend(q.into_iter().chain(wide).flat_map(f64::to_le_bytes));
    }
    fs::write(path, bytes).unwrap();
}

#[test]
fn a_cloud_that_is_spilled() {
    let spilled = |targets: &[Target], what: &str| {
        check(what, targets, |plan| {
            wide_scan(&plan.inputs[0]);
            (plan.threads, plan.memory_bytes) = (1, 1);
            let Err(ConvertError::Memory { needed, .. }) = convert_on(FailingDisk::never(), plan, targets, &Silent)
            else {
                panic!("one byte is enough?")
            };
            (plan.memory_bytes, plan.waiting_bytes) = (needed, Some(0));
            let report = convert_on(FailingDisk::never(), plan, targets, &Silent).unwrap();
            assert!(report.temp_bytes > 0, "{what}: nothing was spilled");
        });
    };
    spilled(&[bintree(Layout::Packed)], "binary tree, spilled");
    spilled(&[potree2()], "octree, spilled");
}

#[test]
fn a_binary_tree_as_files_and_packed() {
    check("leaves in files", &[bintree(Layout::Files)], |_| ());
    check("leaves packed", &[bintree(Layout::Packed)], |plan| plan.task_points = Some(3000));
}

#[test]
fn batches_raw_and_compressed() {
    check("batches", &[BatchesSettings::default().into()], |plan| plan.task_points = Some(3000));
    let zstd = BatchesSettings { zstd_level: Some(1), ..BatchesSettings::default() };
    check("batches, zstd", &[zstd.into()], |_| ());
}

#[test]
fn three_outputs_of_one_read() {
    let all = [potree2(), bintree(Layout::Packed), BatchesSettings::default().into()];
    check("three outputs", &all, |_| ());
}
