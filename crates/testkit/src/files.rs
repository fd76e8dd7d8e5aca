//! Paths of fixtures and of the corpus of real files, temporary files, and the files of a dataset.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

/// The folder of the whole project.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A file or folder of `fixtures/`.
pub fn fixture(name: &str) -> PathBuf {
    root().join("fixtures").join(name)
}

/// The bytes of a file of `fixtures/`.
pub fn fixture_bytes(name: &str) -> Vec<u8> {
    read(&fixture(name))
}

/// A file or folder of the corpus of real scans and datasets, which lies beside the project where it is at hand.
/// `None` where it is not; standard error names what is missing, so that a test that returns early is seen.
pub fn corpus(name: &str) -> Option<PathBuf> {
    let path = root().join("../shared/corpus").join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} does not exist", path.display());
    None
}

/// Files and folders of a folder, sorted.
pub fn entries(folder: &Path) -> Vec<PathBuf> {
    let listed = fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut paths: Vec<PathBuf> = listed.map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
}

/// The last part of a path, as text.
pub fn file_name(path: &Path) -> String {
    path.file_name().unwrap().to_str().unwrap().to_owned()
}

/// Every file of a dataset with its bytes, by its name below `folder`, except the report of the run: what must be the same for
/// the same points.
pub fn dataset(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    add_files(folder, "", &mut files);
    files.remove("report.json");
    assert!(!files.is_empty(), "no dataset in {}", folder.display());
    files
}

fn add_files(folder: &Path, prefix: &str, files: &mut BTreeMap<String, Vec<u8>>) {
    for path in entries(folder) {
        let name = format!("{prefix}{}", file_name(&path));
        if path.is_dir() {
            add_files(&path, &format!("{name}/"), files);
        } else {
            files.insert(name, read(&path));
        }
    }
}

/// Asserts that two datasets are the same byte for byte; names the first file that is not, and where.
#[track_caller]
pub fn assert_same_dataset(found: &BTreeMap<String, Vec<u8>>, expected: &BTreeMap<String, Vec<u8>>, what: &str) {
    let names = |files: &BTreeMap<String, Vec<u8>>| files.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(found), names(expected), "{what}");
    for (name, bytes) in found {
        assert_same_bytes(bytes, &expected[name], &format!("{what}: {name}"));
    }
}

/// Asserts that two files are the same; says where they first differ.
#[track_caller]
pub fn assert_same_bytes(found: &[u8], expected: &[u8], what: &str) {
    let differs = found.iter().zip(expected).position(|(a, b)| a != b);
    assert!(found == expected, "{what}: {} and {} bytes, first difference at {differs:?}", found.len(), expected.len());
}

/// A temporary file with these bytes, removed when dropped.
pub fn temporary(bytes: &[u8]) -> tempfile::TempPath {
    let file = tempfile::NamedTempFile::new().unwrap();
    fs::write(file.path(), bytes).unwrap();
    file.into_temp_path()
}

pub(crate) fn read(path: &Path) -> Vec<u8> {
    fs::read(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[should_panic(expected = "b: 3 and 3 bytes, first difference at Some(1)")]
    fn a_dataset_that_differs_is_named() {
        let files = |second: u8| BTreeMap::from([("a".to_owned(), vec![1]), ("b".to_owned(), vec![1, second, 3])]);
        assert_same_dataset(&files(2), &files(2), "same");
        assert_same_dataset(&files(2), &files(4), "other");
    }
}
