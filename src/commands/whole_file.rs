//! Files that are complete or not there, and what they must not replace.

use std::fs;
use std::io;
use std::path::Path;

use pointmill_format::DatasetKind;

/// How the hidden folders are called in which outputs are made.
pub(super) const UNFINISHED: &str = ".unfinished-";

/// A file beside `path`, removed if it does not get its name. `prefix`: how its own name begins.
pub(super) fn beside(path: &Path, prefix: &str) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(prefix);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        builder.permissions(fs::Permissions::from_mode(0o666)); // less what the user's mask takes
    }
    builder.tempfile_in(path.parent().unwrap_or(path))
}

/// True for a file of any dataset that is there, or of one that is being made. `name`: in small letters, some file systems do
/// not tell them apart.
pub(super) fn is_of_dataset(path: &Path, name: &str) -> bool {
    let is_unfinished = |p: &Path| p.file_name().is_some_and(|n| n.to_string_lossy().contains(UNFINISHED));
    let kind = path.parent().and_then(DatasetKind::detect);
    kind.is_some_and(|kind| kind.owns(name)) || path.ancestors().skip(1).any(is_unfinished)
}

/// True if two paths lead to one file, by whatever name.
pub(super) fn is_same(a: &Path, b: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        let id = |path: &Path| fs::metadata(path).map(|m| (m.dev(), m.ino()));
        matches!((id(a), id(b)), (Ok(a), Ok(b)) if a == b)
    }
    #[cfg(not(unix))]
    {
        matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
    }
}
