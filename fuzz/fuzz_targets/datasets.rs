//! A dataset in a folder: read as a scan, by all promises of one, and validated. The first byte is the kind; the input is the
//! files, each but the last after its length (u32, little-endian).

#![no_main]

use std::fs;
use std::path::Path;

use pointmill_format::{OpenOptions, Wanted, open_scan};
use pointmill_fuzz::{MAX_POINTS, check_error, folder};
use pointmill_testkit::reader::keeps_promises;
use pointmill_validate::{Options, validate};

/// The files of each kind.
const KINDS: [&[&str]; 6] = [
    &["metadata.json", "hierarchy.bin", "report.json", "octree.bin"],
    &["cloud.js", "data/r/r.hrc", "report.json", "data/r/r.bin"],
    &["index.json", "n00.bin", "n010.bin", "n.bin"],
    &["index.json", "report.json", "leaves.bin"],
    &["points.qbatch"],
    &["potree1.zip"],
];
/// A validation takes no more memory.
const MEMORY_BYTES: u64 = 256 << 20;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((kind, rest)) = bytes.split_first() else { return };
    let dataset = folder().join("dataset");
    let _ = fs::remove_dir_all(&dataset);
    if write(&dataset, KINDS[usize::from(*kind) % KINDS.len()], rest).is_err() {
        return;
    }
    match open_scan(&dataset, &OpenOptions::default()) {
        Ok(scan) => keeps_promises(&*scan, &Wanted::all(scan.info()), MAX_POINTS),
        Err(error) => check_error(&error),
    }
    let options = Options { memory_bytes: MEMORY_BYTES, threads: 1, max_problems: 4, ..Options::default() };
    match validate(&dataset, &options, &|_| {}) {
        Ok(outcome) => assert!(!outcome.ok || outcome.checks.iter().all(|check| check.found == 0)),
        Err(error) => check_error(&error),
    }
});

fn write(folder: &Path, names: &[&str], mut bytes: &[u8]) -> std::io::Result<()> {
    for (i, name) in names.iter().enumerate() {
        let mut file = bytes;
        if i + 1 < names.len() {
            let Some((length, rest)) = bytes.split_first_chunk::<4>() else { break };
            (file, bytes) = rest.split_at((u32::from_le_bytes(*length) as usize).min(rest.len()));
        }
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap_or(folder))?;
        fs::write(path, file)?;
    }
    Ok(())
}
