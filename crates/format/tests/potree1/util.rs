//! What the tests share.

use std::path::{Path, PathBuf};

use pointmill_format::bytes::Memory;
use pointmill_format::potree1::Dataset;
use pointmill_format::{NodePoints, ReadError};
use pointmill_testkit::files::fixture;

/// The folder of a golden dataset.
pub(crate) fn golden(name: &str) -> PathBuf {
    fixture("potree1").join(name)
}

/// A dataset's files in memory, by their paths in its folder.
pub(crate) fn load(folder: &Path) -> Memory {
    fn add(folder: &Path, prefix: &str, files: &mut Memory) {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = format!("{prefix}{}", path.file_name().unwrap().to_str().unwrap());
            if path.is_dir() {
                add(&path, &format!("{name}/"), files);
            } else {
                files.insert(name, std::fs::read(path).unwrap());
            }
        }
    }
    let mut files = Memory::new();
    add(folder, "", &mut files);
    files
}

pub(crate) fn open(files: &Memory) -> Result<Dataset, ReadError> {
    Dataset::from_source(files.clone())
}

/// Points of all nodes by name, as they are read.
pub(crate) fn read_all(dataset: &Dataset) -> Result<Vec<(String, NodePoints)>, ReadError> {
    let read = |key| {
        let mut points = NodePoints::default();
        dataset.read_points(key, &mut points)?;
        Ok(points)
    };
    dataset.read_hierarchy()?.iter().map(|node| Ok((node.key.to_string(), read(node.key)?))).collect()
}
