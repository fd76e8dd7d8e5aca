//! What this program wrote, known by what is in the files; names prove nothing. Nothing else is ever deleted.

use std::fs::{self, File};
use std::io::{self, BufReader, Read as _};
use std::path::{Path, PathBuf};

use pointmill_format::DatasetKind;
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

use super::nodes;

/// The account of a run, beside the datasets or in the one that there is.
pub(crate) const REPORT_FILE: &str = "report.json";

/// JSON files of ours are smaller.
const JSON_BYTES: u64 = 1 << 30;

/// The head of an index lies within this.
const HEAD_BYTES: u64 = 64 << 10;

/// Where the header of a LAS file names the program that wrote it.
const SOFTWARE: usize = 58;

/// What stands at the place of an output.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Standing {
    Nothing,
    /// A folder with nothing in it.
    Empty,
    /// A dataset, or several and the report: the files, each named before the folder that holds it, and folders of octrees,
    /// whose files are not named.
    Ours(Vec<PathBuf>),
    /// Something in it is not ours.
    Foreign(PathBuf),
    /// It is no dataset of ours.
    Other,
}

impl Standing {
    /// Looks at `folder`; `aside`: a path in it that does not count.
    pub(super) fn of(folder: &Path, aside: Option<&Path>) -> io::Result<Self> {
        match fs::symlink_metadata(folder) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Self::Nothing),
            Err(e) => return Err(e),
            Ok(meta) if !meta.is_dir() => return Ok(Self::Other),
            Ok(_) => {}
        }
        let mut entries = Vec::new();
        for entry in fs::read_dir(folder)? {
            entries.push(entry?.path());
        }
        entries.retain(|path| Some(path.as_path()) != aside);
        entries.sort();
        if entries.is_empty() {
            return Ok(Self::Empty);
        }
        let datasets: Vec<Own> = DatasetKind::ALL.iter().filter_map(|kind| Own::of(*kind, folder)).collect();
        let several = datasets.is_empty() && is_report(&folder.join(REPORT_FILE));
        let (mut files, mut foreign, mut inside) = (Vec::new(), None, 0);
        for path in entries {
            if datasets.iter().any(|dataset| dataset.owns(&path)) || is_report(&path) {
                files.push(path);
                continue;
            }
            if nodes::is_octree(&path) && datasets.iter().any(|dataset| dataset.kind == DatasetKind::Potree1) {
                foreign = foreign.or(nodes::foreign_in(&path)?);
                files.push(path);
                continue;
            }
            match if several { inner(&path)? } else { Self::Other } {
                Self::Ours(inner) => {
                    inside += 1;
                    files.extend(inner);
                    files.push(path);
                }
                Self::Foreign(path) => {
                    inside += 1;
                    foreign = foreign.or(Some(path));
                }
                _ => foreign = foreign.or(Some(path)),
            }
        }
        Ok(match foreign {
            _ if datasets.is_empty() && inside == 0 => Self::Other,
            Some(path) => Self::Foreign(path),
            None => Self::Ours(files),
        })
    }
}

/// A folder in that of several datasets.
fn inner(path: &Path) -> io::Result<Standing> {
    let name = path.file_name().and_then(|name| name.to_str());
    if name.is_some_and(|name| DatasetKind::ALL.iter().any(|kind| kind.name() == name)) {
        Standing::of(path, None)
    } else {
        Ok(Standing::Other)
    }
}

/// A dataset that this program wrote.
struct Own {
    kind: DatasetKind,
    /// Of the leaves of a binary tree: one file for all.
    is_packed: bool,
}

impl Own {
    fn of(kind: DatasetKind, folder: &Path) -> Option<Self> {
        let marker = folder.join(kind.marker_file());
        let (is_ours, is_packed) = match kind {
            DatasetKind::Potree2 => (is_metadata(&marker), false),
            DatasetKind::Bintree => {
                let head = head(&marker, HEAD_BYTES).unwrap_or_default();
                let has = |key: &str, value: &str| has_pair(&head, key, value);
                (has("format", "pointmill-bintree\"") && has("generator", "pointmill "), has("layout", "packed\""))
            }
            DatasetKind::Potree1 => (is_cloud(&marker) || is_archive(folder, kind), false),
            DatasetKind::Batches => (head(&marker, 8).is_some_and(|h| h == kind.mark().as_bytes()), false),
            DatasetKind::Copc => (head(&marker, HEAD_BYTES).is_some_and(|h| is_copc(&h)), false),
            _ => (false, false),
        };
        is_ours.then_some(Self { kind, is_packed })
    }

    /// True if `path`, an entry of the folder, is a file of this dataset.
    fn owns(&self, path: &Path) -> bool {
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else { return false };
        let is_named = name == self.kind.marker_file()
            || match self.kind {
                DatasetKind::Bintree if self.is_packed => name == "leaves.bin",
                DatasetKind::Bintree => name != "leaves.bin" && self.kind.owns(name),
                _ => self.kind.required_files().contains(&name) || self.kind.archive_file() == Some(name),
            };
        is_named && is_file(path)
    }
}

/// True for a file itself: not for a link to one, a folder or a pipe.
fn is_file(path: &Path) -> bool {
    fs::symlink_metadata(path).is_ok_and(|meta| meta.is_file())
}

/// True if the file is the report of a run, whatever its name.
fn is_report(path: &Path) -> bool {
    #[derive(Deserialize)]
    struct Report {
        #[serde(rename = "version")]
        _version: String,
        #[serde(rename = "checksum_in")]
        _checksum_in: String,
        #[serde(rename = "inputs")]
        _inputs: Vec<IgnoredAny>,
        #[serde(rename = "outputs")]
        _outputs: Vec<IgnoredAny>,
        #[serde(rename = "phases")]
        _phases: Vec<IgnoredAny>,
    }
    path.extension().is_some_and(|e| e == "json") && is_json::<Report>(path)
}

/// True if the file is the metadata of an octree of ours.
fn is_metadata(path: &Path) -> bool {
    #[derive(Deserialize)]
    struct Object {}
    #[derive(Deserialize)]
    struct Metadata {
        #[serde(rename = "hierarchy")]
        _hierarchy: Object,
        #[serde(rename = "pointmill")]
        _pointmill: Object,
    }
    is_json::<Metadata>(path)
}

#[derive(Deserialize)]
struct Object {}

/// What is in the metadata of a Potree 1 octree of ours.
#[derive(Deserialize)]
struct Cloud {
    #[serde(rename = "octreeDir")]
    _octree_dir: String,
    #[serde(rename = "pointmill")]
    _pointmill: Object,
}

/// True if the file is the metadata of a Potree 1 octree of ours.
fn is_cloud(path: &Path) -> bool {
    is_json::<Cloud>(path)
}

/// True if the archive of an output has metadata of ours as its first file.
fn is_archive(folder: &Path, kind: DatasetKind) -> bool {
    let Some(path) = kind.archive_file().map(|name| folder.join(name)).filter(|path| is_file(path)) else {
        return false;
    };
    let Ok(mut file) = File::open(path) else { return false };
    let mut head = [0; 30];
    if file.read_exact(&mut head).is_err() || !head.starts_with(b"PK\x03\x04\x14\0") || head[8..10] != [0, 0] {
        return false;
    }
    let [name, extra] = [26, 28].map(|at| u64::from(u16::from_le_bytes([head[at], head[at + 1]])));
    let bytes = u32::from_le_bytes([head[22], head[23], head[24], head[25]]);
    let (mut named, mut json) = (Vec::new(), Vec::new());
    let read = file.by_ref().take(name).read_to_end(&mut named).and_then(|_| {
        io::copy(&mut file.by_ref().take(extra), &mut io::sink())?;
        file.take(u64::from(bytes).min(JSON_BYTES)).read_to_end(&mut json)
    });
    read.is_ok() && named == kind.marker_file().as_bytes() && serde_json::from_slice::<Cloud>(&json).is_ok()
}

/// True for the first bytes of a COPC file whose header names this program: COPC files of others are scans.
fn is_copc(head: &[u8]) -> bool {
    let software = head.get(SOFTWARE..).unwrap_or_default();
    DatasetKind::Copc.is_marked(head) && software.starts_with(b"pointmill ")
}

/// True if a JSON file has this shape; what does not matter is not kept in memory.
fn is_json<T: DeserializeOwned>(path: &Path) -> bool {
    is_file(path)
        && File::open(path)
            .is_ok_and(|file| serde_json::from_reader::<_, T>(BufReader::new(file.take(JSON_BYTES))).is_ok())
}

/// The first bytes of a file.
fn head(path: &Path, bytes: u64) -> Option<Vec<u8>> {
    if !is_file(path) {
        return None;
    }
    let mut head = Vec::new();
    File::open(path).and_then(|file| file.take(bytes).read_to_end(&mut head)).ok()?;
    Some(head)
}

/// True if a JSON text has a string under `key` that begins with `value`.
fn has_pair(text: &[u8], key: &str, value: &str) -> bool {
    let key = format!("\"{key}\"");
    let value = format!("\"{value}");
    let starts =
        text.windows(key.len()).enumerate().filter(|(_, w)| *w == key.as_bytes()).map(|(at, _)| at + key.len());
    let mut colons = starts.filter_map(|at| text[at..].trim_ascii_start().strip_prefix(b":"));
    colons.any(|rest| rest.trim_ascii_start().starts_with(value.as_bytes()))
}

/// In which order files are given their places, so that what is not all there never looks like a dataset: the files by
/// which datasets are known come last.
pub(super) fn rank(name: &str) -> u8 {
    match name {
        REPORT_FILE => 1,
        name if DatasetKind::ALL.iter().any(|kind| kind.marker_file() == name || kind.archive_file() == Some(name)) => {
            2
        }
        _ => 0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const REPORT: &str = r#"{"version":"0.1.0","inputs":[],"outputs":[],"phases":[],"checksum_in":"0"}"#;

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = dir.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        dir
    }

    fn potree(more: &[(&'static str, &'static str)]) -> Vec<(&'static str, &'static str)> {
        let metadata = ("metadata.json", r#"{"hierarchy": {}, "pointmill": {"version": "0.1.0"}}"#);
        [&[metadata, ("octree.bin", ""), ("hierarchy.bin", "")], more].concat()
    }

    /// The head of a COPC file, which is text by chance.
    fn copc(software: &str) -> String {
        format!("LASF{:54}{software:\0<317}\0\0copc{:\0<12}\u{1}\0", "", "")
    }

    fn standing(dir: &tempfile::TempDir) -> String {
        match Standing::of(dir.path(), None).unwrap() {
            Standing::Foreign(path) => format!("foreign {}", path.strip_prefix(dir.path()).unwrap().display()),
            Standing::Ours(files) => format!("ours {}", files.len()),
            other => format!("{other:?}"),
        }
    }

    #[test]
    fn what_this_program_wrote_is_known_by_its_content() {
        let packed = r#"{"format": "pointmill-bintree", "generator": "pointmill 0.1.0", "layout": "packed"}"#;
        let leaves = r#"{"format":"pointmill-bintree","generator":"pointmill 0.1.0","layout":"files"}"#;
        assert_eq!(standing(&folder(&[])), "Empty");
        assert_eq!(standing(&folder(&potree(&[("report.json", REPORT), ("run 2.json", REPORT)]))), "ours 5");
        assert_eq!(standing(&folder(&[("index.json", packed), ("leaves.bin", "")])), "ours 2");
        assert_eq!(standing(&folder(&[("index.json", leaves), ("n01.bin", "")])), "ours 2");
        assert_eq!(standing(&folder(&[("points.qbatch", "QBATCHES…")])), "ours 1");
        let several = [("report.json", REPORT), ("batches/points.qbatch", "QBATCHES"), ("bintree/index.json", packed)];
        assert_eq!(standing(&folder(&several)), "ours 5");

        let cloud = ("cloud.js", r#"{"version": "1.7", "octreeDir": "data", "pointmill": {"version": "0.1.0"}}"#);
        let potree1 = [cloud, ("data/r/r.bin", ""), ("data/r/01234/r01234.hrc", ""), ("report.json", REPORT)];
        assert_eq!(standing(&folder(&potree1)), "ours 3", "its nodes are not listed");
        assert_eq!(standing(&folder(&[cloud, ("data/r/x", "")])), "foreign data/r/x");
        assert_eq!(standing(&folder(&[cloud, ("data", "")])), "foreign data");
        let inner = [("report.json", REPORT), ("potree1/cloud.js", cloud.1), ("potree1/data/r/r.bin", "")];
        assert_eq!(standing(&folder(&inner)), "ours 4");

        assert_eq!(standing(&folder(&[("points.copc.laz", &copc("pointmill 0.1.0"))])), "ours 1");

        let other = [
            ("points.copc.laz", copc("PDAL 2.8.0")),
            ("points.copc.laz", copc("pointmill 0.1.0").replace("copc", "corp")),
            ("cloud.js", r#"{"version": "1.7", "octreeDir": "data"}"#.to_owned()),
            ("index.json", packed.replace("pointmill 0", "tree 0")),
            ("metadata.json", r#"{"hierarchy": {}, "author": "me"}"#.to_owned()),
            ("points.qbatch", "see QBATCHES".to_owned()),
            ("report.json", REPORT.to_owned()),
        ];
        for (name, text) in &other {
            assert_eq!(standing(&folder(&[(name, text)])), "Other", "{name}");
        }
        assert_eq!(standing(&folder(&[("index.json", packed), ("n01.bin", "")])), "foreign n01.bin");
        assert_eq!(standing(&folder(&[("index.json", leaves), ("leaves.bin", "")])), "foreign leaves.bin");
    }

    #[test]
    fn what_only_bears_a_name_of_ours_is_foreign() {
        for name in ["log.txt", "log.txt/x", "leaves.bin", "notes.md", "report.json", "metadata.json.bak", "potree2/x"]
        {
            let found = standing(&folder(&potree(&[(name, "{}")])));
            assert_eq!(found, format!("foreign {}", name.split('/').next().unwrap()));
        }
        let metadata = potree(&[])[0];
        assert_eq!(standing(&folder(&[metadata, ("octree.bin/x", "")])), "foreign octree.bin");
        let inner = [("report.json", REPORT), ("batches/points.qbatch", "QBATCHES"), ("batches/x", "")];
        assert_eq!(standing(&folder(&inner)), "foreign batches/x");
        let beside = [("report.json", REPORT), ("batches/points.qbatch", "QBATCHES"), ("bintree/x", "")];
        assert_eq!(standing(&folder(&beside)), "foreign bintree");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_is_foreign() {
        let dir = folder(&potree(&[]));
        fs::rename(dir.path().join("octree.bin"), dir.path().join("../octree-elsewhere")).unwrap();
        std::os::unix::fs::symlink("../octree-elsewhere", dir.path().join("octree.bin")).unwrap();
        assert_eq!(standing(&dir), "foreign octree.bin");
        fs::remove_file(dir.path().join("../octree-elsewhere")).unwrap();
    }
}
