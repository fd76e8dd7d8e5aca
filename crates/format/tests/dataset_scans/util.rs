//! Datasets to open, and what is read of them.

use std::fs;
use std::path::{Path, PathBuf};

use pointmill_format::{OpenOptions, ReadError, Scan, open_scan};
use pointmill_testkit::files::{dataset, fixture};
use pointmill_testkit::reader::{Cloud, Reader};

pub(crate) const READER: Reader = Reader {
    open: |path| open_scan(path, &OpenOptions::default()),
    max_points: |bytes| bytes,
    max_decoded: |bytes| bytes,
};

/// Opens what is expected to be no scan.
pub(crate) fn refused(path: &Path, options: &OpenOptions) -> ReadError {
    open_scan(path, options).err().unwrap_or_else(|| panic!("{} is opened", path.display()))
}

pub(crate) fn open(name: &str, options: &OpenOptions) -> Box<dyn Scan> {
    open_scan(fixture(name), options).unwrap()
}

/// A copy of a dataset, some of whose files are changed.
pub(crate) fn changed(name: &str, change: impl Fn(&str, &mut Vec<u8>)) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("dataset");
    for (name, mut bytes) in dataset(&fixture(name)) {
        change(&name, &mut bytes);
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    (dir, folder)
}

/// A point: its integers, then the values of all columns.
pub(crate) fn records(cloud: &Cloud) -> Vec<Vec<f64>> {
    let columns: Vec<Vec<f64>> = cloud.info.attributes.iter().map(|a| cloud.values(&a.name)).collect();
    let record = |i: usize| {
        let mut record: Vec<f64> = cloud.xyz.iter().map(|axis| axis[i]).collect();
        for (column, attribute) in columns.iter().zip(cloud.info.attributes.iter()) {
            record.extend(&column[i * attribute.elements..(i + 1) * attribute.elements]);
        }
        record
    };
    let mut all: Vec<Vec<f64>> = (0..cloud.xyz[0].len()).map(record).collect();
    all.sort_by(|a, b| a.partial_cmp(b).unwrap());
    all
}
