//! Where pictures go: each is complete or not there, and replaces nothing but a picture.

use std::fs::{self, File};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use crate::commands::whole_file::{beside, is_of_dataset, is_same};
use crate::exit::Failure;

/// The first bytes of a PNG file.
const SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";

/// Digits of the numbers of frames, at least.
const DIGITS: usize = 4;

/// The files of a run.
pub(super) struct Output {
    given: PathBuf,
    /// Of a flight.
    frames: Option<u32>,
    overwrite: bool,
}

impl Output {
    /// Checks, before anything is read, that the pictures can be written.
    pub(super) fn new(given: &Path, frames: Option<u32>, overwrite: bool) -> Result<Self, Failure> {
        let output = Self { given: given.to_path_buf(), frames, overwrite };
        let shown = given.display();
        if !given.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("png")) {
            return Err(Failure::Usage(format!("{shown}: pictures are PNG files; choose a name that ends in .png")));
        }
        if !output.folder().is_dir() {
            return Err(Failure::Usage(format!("{shown}: there is no folder {}; make it", output.folder().display())));
        }
        for file in output.files() {
            output.check(&file)?;
        }
        beside(&output.folder().join("x"), ".preview-").map_err(|e| output.unwritten(given, &e))?;
        Ok(output)
    }

    /// The files, in the order of frames.
    pub(super) fn files(&self) -> impl Iterator<Item = PathBuf> + '_ {
        (1..=self.frames.unwrap_or(1)).map(|number| match self.frames {
            None => self.given.clone(),
            Some(frames) => {
                let digits = frames.to_string().len().max(DIGITS);
                let stem = self.given.file_stem().unwrap_or_default().to_string_lossy();
                self.given.with_file_name(format!("{stem}{number:0digits$}.png"))
            }
        })
    }

    /// Refuses to put a picture in the place of something that is read.
    pub(super) fn protect(&self, inputs: &[PathBuf]) -> Result<(), Failure> {
        let taken = |file: &PathBuf| file.exists() && inputs.iter().any(|input| is_same(input, file));
        match self.files().find(taken) {
            Some(file) => Err(refuse(&file, "the picture would replace this input")),
            None => Ok(()),
        }
    }

    /// Writes a picture.
    pub(super) fn write(&self, file: &Path, bytes: &[u8]) -> Result<(), Failure> {
        let write = || {
            let mut new = beside(file, ".preview-")?;
            new.write_all(bytes)?;
            new.as_file().sync_all()?;
            let placed = if self.overwrite { new.persist(file) } else { new.persist_noclobber(file) };
            placed.map(drop).map_err(|e| e.error)
        };
        write().map_err(|e| match e.kind() {
            io::ErrorKind::AlreadyExists => exists(file),
            _ => self.unwritten(file, &e),
        })
    }

    fn folder(&self) -> &Path {
        self.given.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
    }

    fn unwritten(&self, file: &Path, error: &io::Error) -> Failure {
        Failure::io(file, "writing the picture", error)
    }

    /// What stands in the place of a picture must be one.
    fn check(&self, file: &Path) -> Result<(), Failure> {
        let name = file.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        if is_of_dataset(file, &name) {
            return Err(refuse(file, "the picture would replace a file of a dataset"));
        }
        let Ok(meta) = fs::symlink_metadata(file) else { return Ok(()) };
        if !self.overwrite {
            return Err(exists(file));
        }
        let mut first = Vec::new();
        let read = File::open(file).and_then(|f| f.take(SIGNATURE.len() as u64).read_to_end(&mut first));
        let is_picture = meta.is_file() && read.is_ok() && (first.is_empty() || first == SIGNATURE);
        if is_picture { Ok(()) } else { Err(refuse(file, "what is there is no picture and is not replaced")) }
    }
}

fn exists(file: &Path) -> Failure {
    let shown = file.display();
    Failure::Usage(format!("{shown}: the output exists already; pass --overwrite to replace it"))
}

fn refuse(file: &Path, what: &str) -> Failure {
    Failure::Usage(format!("{}: {what}; choose another file", file.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(output: &Output) -> Vec<String> {
        output.files().map(|file| file.file_name().unwrap().to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn frames_are_numbered_so_that_names_sort() {
        let dir = tempfile::tempdir().unwrap();
        let output = |frames| Output::new(&dir.path().join("fly.png"), frames, false).unwrap();
        assert_eq!(names(&output(None)), ["fly.png"]);
        assert_eq!(names(&output(Some(2))), ["fly0001.png", "fly0002.png"]);
        assert_eq!(names(&output(Some(12_345)))[12_344], "fly12345.png");
        assert_eq!(names(&output(Some(12_345)))[0], "fly00001.png");
    }

    #[test]
    fn a_picture_replaces_only_a_picture() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("x.png");
        let line = |overwrite| match Output::new(&file, None, overwrite) {
            Err(Failure::Usage(line)) => line,
            Err(other) => panic!("{other:?}"),
            Ok(_) => String::new(),
        };
        fs::write(&file, "a diary").unwrap();
        assert!(line(true).contains("is no picture"), "{}", line(true));
        fs::write(&file, SIGNATURE).unwrap();
        assert!(line(false).contains("exists already"));
        Output::new(&file, None, true).unwrap().write(&file, b"new").unwrap();
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_file_that_appears_meanwhile_is_not_replaced() {
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("x.png");
        let output = Output::new(&file, None, false).unwrap();
        fs::write(&file, "other").unwrap();
        assert!(matches!(output.write(&file, b"new"), Err(Failure::Usage(_))));
        assert_eq!(fs::read(&file).unwrap(), b"other");
    }
}
