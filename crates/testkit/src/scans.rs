//! The scans of `fixtures/`, each with its kind and the right number of points.

use std::path::{Path, PathBuf};

use crate::files::{entries, file_name, fixture, read};
use crate::golden;

/// Folders of `fixtures/` that hold scans.
pub const SCAN_FOLDERS: [&str; 3] = ["las", "e57", "rows"];

/// A scan of `fixtures/`.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanFixture {
    /// Below `fixtures/`: "las/format3.las".
    pub name: String,
    /// The file.
    pub path: PathBuf,
    /// The name of its `ScanKind`: "LAS" for LAZ too, "XYZ" for all lines of numbers without a count.
    pub kind: &'static str,
    /// Points that other programs read from it, of `expected.tsv`.
    pub points: u64,
}

impl ScanFixture {
    /// Its bytes.
    pub fn bytes(&self) -> Vec<u8> {
        read(&self.path)
    }

    /// True if the file declares how many points it has, so that a cut one can be recognised.
    pub fn is_counted(&self) -> bool {
        !matches!(self.kind, "XYZ" | "OBJ")
    }

    /// True for files of some kilobytes; the others are real scans, too large to be read thousands of times.
    pub fn is_small(&self) -> bool {
        self.path.metadata().is_ok_and(|m| m.len() < 200_000)
    }
}

/// The scans of one of [`SCAN_FOLDERS`], sorted by name.
///
/// # Panics
/// If a file has an extension that is not known, or stands in `expected.tsv` without being there.
pub fn scan_fixtures(folder: &str) -> Vec<ScanFixture> {
    let mut points = golden::point_counts(folder);
    let mut scans = Vec::new();
    for path in entries(&fixture(folder)) {
        let file = file_name(&path);
        if file.starts_with("LICENSE") || file == golden::FILE {
            continue;
        }
        // a file without points has no columns to summarise
        let points = points.remove(&file).unwrap_or(0);
        scans.push(ScanFixture { name: format!("{folder}/{file}"), kind: kind(&path), path, points });
    }
    assert!(points.is_empty(), "in the table of {folder} but not there: {points:?}");
    assert!(!scans.is_empty(), "no scans in fixtures/{folder}");
    scans
}

fn kind(path: &Path) -> &'static str {
    match path.extension().and_then(|e| e.to_str()).unwrap_or_default() {
        "las" | "laz" => "LAS",
        "e57" => "E57",
        "ply" => "PLY",
        "pcd" => "PCD",
        "pts" => "PTS",
        "ptx" => "PTX",
        "off" => "OFF",
        "obj" => "OBJ",
        "xyz" | "txt" | "csv" | "asc" => "XYZ",
        _ => panic!("{}: of what kind is it?", path.display()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fixtures_are_known_with_their_points() {
        let all: Vec<ScanFixture> = SCAN_FOLDERS.iter().flat_map(|folder| scan_fixtures(folder)).collect();
        assert!(all.len() > 80);
        let find = |name: &str| all.iter().find(|f| f.name == name).unwrap();
        assert_eq!((find("las/autzen_trim.laz").points, find("las/autzen_trim.laz").is_small()), (110_000, false));
        assert_eq!((find("e57/scans.e57").points, find("e57/scans.e57").kind), (600, "E57"));
        let empty: Vec<&str> = all.iter().filter(|f| f.points == 0).map(|f| f.name.as_str()).collect();
        assert_eq!(empty, ["e57/no_scans.e57"]);
    }
}
