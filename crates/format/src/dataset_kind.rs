//! The kinds of datasets: names, files, and how each is recognised. A new format is one row here.

use std::fs;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use crate::ReadError;
use crate::bytes::open_file;
use crate::names::named;

/// A kind of dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum DatasetKind {
    /// Potree 2.0: a folder with `metadata.json` ([`crate::potree2`]).
    Potree2,
    /// Potree 1.x: a folder with `cloud.js` ([`crate::potree1`]).
    Potree1,
    /// Mean-split binary tree: a folder with `index.json` ([`crate::bintree`]).
    Bintree,
    /// Quantised batches: a file `*.qbatch`, or a folder with `points.qbatch` ([`crate::batches`]).
    Batches,
    /// COPC 1.0: a LAZ file, which is a scan too, by habit `*.copc.laz`, or a folder with `points.copc.laz` (`copc`, feature
    /// `las`).
    Copc,
}

/// The facts about one kind; see the methods of [`DatasetKind`].
struct Row {
    name: &'static str,
    title: &'static str,
    marker: &'static str,
    mark: &'static str,
    /// Bytes that stand at these places of the marker file.
    places: &'static [(usize, &'static [u8])],
    required: &'static [&'static str],
    optional: &'static [&'static str],
    /// Names that follow a pattern.
    owns: fn(&str) -> bool,
    /// A dataset that is one file can have any name with this extension, or any name at all if places tell it.
    extension: Option<&'static str>,
}

const NO_PATTERN: fn(&str) -> bool = |_| false;

const POTREE2: Row = Row {
    name: "potree2",
    title: "Potree 2.0",
    marker: "metadata.json",
    mark: "\"hierarchy\"",
    places: &[],
    required: &["hierarchy.bin", "octree.bin"],
    optional: &["log.txt"], // PotreeConverter writes it
    owns: NO_PATTERN,
    extension: None,
};

/// A Potree 1.x dataset in one file, in the folder of its output.
const POTREE1_ARCHIVE: &str = "potree1.zip";

const POTREE1: Row = Row {
    name: "potree1",
    title: "Potree 1.x",
    marker: "cloud.js",
    mark: "\"octreeDir\"",
    places: &[],
    required: &[],                                // the folder of the nodes can have any name
    optional: &["sources.json", POTREE1_ARCHIVE], // PotreeConverter writes the first
    owns: is_node_file,
    extension: None,
};

const BINTREE: Row = Row {
    name: "bintree",
    title: "binary tree",
    marker: "index.json",
    mark: "\"pointmill-bintree\"",
    places: &[],
    required: &[], // which of the others are there depends on the layout
    optional: &["leaves.bin"],
    owns: is_leaf_file,
    extension: None,
};

const BATCHES: Row = Row {
    name: "batches",
    title: "quantised batches",
    marker: "points.qbatch",
    mark: "QBATCHES",
    places: &[],
    required: &[],
    optional: &[],
    owns: NO_PATTERN,
    extension: Some("qbatch"),
};

const COPC: Row = Row {
    name: "copc",
    title: "COPC",
    marker: "points.copc.laz",
    mark: "copc",
    places: &[(0, b"LASF"), (377, b"copc\0"), (393, &[1, 0])], // LAS, and its first record is the info record
    required: &[],
    optional: &[],
    owns: NO_PATTERN,
    extension: Some("copc.laz"),
};

/// `r0427.bin`, `r0427.hrc`: a node of an octree, named after its path from the root.
fn is_node_file(name: &str) -> bool {
    let path = name.strip_prefix('r').and_then(|r| r.strip_suffix(".bin").or_else(|| r.strip_suffix(".hrc")));
    path.is_some_and(|p| p.bytes().all(|b| matches!(b, b'0'..=b'7')))
}

/// `n0101.bin`: a leaf of a binary tree, named after its path from the root.
fn is_leaf_file(name: &str) -> bool {
    let path = name.strip_prefix('n').and_then(|n| n.strip_suffix(".bin"));
    path.is_some_and(|p| p.bytes().all(|b| matches!(b, b'0' | b'1')))
}

/// A mark is looked for in this many bytes from the start of the marker file.
const MARK_WITHIN_BYTES: u64 = 64 << 10;

impl DatasetKind {
    /// Every kind.
    pub const ALL: &[Self] = &[Self::Potree2, Self::Potree1, Self::Bintree, Self::Batches, Self::Copc];

    const fn row(self) -> &'static Row {
        match self {
            Self::Potree2 => &POTREE2,
            Self::Potree1 => &POTREE1,
            Self::Bintree => &BINTREE,
            Self::Batches => &BATCHES,
            Self::Copc => &COPC,
        }
    }

    /// The word in reports and on the command line, and the name of its folder beside other datasets: "potree2".
    pub const fn name(self) -> &'static str {
        self.row().name
    }

    /// The name for people: "Potree 2.0".
    pub const fn title(self) -> &'static str {
        self.row().title
    }

    /// The file that a folder of this kind is known by: "metadata.json".
    pub const fn marker_file(self) -> &'static str {
        self.row().marker
    }

    /// Text within the first 64 KiB of the marker file that distinguishes it from files of the same name.
    pub const fn mark(self) -> &'static str {
        self.row().mark
    }

    /// The file in an output's folder that is a whole dataset of this kind, archived: "potree1.zip".
    pub const fn archive_file(self) -> Option<&'static str> {
        match self {
            Self::Potree1 => Some(POTREE1_ARCHIVE),
            _ => None,
        }
    }

    /// The files that a dataset cannot be without, besides the marker file.
    pub const fn required_files(self) -> &'static [&'static str] {
        self.row().required
    }

    /// True if the dataset is one file, which may have any name with this kind's extension; false if it is a folder.
    pub const fn is_single_file(self) -> bool {
        self.row().extension.is_some()
    }

    /// True if a file of that name belongs to a dataset of this kind. `name`: without a folder.
    #[must_use]
    pub fn owns(self, name: &str) -> bool {
        let row = self.row();
        name == row.marker || row.required.contains(&name) || row.optional.contains(&name) || (row.owns)(name)
    }

    /// True if the first bytes of a file, 64 KiB or all, are those of a marker file of this kind.
    #[must_use]
    pub fn is_marked(self, first_bytes: &[u8]) -> bool {
        let Row { mark, places, .. } = *self.row();
        let is_at = |(place, bytes): &(usize, &[u8])| first_bytes.get(*place..).is_some_and(|b| b.starts_with(bytes));
        places.iter().all(is_at)
            && (!places.is_empty() || first_bytes.windows(mark.len()).any(|w| w == mark.as_bytes()))
    }

    /// The kind of the dataset at `path`, a folder or its marker file, by name and content: the marker file is there
    /// and has its mark; or of the one in an archive (feature `zip`). `None` for anything else, and for what cannot be read.
    ///
    /// ```
    /// use pointmill_format::DatasetKind;
    ///
    /// let fixtures = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures");
    /// assert_eq!(DatasetKind::detect(format!("{fixtures}/las")), None);
    /// assert_eq!(DatasetKind::detect(format!("{fixtures}/bintree/files")), Some(DatasetKind::Bintree));
    /// ```
    #[must_use]
    pub fn detect(path: impl AsRef<Path>) -> Option<Self> {
        let path = path.as_ref();
        let located = find(path)?;
        // an archive was looked into
        let is_archive = located.path == path && !located.kind.is_single_file() && path.is_file();
        (is_archive || starts_as(located.kind, &located.marker_path())).then_some(located.kind)
    }
}

named!(DatasetKind, "kind of dataset");

impl Serialize for DatasetKind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// A dataset that was found by the names of its files ([`locate`]).
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Located {
    /// What its files are called like.
    pub kind: DatasetKind,
    /// Its folder; of a kind that is one file, the file; of an archive with a Potree 1.x dataset in it (feature `zip`), the archive.
    pub path: PathBuf,
}

impl Located {
    /// The path of its marker file.
    pub fn marker_path(&self) -> PathBuf {
        if self.kind.is_single_file() { self.path.clone() } else { self.path.join(self.kind.marker_file()) }
    }
}

/// Finds the dataset at `path`, a folder or its marker file, by the names of files alone: a damaged one is found too. A COPC file
/// is also found by its content, whatever it is called.
///
/// # Errors
/// `path` leads to nothing, or to nothing that is named like a dataset; or what is named like one is no file, or may not be
/// looked at.
pub fn locate(path: impl AsRef<Path>) -> Result<Located, ReadError> {
    let path = path.as_ref();
    fs::metadata(path).map_err(|e| ReadError::io(path, "opening", e))?;
    if let Some(located) = find(path) {
        return Ok(located);
    }
    for marker in DatasetKind::ALL.iter().map(|kind| path.join(kind.marker_file())).filter(|_| path.is_dir()) {
        match open_file(&marker) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(ReadError::io(marker, "opening", e)),
            _ => {}
        }
    }
    Err(ReadError::unsupported(path, "not a dataset of any known kind").advise(advice()))
}

fn find(path: &Path) -> Option<Located> {
    let mut kinds = DatasetKind::ALL.iter().copied();
    if path.is_dir() {
        let kind = match kinds.find(|kind| path.join(kind.marker_file()).is_file()) {
            Some(kind) => kind,
            None => {
                let archive = path.join(POTREE1_ARCHIVE);
                let is_one = is_archive_of(&archive, DatasetKind::Potree1);
                return is_one.then_some(Located { kind: DatasetKind::Potree1, path: archive });
            }
        };
        let path = if kind.is_single_file() { path.join(kind.marker_file()) } else { path.to_path_buf() };
        return Some(Located { kind, path });
    }
    if is_archive_of(path, DatasetKind::Potree1) {
        return Some(Located { kind: DatasetKind::Potree1, path: path.to_path_buf() });
    }
    let is = |kind: &DatasetKind| match kind.row().extension {
        Some(extension) => has_extension(path, extension) || !kind.row().places.is_empty() && starts_as(*kind, path),
        None => path.file_name().is_some_and(|name| name == kind.marker_file()),
    };
    let kind = kinds.find(is)?;
    // "metadata.json" alone has the parent "", which is no path to open
    let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let path = if kind.is_single_file() { path } else { parent };
    Some(Located { kind, path: path.to_path_buf() })
}

/// True for an archive with such a dataset in it.
#[cfg(feature = "zip")]
fn is_archive_of(path: &Path, kind: DatasetKind) -> bool {
    use crate::bytes::{Archive, ByteSource as _};
    let is_named = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("zip"));
    let start = || {
        let archive = Archive::open(path, kind.marker_file()).ok()?;
        let size = archive.size(kind.marker_file()).ok()?;
        let mut start = vec![0; size.min(MARK_WITHIN_BYTES) as usize];
        archive.read_at(kind.marker_file(), 0, &mut start).ok()?;
        Some(start)
    };
    is_named && start().is_some_and(|start| kind.is_marked(&start))
}

#[cfg(not(feature = "zip"))]
const fn is_archive_of(_: &Path, _: DatasetKind) -> bool {
    false
}

/// What can be given instead, of every kind.
fn advice() -> String {
    let folders = DatasetKind::ALL.iter().copied().filter(|kind| !kind.is_single_file());
    let folders: Vec<String> = folders.map(|kind| format!("{} ({})", kind.marker_file(), kind.title())).collect();
    let files = DatasetKind::ALL.iter().copied().filter_map(|kind| kind.row().extension);
    let files: String = files.map(|extension| format!(", or a .{extension} file")).collect();
    format!("give a folder with {}{files}", folders.join(" or "))
}

/// True for `a.copc.laz` and "copc.laz"; a name that is an extension alone has none.
fn has_extension(path: &Path, extension: &str) -> bool {
    let name = path.file_name().map(|name| name.as_encoded_bytes());
    let stem = name.and_then(|name| name.strip_suffix(extension.as_bytes())?.strip_suffix(b"."));
    stem.is_some_and(|stem| !stem.is_empty())
}

fn starts_as(kind: DatasetKind, file: &Path) -> bool {
    let mut start = Vec::new();
    let read = open_file(file).and_then(|f| f.take(MARK_WITHIN_BYTES).read_to_end(&mut start));
    read.is_ok() && kind.is_marked(&start)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The least that a marker file has to have.
    fn marked(kind: DatasetKind) -> Vec<u8> {
        let mut bytes = format!("{{ {} }}", kind.mark()).into_bytes();
        for (place, part) in kind.row().places {
            bytes.resize(bytes.len().max(place + part.len()), 0);
            bytes[*place..][..part.len()].copy_from_slice(part);
        }
        bytes
    }

    #[test]
    fn a_dataset_is_found_by_the_file_it_is_known_by_or_its_folder() {
        let temp = tempfile::tempdir().unwrap();
        for &kind in DatasetKind::ALL {
            let folder = temp.path().join(kind.name());
            let file = folder.join(kind.marker_file());
            fs::create_dir(&folder).unwrap();
            assert!(locate(&folder).is_err());
            fs::write(&file, "").unwrap();
            let path = if kind.is_single_file() { file.clone() } else { folder.clone() };
            let expected = Located { kind, path };
            assert_eq!(expected.marker_path(), file);
            assert_eq!(locate(&folder).unwrap(), expected);
            assert_eq!(locate(&file).unwrap(), expected);
            assert_eq!(DatasetKind::detect(&folder), None, "found by name, but without its mark");
            fs::write(&file, marked(kind)).unwrap();
            assert_eq!([&folder, &file].map(DatasetKind::detect), [Some(kind); 2]);
        }
    }

    #[test]
    fn what_is_not_a_dataset_is_refused_with_what_is_supported() {
        let temp = tempfile::tempdir().unwrap();
        let scan = temp.path().join("a.las");
        fs::write(&scan, "LASF").unwrap();
        for path in [temp.path(), &scan] {
            let line = locate(path).unwrap_err().to_string();
            let advice = "give a folder with metadata.json (Potree 2.0) or cloud.js (Potree 1.x) or index.json (binary tree), or a \
                          .qbatch file, or a .copc.laz file";
            assert!(line.ends_with(advice), "{line}");
        }
        assert!(locate(temp.path().join("nothing")).is_err());
    }

    #[test]
    fn a_copc_file_is_found_by_its_content_whatever_its_name_and_by_its_name_when_it_is_damaged() {
        let temp = tempfile::tempdir().unwrap();
        let copc = |path: &Path| locate(path).is_ok_and(|l| (l.kind, l.path.as_path()) == (DatasetKind::Copc, path));
        for (name, bytes, is_found, is_copc) in [
            ("tile.laz", marked(DatasetKind::Copc), true, true),
            ("tile.copc.laz", marked(DatasetKind::Copc), true, true),
            ("broken.copc.laz", b"LASF".to_vec(), true, false),
            ("plain.laz", [&b"LASF"[..], &[0; 400]].concat(), false, false),
            (".copc.laz", b"LASF".to_vec(), false, false),
        ] {
            let path = temp.path().join(name);
            fs::write(&path, bytes).unwrap();
            assert_eq!((copc(&path), DatasetKind::detect(&path).is_some()), (is_found, is_copc), "{name}");
        }
    }

    #[test]
    fn files_belong_to_one_kind_and_names_come_back() {
        let owned = |name| DatasetKind::ALL.iter().copied().filter(|kind| kind.owns(name)).collect::<Vec<_>>();
        for (name, kind) in [
            ("metadata.json", DatasetKind::Potree2),
            ("octree.bin", DatasetKind::Potree2),
            ("log.txt", DatasetKind::Potree2),
            ("cloud.js", DatasetKind::Potree1),
            ("sources.json", DatasetKind::Potree1),
            ("potree1.zip", DatasetKind::Potree1),
            ("r.hrc", DatasetKind::Potree1),
            ("r0427.bin", DatasetKind::Potree1),
            ("leaves.bin", DatasetKind::Bintree),
            ("n.bin", DatasetKind::Bintree),
            ("n0101.bin", DatasetKind::Bintree),
            ("points.qbatch", DatasetKind::Batches),
            ("points.copc.laz", DatasetKind::Copc),
        ] {
            assert_eq!(owned(name), [kind], "{name}");
        }
        for name in ["", "n2.bin", "r8.bin", "r0.laz", "n01", "letter.txt", "report.json"] {
            assert_eq!(owned(name), [], "{name}");
        }
        for &kind in DatasetKind::ALL {
            assert_eq!(kind.to_string().parse(), Ok(kind));
        }
        assert!(
            "Potree"
                .parse::<DatasetKind>()
                .unwrap_err()
                .to_string()
                .contains("potree2, potree1, bintree, batches, copc")
        );
    }
}
