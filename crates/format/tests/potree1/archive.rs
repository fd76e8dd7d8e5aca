//! A dataset in one uncompressed archive.

use std::fs;
use std::path::PathBuf;

use pointmill_format::bytes::Memory;
use pointmill_format::potree1::Dataset;
use pointmill_format::{ErrorKind, ReadError, open_octree};
use pointmill_testkit::Random;
use pointmill_testkit::damage::hit;
use tempfile::TempDir;

use crate::util::{golden, load, read_all};

/// A ZIP archive by the plainest means. `method`: 0 for stored.
fn zip(files: &Memory, folder: &str, method: u16) -> Vec<u8> {
    let (mut out, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in files {
        let name = format!("{folder}{name}");
        let mut fields = Vec::new();
        fields.extend([20u16, 0, method, 0, 0].map(u16::to_le_bytes).concat()); // version, flags, method, time, date
        fields.extend([0, bytes.len() as u32, bytes.len() as u32].map(u32::to_le_bytes).concat()); // checksum, sizes
        fields.extend([name.len() as u16, 0].map(u16::to_le_bytes).concat()); // lengths of name and extra fields
        directory.extend(b"PK\x01\x02\x14\0");
        directory.extend(&fields);
        directory.extend([0u16, 0, 0, 0, 0].map(u16::to_le_bytes).concat()); // comment, disk, attributes
        directory.extend((out.len() as u32).to_le_bytes());
        directory.extend(name.as_bytes());
        out.extend(b"PK\x03\x04");
        out.extend(fields);
        out.extend(name.as_bytes());
        out.extend(bytes);
    }
    let (at, count) = (out.len() as u32, files.len() as u16);
    out.extend(&directory);
    out.extend(b"PK\x05\x06\0\0\0\0");
    out.extend([count, count].map(u16::to_le_bytes).concat());
    out.extend([directory.len() as u32, at].map(u32::to_le_bytes).concat());
    out.extend([0, 0]);
    out
}

fn written(bytes: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cloud.zip");
    fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn points(dataset: &Dataset) -> Result<usize, ReadError> {
    Ok(read_all(dataset)?.iter().map(|(_, points)| points.len()).sum())
}

#[test]
fn an_archive_is_read_in_place_with_or_without_a_folder_in_it() {
    for layout in ["words", "objects", "flat"] {
        let files = load(&golden(layout));
        for folder in ["", "clouds/city/"] {
            let (_kept, path) = written(&zip(&files, folder, 0));
            assert_eq!(points(&Dataset::open(&path).unwrap()).unwrap(), 13, "{layout} in {folder}");
            assert_eq!(open_octree(&path).unwrap().info().points, Some(13));
        }
    }
}

#[test]
fn what_is_compressed_or_no_dataset_is_told() {
    let files = load(&golden("words"));
    let (_kept, path) = written(&zip(&files, "", 8));
    let error = Dataset::open(&path).unwrap_err();
    assert!(error.to_string().contains("it is compressed in the archive"), "{error}");
    let other = Memory::from([("a.txt".to_owned(), vec![1])]);
    let (_kept, path) = written(&zip(&other, "", 0));
    let error = Dataset::open(&path).unwrap_err();
    assert!(matches!(error.kind(), ErrorKind::Unsupported), "{error}");
    let bytes = zip(&files, "", 0);
    let (_kept, path) = written(&bytes[..bytes.len() - 30]);
    let error = Dataset::open(&path).unwrap_err();
    assert!(matches!(error.kind(), ErrorKind::Broken), "{error}");
}

#[test]
fn damaged_archives_give_points_or_an_error() {
    let good = zip(&load(&golden("words")), "", 0);
    let (_kept, path) = written(&good);
    for seed in 0..2_000 {
        let random = &mut Random::new(seed);
        let mut bytes = good.clone();
        hit(&mut bytes, 4 + random.index(good.len() - 4), random);
        fs::write(&path, bytes).unwrap();
        if let Err(error) = Dataset::open(&path).and_then(|dataset| points(&dataset)) {
            assert!(!error.to_string().contains('\n'), "seed {seed}: {error}");
        }
    }
}
