//! Finds the scans: files, folders, globs and lists become one sorted list of files.
//!
//! The file type is detected from the content, or from the extension if the content is not recognised. A file that was
//! named must be a scan; other files in a folder or a glob are skipped and reported. A dataset is one input: a folder that is
//! one is not searched, and what a run makes is none of its inputs.

mod dataset;
mod found;
mod identity;
mod kind;
mod search;

#[cfg(unix)]
use std::ffi::OsStr;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};

use pointmill_format::OpenOptions;

use crate::args::InputArgs;
use crate::exit::Failure;
use crate::{depth_choice, scan_choice, text_choice};
use search::Search;

pub(crate) use found::Inputs;

/// A list of inputs is smaller: millions of paths.
const MAX_LIST_BYTES: u64 = 1 << 30;

impl InputArgs {
    /// Facts about scans that their files do not state.
    pub(crate) fn options(&self) -> Result<OpenOptions, Failure> {
        self.reading.options()
    }

    /// What was typed, and what is in the list.
    pub(crate) fn typed(&self) -> Result<Vec<PathBuf>, Failure> {
        let mut typed = self.inputs.clone();
        if let Some(list) = &self.files_from {
            typed.extend(read_list(list)?);
        }
        Ok(typed)
    }

    /// Finds the scans. `output`: where the run puts its datasets.
    pub(crate) fn expand(&self, output: &Path) -> Result<Inputs, Failure> {
        self.expand_these(&self.typed()?, output)
    }

    /// Finds the scans of some of the inputs.
    pub(crate) fn expand_these(&self, typed: &[PathBuf], output: &Path) -> Result<Inputs, Failure> {
        let options = self.options()?;
        let found = expand(typed, &options, Some(output))?;
        scan_choice::check(&found.files, &options)?;
        text_choice::check(&found.files, &options)?;
        depth_choice::check(&found.files, &options)?;
        Ok(found)
    }
}

/// Finds the scans that `typed` means: files, folders (recursive), globs where no such path exists. A file that is
/// named together with its columns is text, whatever it looks like. `output`: a dataset in it is no input, unless it is named.
pub(crate) fn expand(typed: &[PathBuf], options: &OpenOptions, output: Option<&Path>) -> Result<Inputs, Failure> {
    if typed.is_empty() {
        return Err(Failure::Usage("no input: pass scans, folders or globs, or --files-from LIST".to_owned()));
    }
    let mut search = Search::new(options, output);
    for path in typed {
        search.add_typed(path)?;
    }
    search.finish(typed)
}

/// The paths in `list`, one per line; `-` is standard input.
fn read_list(list: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut bytes = Vec::new();
    let read = if list.as_os_str() == "-" {
        io::stdin().lock().take(MAX_LIST_BYTES).read_to_end(&mut bytes)
    } else {
        File::open(list).and_then(|file| file.take(MAX_LIST_BYTES).read_to_end(&mut bytes))
    };
    let refuse = |what: &str| Err(Failure::Usage(format!("{}: {what}", list.display())));
    match read {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return refuse("no such list"),
        Err(e) => return Err(Failure::io(list, "reading the list of inputs", &e)),
        Ok(_) if bytes.len() as u64 == MAX_LIST_BYTES => return refuse("a list of inputs is not as long as that"),
        Ok(_) if bytes.contains(&0) => return refuse("no list of inputs: it holds NUL bytes; write one path per line"),
        Ok(_) => {}
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
    use std::fs;

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
        expand(typed, &OpenOptions::default(), None)
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
        assert!(names(&expand(&[dir.path().to_path_buf()], &named, None).unwrap()).contains(&"weather.csv"));
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
        let code = |name: &str| expand(&[dir.path().join(name)], &named, None).map_err(|e| e.code());
        assert_eq!(names(&code("flat.dat").unwrap()), ["flat.dat"]);
        assert_eq!(code("notes.txt").unwrap_err(), 3);
        assert_eq!(
            names(&expand(&[dir.path().join("*.dat")], &named, None).unwrap()),
            ["b.dat"],
            "a glob brings others"
        );
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
        assert_eq!(names(&args.expand(Path::new("out")).unwrap()), ["b.dat"]);
    }

    #[test]
    fn what_is_no_list_is_refused() {
        let dir = folder();
        fs::write(dir.path().join("list"), "b.dat\0c.ply\0").unwrap();
        let code = |name: &str| read_list(&dir.path().join(name)).unwrap_err().code();
        assert_eq!([code("list"), code("nowhere"), code("süd")], [2, 2, 5]);
    }
}
