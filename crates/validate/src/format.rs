//! Which format a dataset has.

use std::fmt;
use std::path::{Path, PathBuf};

use pointmill_format::ReadError;
use serde::{Serialize, Serializer};

use crate::check::Check;

/// A format of datasets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Format {
    /// Potree 2.0: a folder with `metadata.json`.
    Potree2,
    /// Mean-split binary tree: a folder with `index.json`.
    Bintree,
    /// Quantised batches: a file `*.qbatch`, or a folder with `points.qbatch`.
    Batches,
}

impl Format {
    /// Every format.
    pub const ALL: [Self; 3] = [Self::Potree2, Self::Bintree, Self::Batches];

    /// The word in reports and for `convert --to`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Potree2 => "potree2",
            Self::Bintree => "bintree",
            Self::Batches => "batches",
        }
    }

    /// The file that a folder of this format is known by.
    pub const fn key_file(self) -> &'static str {
        match self {
            Self::Potree2 => "metadata.json",
            Self::Bintree => "index.json",
            Self::Batches => "points.qbatch",
        }
    }

    /// What this format's datasets promise, in the order of reports.
    pub const fn checks(self) -> &'static [Check] {
        match self {
            Self::Potree2 => Check::POTREE2,
            Self::Bintree => Check::BINTREE,
            Self::Batches => Check::BATCHES,
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Format {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// A dataset that was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Located {
    /// By the files that are there.
    pub format: Format,
    /// Its folder; of quantised batches the file.
    pub path: PathBuf,
}

/// Finds the dataset at `path`: a folder, or the file that a folder is known by.
///
/// # Errors
/// `path` leads to nothing, or to nothing that can be validated.
pub fn locate(path: &Path) -> Result<Located, ReadError> {
    let about = std::fs::metadata(path).map_err(|e| ReadError::io(path, "opening", e))?;
    let found = if about.is_dir() {
        Format::ALL.into_iter().find(|f| path.join(f.key_file()).is_file()).map(|format| match format {
            Format::Batches => Located { format, path: path.join(format.key_file()) },
            _ => Located { format, path: path.to_path_buf() },
        })
    } else if path.extension().is_some_and(|e| e == "qbatch") {
        Some(Located { format: Format::Batches, path: path.to_path_buf() })
    } else {
        let named = Format::ALL.into_iter().find(|f| path.file_name().is_some_and(|name| name == f.key_file()));
        // "metadata.json" alone has the parent "", which is no path to open
        let parent = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        named.map(|format| Located { format, path: parent.to_path_buf() })
    };
    found.ok_or_else(|| {
        ReadError::unsupported(path, "this is no dataset that can be validated")
            .advise("give a folder with metadata.json (Potree 2.0) or index.json (binary tree), or a .qbatch file")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dataset_is_found_by_the_file_it_is_known_by_or_its_folder() {
        let temp = tempfile::tempdir().unwrap();
        for format in Format::ALL {
            let folder = temp.path().join(format.name());
            let file = folder.join(format.key_file());
            std::fs::create_dir(&folder).unwrap();
            assert!(locate(&folder).is_err());
            std::fs::write(&file, "").unwrap();
            let path = if format == Format::Batches { file.clone() } else { folder.clone() };
            let expected = Located { format, path };
            assert_eq!(locate(&folder).unwrap(), expected);
            assert_eq!(locate(&file).unwrap(), expected);
        }
    }

    #[test]
    fn what_is_not_a_dataset_is_refused_with_what_is_supported() {
        let temp = tempfile::tempdir().unwrap();
        let scan = temp.path().join("a.las");
        std::fs::write(&scan, "LASF").unwrap();
        for path in [temp.path(), &scan] {
            let line = locate(path).unwrap_err().to_string();
            assert!(line.contains("index.json") && line.contains(".qbatch"), "{line}");
        }
        assert!(locate(&temp.path().join("nothing")).is_err());
    }
}
