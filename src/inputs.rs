//! Finds the scans: files, folders, globs and lists become one sorted list of files.
//!
//! The file type is detected from the content, or from the extension if the content is not recognised. A file that was
//! named must be a scan; other files in a folder or a glob are skipped and reported.

mod kind;

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::ffi::OsStr;
use std::fs;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use pointmill_format::{OpenOptions, supported_scans};

use crate::args::InputArgs;
use crate::exit::Failure;
use crate::human::quantities::plural;
use kind::{is_other, kind_by_ending, kind_in_folder};

use crate::scan_choice;
pub(crate) use kind::{Kind, kind};

/// The scans to read, and notes about the search for them.
#[derive(Debug, Default)]
pub(crate) struct Inputs {
    /// Sorted by path, each file once.
    pub(crate) files: Vec<PathBuf>,
    /// Files that a folder or a glob brought along and that are no scans, in order of path.
    pub(crate) other_files: Vec<PathBuf>,
    /// One line each.
    pub(crate) notes: Vec<String>,
}

impl Inputs {
    /// The notes, and a line for the other files: for commands that write no report.
    pub(crate) fn all_notes(&self) -> impl Iterator<Item = String> {
        let other = (!self.other_files.is_empty()).then(|| other_files(&self.other_files));
        self.notes.iter().cloned().chain(other)
    }
}

/// Says which files were skipped.
fn other_files(files: &[PathBuf]) -> String {
    pointmill_converter::Warning::OtherFiles { files: files.to_vec() }.to_string()
}

impl InputArgs {
    /// Facts about scans that their files do not state.
    pub(crate) fn options(&self) -> Result<OpenOptions, Failure> {
        self.reading.options()
    }

    /// Finds the scans.
    pub(crate) fn expand(&self) -> Result<Inputs, Failure> {
        let options = self.options()?;
        let mut typed = self.inputs.clone();
        if let Some(list) = &self.files_from {
            typed.extend(read_list(list)?);
        }
        let found = expand(&typed, &options)?;
        scan_choice::check(&found.files, &options)?;
        Ok(found)
    }
}

/// Finds the scans that `typed` means: files, folders (recursive), globs where no such path exists. A file that is
/// named together with its columns is text, whatever it looks like.
pub(crate) fn expand(typed: &[PathBuf], options: &OpenOptions) -> Result<Inputs, Failure> {
    if typed.is_empty() {
        return Err(Failure::Usage("no input: pass scans, folders or globs, or --files-from LIST".to_owned()));
    }
    let mut search = Search { options: options.clone(), ..Search::default() };
    for path in typed {
        search.add_typed(path)?;
    }
    search.finish(typed)
}

#[derive(Default)]
struct Search {
    /// By canonical path, so that a file counts once however it is spelt.
    found: BTreeMap<PathBuf, PathBuf>,
    repeated: Vec<PathBuf>,
    no_scans: Vec<PathBuf>,
    options: OpenOptions,
}

impl Search {
    fn add_typed(&mut self, path: &Path) -> Result<(), Failure> {
        match fs::metadata(path) {
            Ok(meta) if meta.is_dir() => self.add_folder(path),
            Ok(_) => self.add_named_file(path),
            Err(e) if e.kind() == io::ErrorKind::NotFound => self.add_glob(path),
            Err(e) => Err(Failure::io(path, "reading the input", &e)),
        }
    }

    /// A file that was named must be a scan.
    fn add_named_file(&mut self, path: &Path) -> Result<(), Failure> {
        let kind = kind(path).map_err(|e| Failure::io(path, "reading the input", &e))?;
        if kind == Kind::NoScan || is_other(path, self.options.columns.is_some()).unwrap_or(false) {
            // the readers report why, unless the named columns make it a text scan
            pointmill_format::open_scan(path, &self.options)?;
        }
        self.add_scan(path);
        Ok(())
    }

    /// A file that a folder or a glob brought along.
    fn add_met_file(&mut self, path: &Path, kind: fn(&Path) -> io::Result<Kind>) {
        // A file that cannot be opened but has the extension of a scan is kept: its reader reports why, and --unreadable
        // decides.
        let is_other = || is_other(path, self.options.columns.is_some()).unwrap_or(false);
        match kind(path).unwrap_or_else(|_| kind_by_ending(path)) {
            Kind::Scan if !is_other() => self.add_scan(path),
            _ => self.no_scans.push(path.to_path_buf()),
        }
    }

    fn add_folder(&mut self, folder: &Path) -> Result<(), Failure> {
        for entry in walkdir::WalkDir::new(folder).follow_links(true).sort_by_file_name() {
            match entry {
                Ok(entry) if entry.file_type().is_dir() => {}
                Ok(entry) => self.add_met_file(entry.path(), kind_in_folder),
                Err(e) => match (e.path(), e.io_error()) {
                    (Some(path), Some(error)) if error.kind() == io::ErrorKind::NotFound => {
                        self.add_met_file(path, kind_in_folder);
                    }
                    (Some(path), Some(error)) if is_of_the_system(path, error) => {
                        self.no_scans.push(path.to_path_buf());
                    }
                    (Some(path), Some(error)) => return Err(Failure::io(path, "searching the folder", error)),
                    // A link that leads back to a folder above it: what is there is found anyway.
                    _ => {}
                },
            }
        }
        Ok(())
    }

    fn add_glob(&mut self, path: &Path) -> Result<(), Failure> {
        let pattern = path.to_str().filter(|p| p.contains(['*', '?', '[']));
        let Some(pattern) = pattern else {
            return Err(Failure::Usage(format!("{}: no such file or folder", path.display())));
        };
        let matches = glob::glob(pattern).map_err(|e| Failure::Usage(format!("{pattern}: {e}")))?;
        let mut any = false;
        for found in matches {
            let found = found.map_err(|e| Failure::io(e.path(), "searching the folder", e.error()))?;
            any = true;
            if found.is_dir() { self.add_folder(&found)? } else { self.add_met_file(&found, kind) }
        }
        if any { Ok(()) } else { Err(Failure::Usage(format!("{pattern}: no file matches"))) }
    }

    fn add_scan(&mut self, path: &Path) {
        match self.found.entry(identity(path)) {
            Entry::Vacant(entry) => drop(entry.insert(path.to_path_buf())),
            Entry::Occupied(mut kept) => {
                self.repeated.push(path.to_path_buf());
                // The least spelling stands for the file, so that the order of typing does not show.
                if path < kept.get() {
                    kept.insert(path.to_path_buf());
                }
            }
        }
    }

    fn finish(self, typed: &[PathBuf]) -> Result<Inputs, Failure> {
        let mut notes = Vec::new();
        let mut note = |count: usize, noun: &str, what: &str, examples: Vec<String>| {
            if count > 0 {
                let more = if count > examples.len() { ", …" } else { "" };
                notes.push(format!("{} {what} ({}{more})", plural(count as u64, noun), examples.join(", ")));
            }
        };
        let name = |path: &PathBuf| path.display().to_string();
        let examples = |paths: &[PathBuf]| paths.iter().take(3).map(name).collect();
        note(self.repeated.len(), "input", "named more than once, read once", examples(&self.repeated));

        let mut files: Vec<PathBuf> = self.found.into_values().collect();
        files.sort();
        if files.is_empty() {
            let places: Vec<String> = typed.iter().take(3).map(name).collect();
            let others = self.no_scans.first().map(|_| format!("; {}", other_files(&self.no_scans)));
            let skipped = others.unwrap_or_default();
            return Err(Failure::Input(format!(
                "{}: no scan found (supported: {}){skipped}",
                places.join(", "),
                supported_scans()
            )));
        }
        let mut other_files = self.no_scans;
        other_files.sort();
        other_files.dedup();
        Ok(Inputs { files, other_files, notes })
    }
}

/// True for a folder that the operating system keeps on a disk and does not open.
fn is_of_the_system(path: &Path, error: &io::Error) -> bool {
    let names = ["lost+found", "System Volume Information", "$RECYCLE.BIN"];
    error.kind() == io::ErrorKind::PermissionDenied
        && path.file_name().is_some_and(|name| names.iter().any(|system| name == *system))
}

/// One path for all spellings of a file; for a broken link its own place in its folder's.
fn identity(path: &Path) -> PathBuf {
    let in_folder = || Some(fs::canonicalize(path.parent()?).ok()?.join(path.file_name()?));
    fs::canonicalize(path).ok().or_else(in_folder).unwrap_or_else(|| path.to_path_buf())
}

/// The paths in `list`, one per line; `-` is standard input.
fn read_list(list: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut bytes = Vec::new();
    let read = if list.as_os_str() == "-" {
        io::stdin().lock().read_to_end(&mut bytes).map(|_| ())
    } else {
        fs::read(list).map(|b| bytes = b)
    };
    match read {
        Err(e) if e.kind() == io::ErrorKind::NotFound => {
            return Err(Failure::Usage(format!("{}: no such list", list.display())));
        }
        Err(e) => return Err(Failure::io(list, "reading the list of inputs", &e)),
        Ok(()) => {}
    }
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(&bytes);
    let lines = bytes.split(|b| *b == b'\n').map(|line| line.strip_suffix(b"\r").unwrap_or(line));
    Ok(lines.filter(|line| !line.is_empty() && line[0] != b'#').map(path_from_bytes).collect())
}

/// File names are bytes on Unix: they need not be UTF-8.
#[cfg(unix)]
fn path_from_bytes(bytes: &[u8]) -> PathBuf {
    use std::os::unix::ffi::OsStrExt as _;
    PathBuf::from(OsStr::from_bytes(bytes))
}

#[cfg(not(unix))]
fn path_from_bytes(bytes: &[u8]) -> PathBuf {
    PathBuf::from(String::from_utf8_lossy(bytes).into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder with three scans (one of them by ending alone) and other files, some of which hold lines of numbers.
    fn folder() -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        fs::create_dir(dir.path().join("süd")).unwrap();
        for (name, bytes) in [
            ("b.dat", &b"LASF and more"[..]),
            ("süd/a.LAZ", b""),
            ("c.ply", b"ply\nformat ascii 1.0\n"),
            ("notes.txt", b"hello"),
            ("matrix.txt", b"1 0 0\n0 1 0\n0 0 1\n"),
            ("counted.log", b"2\n1 0 0\n0 1 0\n"),
            ("._b.laz", b"Finder"),
        ] {
            fs::write(dir.path().join(name), bytes).unwrap();
        }
        dir
    }

    fn find(typed: &[PathBuf]) -> Result<Inputs, Failure> {
        expand(typed, &OpenOptions::default())
    }

    fn names(inputs: &Inputs) -> Vec<&str> {
        inputs.files.iter().map(|f| f.file_name().unwrap().to_str().unwrap()).collect()
    }

    #[test]
    fn a_folder_gives_its_scans_sorted_and_says_what_it_left_out() {
        let dir = folder();
        let inputs = find(&[dir.path().to_path_buf()]).unwrap();
        assert_eq!(names(&inputs), ["b.dat", "c.ply", "a.LAZ"]);
        let [note] = &inputs.all_notes().collect::<Vec<_>>()[..] else { panic!("{:?}", inputs.other_files) };
        assert!(note.starts_with("4 other files skipped, not scans"), "{note}");
        assert!(["._b.laz", "counted.log", "matrix.txt"].iter().all(|name| note.contains(name)), "{note}");
    }

    #[test]
    fn what_is_called_like_a_scan_and_is_none_is_skipped_in_a_folder() {
        let dir = tempfile::tempdir().unwrap();
        for (name, text) in [
            ("scan.xyz", "1 2 3\n4 5 6\n"),
            ("scan.csv", "a,b,x,y,z\n1,2,3,4,5\n"),
            ("broken.pts", "2\n1 2 3\n4 5\n"),
            ("dem.asc", "ncols 2\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n"),
            ("weather.csv", "time,temperature,humidity\n1,20.5,40\n2,21,41\n"),
            ("well.las", "~Version Information\n VERS. 2.0\n"),
            ("face.pts", "version: 1\nn_points: 2\n{\n1 2\n}\n"),
            ("water.xyz", "3\nwater\nO 0 0 0\nH 0 0 1\nH 0 1 0\n"),
            ("tile.las", "<html>not found</html>\n"),
            ("tile.tfw", "1\n0\n0\n-1\n500\n600\n"),
            ("tile.prj", "PROJCS[\"a\"]"),
        ] {
            fs::write(dir.path().join(name), text).unwrap();
        }
        fs::write(dir.path().join("cut.xyz"), [0; 20]).unwrap();
        let inputs = find(&[dir.path().to_path_buf()]).unwrap();
        assert_eq!(names(&inputs), ["broken.pts", "cut.xyz", "scan.csv", "scan.xyz", "tile.las"]);
        assert_eq!(inputs.other_files.len(), 7, "{:?}", inputs.other_files);
        let named = OpenOptions::default().columns(["t", "x", "y"]);
        assert!(names(&expand(&[dir.path().to_path_buf()], &named).unwrap()).contains(&"weather.csv"));
        let Err(Failure::Unsupported(line)) = find(&[dir.path().join("dem.asc")]) else { panic!("a raster") };
        assert!(line.contains("an Arc/Info ASCII grid, a raster, not a scan"), "{line}");
    }

    #[test]
    fn lines_of_numbers_count_in_a_folder_by_their_ending_and_elsewhere_by_content() {
        let dir = folder();
        for name in ["tile.xyz", "tile.CSV", "tile.asc", "tile.pts"] {
            fs::copy(dir.path().join("matrix.txt"), dir.path().join("süd").join(name)).unwrap();
        }
        fs::copy(dir.path().join("notes.txt"), dir.path().join("süd/notes.csv")).unwrap();
        let inputs = find(&[dir.path().join("süd")]).unwrap();
        assert_eq!(names(&inputs), ["a.LAZ", "tile.CSV", "tile.asc", "tile.pts", "tile.xyz"]);
        assert_eq!(names(&find(&[dir.path().join("matrix.txt")]).unwrap()), ["matrix.txt"]);
        assert_eq!(names(&find(&[dir.path().join("*.txt")]).unwrap()), ["matrix.txt"]);
        assert_eq!(names(&find(&[dir.path().join("*.log")]).unwrap()), ["counted.log"]);
    }

    #[test]
    fn a_file_whose_columns_are_named_is_taken_for_text() {
        let dir = folder();
        fs::write(dir.path().join("flat.dat"), "1 2\n3 4\n").unwrap();
        let named = OpenOptions::default().columns(["x", "y"]);
        let code = |name: &str| expand(&[dir.path().join(name)], &named).map_err(|e| e.code());
        assert_eq!(names(&code("flat.dat").unwrap()), ["flat.dat"]);
        assert_eq!(code("notes.txt").unwrap_err(), 3);
        assert_eq!(names(&expand(&[dir.path().join("*.dat")], &named).unwrap()), ["b.dat"], "a glob brings others");
        assert_eq!(find(&[dir.path().join("flat.dat")]).unwrap_err().code(), 3, "without columns");
    }

    #[test]
    fn globs_are_tried_only_where_no_such_path_exists() {
        let dir = folder();
        assert_eq!(names(&find(&[dir.path().join("**/*.LAZ")]).unwrap()), ["a.LAZ"]);
        fs::write(dir.path().join("x[1].las"), "LASF").unwrap();
        fs::write(dir.path().join("x1.las"), "LASF").unwrap();
        assert_eq!(names(&find(&[dir.path().join("x[1].las")]).unwrap()), ["x[1].las"]);
        assert_eq!(find(&[dir.path().join("*.nothing")]).unwrap_err().code(), 2);
    }

    #[test]
    fn a_file_counts_once_however_it_is_spelt() {
        let dir = folder();
        let again = dir.path().join("süd/../b.dat");
        let inputs = find(&[dir.path().join("b.dat"), again, dir.path().to_path_buf()]).unwrap();
        assert_eq!(names(&inputs), ["b.dat", "c.ply", "a.LAZ"]);
        assert!(inputs.notes.iter().any(|n| n.starts_with("2 inputs named more than once")), "{:?}", inputs.notes);
    }

    #[test]
    fn what_was_named_must_be_a_scan() {
        let dir = folder();
        let code = |name: &str| find(&[dir.path().join(name)]).unwrap_err().code();
        assert_eq!([code("notes.txt"), code("missing.las")], [4, 2]);
        let Failure::Unsupported(line) = find(&[dir.path().join("notes.txt")]).unwrap_err() else { panic!() };
        assert!(["notes.txt", "LAS, LAZ", "E57", "PLY", "PCD", "XYZ"].iter().all(|w| line.contains(w)), "{line}");
        fs::create_dir(dir.path().join("empty")).unwrap();
        assert_eq!(code("empty"), 3);
    }

    #[test]
    fn a_list_has_one_path_a_line() {
        let dir = folder();
        let list = dir.path().join("list");
        fs::write(&list, format!("\u{feff}# scans\r\n\n{}\r\n", dir.path().join("b.dat").display())).unwrap();
        let args = InputArgs { inputs: Vec::new(), files_from: Some(list), ..InputArgs::default() };
        assert_eq!(names(&args.expand().unwrap()), ["b.dat"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_broken_link_called_a_scan_is_not_lost() {
        let dir = folder();
        std::os::unix::fs::symlink("nowhere", dir.path().join("süd/z.las")).unwrap();
        std::os::unix::fs::symlink(".", dir.path().join("süd/loop")).unwrap();
        assert_eq!(names(&find(&[dir.path().join("süd")]).unwrap()), ["a.LAZ", "z.las"]);
    }
}
