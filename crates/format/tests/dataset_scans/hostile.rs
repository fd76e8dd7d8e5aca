//! Damaged datasets give points or one line, and never more points than their bytes can hold.

use std::fs;

use pointmill_format::{OpenOptions, Wanted, open_scan};
use pointmill_testkit::Random;
use pointmill_testkit::damage::{hit, rounds};
use pointmill_testkit::files::{dataset, fixture, fixture_bytes};
use pointmill_testkit::reader::{check_error, read};

const DATASETS: [&str; 7] = [
    "potree2/default",
    "potree2/brotli",
    "potree1/words",
    "potree1/objects",
    "potree1/flat",
    "bintree/files",
    "bintree/packed",
];

/// Opens and reads what is in a folder; true if it could be opened.
fn is_read(path: &std::path::Path, what: &str) -> bool {
    match open_scan(path, &OpenOptions::default()) {
        Err(error) => {
            check_error(&error);
            false
        }
        Ok(scan) => {
            let cloud = read(&*scan, &Wanted::all(scan.info()));
            assert!(cloud.promised <= 1 << 24, "{what}: {} points", cloud.promised);
            true
        }
    }
}

#[test]
fn damaged_datasets_are_read_or_refused() {
    let mut random = Random::new(5);
    let mut opened = 0;
    for name in DATASETS {
        let files = dataset(&fixture(name));
        for round in 0..rounds(150) {
            let (hit_file, _) = files.iter().nth(random.index(files.len())).unwrap();
            let dir = tempfile::tempdir().unwrap();
            for (file, bytes) in &files {
                let mut bytes = bytes.clone();
                if file == hit_file && !bytes.is_empty() {
                    let at = random.index(bytes.len());
                    hit(&mut bytes, at, &mut random);
                }
                let path = dir.path().join(file);
                fs::create_dir_all(path.parent().unwrap()).unwrap();
                fs::write(path, bytes).unwrap();
            }
            opened += usize::from(is_read(dir.path(), &format!("{name}, round {round}, {hit_file}")));
        }
    }
    assert!(opened > 200, "{opened}");
}

#[test]
fn damaged_files_of_batches_are_read_or_refused() {
    let mut random = Random::new(6);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.qbatch");
    let mut opened = 0;
    for name in ["example", "blocks", "coarse", "far"] {
        let sound = fixture_bytes(&format!("batches/{name}.qbatch"));
        for round in 0..rounds(150) {
            let mut bytes = sound.clone();
            let at = random.index(bytes.len());
            hit(&mut bytes, at, &mut random);
            fs::write(&path, bytes).unwrap();
            opened += usize::from(is_read(&path, &format!("{name}, round {round}")));
        }
    }
    assert!(opened > 100, "{opened}");
}
