//! The search for scans: what was typed, and what folders and globs bring along. Each file is looked at once and closed
//! again; nothing here grows faster than their number.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::io;
use std::path::{Path, PathBuf};
use std::{fmt, fs};

use pointmill_format::{OpenOptions, supported_scans, system_reason};

use super::dataset::{self, Met};
use super::found::{Inputs, Unread, other_files};
use super::identity::Identity;
use super::kind::{Kind, is_other, kind, kind_by_ending, kind_in_folder};
use crate::exit::Failure;
use crate::human::quantities::plural;

/// Paths that a note names.
const MAX_NAMED: usize = 3;

#[derive(Default)]
pub(super) struct Search {
    /// A file counts once however it is spelt.
    found: BTreeMap<Identity, PathBuf>,
    repeated: Vec<PathBuf>,
    no_scans: Vec<PathBuf>,
    unread: Vec<Unread>,
    /// Links that lead back to a folder above them: what is there is found anyway.
    loops: Vec<PathBuf>,
    /// Scans in the folders of datasets, beside their files.
    beside: Vec<PathBuf>,
    /// A dataset there is none of the inputs, unless it is named.
    output: Option<PathBuf>,
    options: OpenOptions,
}

impl Search {
    /// `output`: what is in it, and is no scan that was named, is not taken.
    pub(super) fn new(options: &OpenOptions, output: Option<&Path>) -> Self {
        let output = output.and_then(|output| fs::canonicalize(output).ok());
        Self { options: options.clone(), output, ..Self::default() }
    }

    /// Adds a file, a folder, or what a glob finds.
    pub(super) fn add_typed(&mut self, path: &Path) -> Result<(), Failure> {
        if let Some(found) = dataset::named(path) {
            self.add_dataset(&found);
            return Ok(());
        }
        match fs::metadata(path) {
            Ok(meta) if meta.is_dir() => return self.add_folder(path),
            Ok(_) => return self.add_named_file(path),
            Err(e) if e.kind() == io::ErrorKind::NotFound => return self.add_glob(path),
            // its reader reports why, and --unreadable decides
            Err(_) => self.add_scan(path),
        }
        Ok(())
    }

    /// A file that was named must be a scan.
    fn add_named_file(&mut self, path: &Path) -> Result<(), Failure> {
        let is_scan = kind(path).map_or(true, |kind| kind == Kind::Scan);
        if !is_scan || is_other(path, self.options.columns.is_some()).unwrap_or(false) {
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
            _ if dataset::is_file(path) => {
                if !dataset::is_in(path, self.output.as_deref()) {
                    self.add_scan(path);
                }
            }
            _ if dataset::is_report(path) => {}
            _ => self.no_scans.push(path.to_path_buf()),
        }
    }

    fn add_folder(&mut self, folder: &Path) -> Result<(), Failure> {
        let mut entries = walkdir::WalkDir::new(folder).follow_links(true).sort_by_file_name().into_iter();
        while let Some(entry) = entries.next() {
            match entry {
                Ok(entry) if entry.file_type().is_dir() => match dataset::met(entry.path(), self.output.as_deref()) {
                    Met::Folder => {}
                    Met::Dataset(path) => {
                        self.add_dataset(&path);
                        entries.skip_current_dir();
                    }
                    Met::NoInput => entries.skip_current_dir(),
                    Met::Several(kinds) => return Err(several(entry.path(), &kinds)),
                },
                Ok(entry) => self.add_met_file(entry.path(), kind_in_folder),
                Err(e) => match (e.path(), e.io_error()) {
                    (Some(path), Some(error)) => self.add_closed(path, error),
                    (Some(path), None) => self.loops.push(path.to_path_buf()),
                    (None, _) => {} // every entry has a path
                },
            }
        }
        Ok(())
    }

    /// A dataset is one input, whatever files it has.
    fn add_dataset(&mut self, path: &Path) {
        self.beside.extend(dataset::scans_beside(path));
        self.add_scan(path);
    }

    /// A place that the operating system does not let us see.
    fn add_closed(&mut self, path: &Path, error: &io::Error) {
        if error.kind() == io::ErrorKind::NotFound {
            self.add_met_file(path, kind_in_folder); // a link to nothing
        } else if is_of_the_system(path, error) {
            self.no_scans.push(path.to_path_buf());
        } else if kind_by_ending(path) == Kind::Scan {
            self.add_scan(path); // its reader reports why
        } else {
            self.unread.push(Unread { path: path.to_path_buf(), why: system_reason(error) });
        }
    }

    fn add_glob(&mut self, path: &Path) -> Result<(), Failure> {
        let pattern = path.to_str().filter(|p| p.contains(['*', '?', '[']));
        let Some(pattern) = pattern else {
            return Err(Failure::Usage(format!("{}: no such file or folder", path.display())));
        };
        let matches = glob::glob(pattern)
            .map_err(|e| Failure::Usage(format!("{pattern}: no such file, and no pattern either: {}", e.msg)))?;
        let mut any = false;
        for found in matches {
            any = true;
            match found {
                Ok(found) if found.is_dir() => self.add_folder(&found)?,
                Ok(found) => self.add_met_file(&found, kind),
                Err(e) => self.add_closed(e.path(), e.error()),
            }
        }
        if any { Ok(()) } else { Err(Failure::Usage(format!("{pattern}: no file matches"))) }
    }

    fn add_scan(&mut self, path: &Path) {
        match self.found.entry(Identity::of(path)) {
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

    /// What was found; a failure if that is nothing.
    pub(super) fn finish(self, typed: &[PathBuf]) -> Result<Inputs, Failure> {
        let note = |paths: &[PathBuf], noun: &str, what: &str| {
            (!paths.is_empty()).then(|| format!("{} {what} ({})", plural(paths.len() as u64, noun), FirstFew(paths)))
        };
        let notes = [
            note(&self.repeated, "input", "named more than once, read once"),
            note(&self.loops, "link", "back to a folder above, not followed again"),
            note(&self.beside, "scan", "in the folder of a dataset, not read"),
        ];
        let mut files: Vec<PathBuf> = self.found.into_values().collect();
        files.sort();
        let (mut other_files, mut unread) = (self.no_scans, self.unread);
        other_files.sort();
        other_files.dedup();
        unread.sort();
        unread.dedup();
        let inputs = Inputs { files, other_files, unread, notes: notes.into_iter().flatten().collect() };
        if inputs.files.is_empty() { Err(nothing(typed, &inputs)) } else { Ok(inputs) }
    }
}

/// Why there is nothing to read.
fn nothing(typed: &[PathBuf], inputs: &Inputs) -> Failure {
    if let Some(failure) = inputs.unread_failure("; no other scan was found") {
        return failure;
    }
    let others = inputs.other_files.first().map(|_| format!("; {}", other_files(&inputs.other_files)));
    Failure::Input(format!(
        "{}: no scan found (supported: {}, datasets){}",
        FirstFew(typed),
        supported_scans(),
        others.unwrap_or_default()
    ))
}

/// The same points twice or more.
fn several(folder: &Path, kinds: &[&str]) -> Failure {
    let (folder, kinds) = (folder.display(), kinds.join(", "));
    Failure::Usage(format!("{folder}: one conversion made {kinds} in it, of the same points; name one of them"))
}

/// The first paths, and whether there are more.
struct FirstFew<'a>(&'a [PathBuf]);

impl fmt::Display for FirstFew<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, path) in self.0.iter().take(MAX_NAMED).enumerate() {
            write!(f, "{}{}", if i > 0 { ", " } else { "" }, path.display())?;
        }
        if self.0.len() > MAX_NAMED { f.write_str(", …") } else { Ok(()) }
    }
}

/// True for a folder that the operating system keeps on a disk and does not open.
fn is_of_the_system(path: &Path, error: &io::Error) -> bool {
    let names = ["lost+found", "System Volume Information", "$RECYCLE.BIN"];
    error.kind() == io::ErrorKind::PermissionDenied
        && path.file_name().is_some_and(|name| names.iter().any(|system| name == *system))
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::symlink;

    use super::*;

    fn expand(typed: &[PathBuf]) -> Result<Inputs, Failure> {
        let mut search = Search::new(&OpenOptions::default(), None);
        typed.iter().try_for_each(|path| search.add_typed(path))?;
        search.finish(typed)
    }

    fn search(folder: &Path) -> Inputs {
        expand(&[folder.to_path_buf()]).unwrap()
    }

    fn folder() -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        fs::write(dir.path().join("a.las"), "LASF").unwrap();
        dir
    }

    #[test]
    fn links_that_end_nowhere_are_kept_if_they_are_called_scans_and_listed_if_scans_may_be_behind_them() {
        let dir = folder();
        let at = |name: &str| dir.path().join(name);
        symlink("nowhere", at("b.las")).unwrap();
        symlink("nowhere", at("notes")).unwrap();
        symlink("c.las", at("c.las")).unwrap();
        symlink("tiles", at("tiles")).unwrap();
        let inputs = search(dir.path());
        assert_eq!(inputs.files, [at("a.las"), at("b.las"), at("c.las")]);
        assert_eq!(inputs.other_files, [at("notes")]);
        let [unread] = &inputs.unread[..] else { panic!("{:?}", inputs.unread) };
        assert!(unread.path == at("tiles") && !unread.why.contains("os error"), "{unread:?}");
    }

    #[test]
    fn links_back_to_a_folder_above_lose_nothing_and_are_noted() {
        let dir = folder();
        fs::create_dir(dir.path().join("sub")).unwrap();
        fs::write(dir.path().join("sub/b.las"), "LASF").unwrap();
        symlink("..", dir.path().join("sub/up")).unwrap();
        let inputs = search(dir.path());
        assert_eq!((inputs.files.len(), inputs.unread.len()), (2, 0));
        assert!(inputs.notes[0].starts_with("1 link back to a folder above") && inputs.notes[0].contains("sub/up"));
    }

    #[test]
    fn a_file_with_several_names_counts_once_and_its_copy_twice() {
        let dir = folder();
        let at = |name: &str| dir.path().join(name);
        fs::hard_link(at("a.las"), at("b.las")).unwrap();
        symlink("a.las", at("c.las")).unwrap();
        fs::copy(at("a.las"), at("d.las")).unwrap();
        let inputs = search(dir.path());
        assert_eq!(inputs.files, [at("a.las"), at("d.las")]);
        assert!(inputs.notes[0].starts_with("2 inputs named more than once"), "{:?}", inputs.notes);
    }

    #[test]
    fn many_files_named_many_times_are_listed_once() {
        let dir = folder();
        for i in 0..1000 {
            fs::hard_link(dir.path().join("a.las"), dir.path().join(format!("h{i}.las"))).unwrap();
            fs::write(dir.path().join(format!("{i}.las")), "LASF").unwrap();
        }
        let typed: Vec<PathBuf> = ["", "*.las", "*.la*"].iter().map(|name| dir.path().join(name)).collect();
        let open = || fs::read_dir("/proc/self/fd").map_or(0, Iterator::count);
        let before = open();
        let inputs = expand(&typed).unwrap();
        assert_eq!(inputs.files.len(), 1001);
        assert!(inputs.notes[0].starts_with("5,002 inputs named more than once"), "{:?}", inputs.notes);
        assert!(open() < before + 100, "other tests open files, too, but not a thousand");
    }

    #[test]
    fn what_cannot_be_looked_into_is_the_failure_where_nothing_else_is_there() {
        let dir = tempfile::tempdir().unwrap();
        symlink("tiles", dir.path().join("tiles")).unwrap();
        let failure = expand(&[dir.path().to_path_buf()]).unwrap_err();
        assert_eq!(failure.code(), 5);
    }
}
