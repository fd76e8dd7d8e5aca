//! The hidden folder in which an output is made, and how a folder whose run is over is told from one whose run lives: by a
//! lock that ends with the process. The number of a process proves nothing, it is given again.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{self, Read as _, Write as _};
use std::path::{Path, PathBuf};

use super::place::parent_of;
use crate::runtime::disk::sync_folder;
use crate::runtime::os_files::{FileLock, Locked, is_same_file};
use crate::runtime::{Disk, DiskOperation, SystemDisk};

/// Locked as long as the run lives; says for which output the folder was made.
const LOCK: &str = "lock";

/// How the file begins, before the name of the output.
const MAGIC: &[u8] = b"made by pointmill, and locked while the run lives, for the output\n";

/// Longest name of a file that file systems allow, bytes.
const NAME_BYTES: usize = 255;

/// There while `new` or `old` may hold what stood at the place of the output, which is judged by its content: without it
/// they hold the beginning of an output, or what was judged to be ours, and that goes whatever it looks like.
const HOLDS_OLD: &str = "holds-old";

/// How hidden folders inside of an output are called.
const INSIDE: &str = ".unfinished-";

/// What `tempfile` adds to a name.
const RANDOM_BYTES: usize = 6;

/// Another run may take a folder for one of a dead run before its lock is there; it is made anew then.
const TRIES: usize = 16;

/// A hidden folder, removed with all that is in it when it is dropped, unless it may hold what stood at the place of the output.
///
/// `new` in it is to become the output. `old` holds what stood there while that is being moved.
#[derive(Debug)]
pub(super) struct HiddenFolder {
    path: PathBuf,
    lock: Option<FileLock>,
    /// Folders above the output that were made for it, the lowest first.
    parents: Vec<PathBuf>,
    is_kept: bool,
}

/// A folder that was found.
#[derive(Debug)]
pub(super) enum Found {
    /// Its run is over.
    Dead(HiddenFolder),
    /// Its run lives.
    Living,
    /// It is called like one, and nothing says whether its run lives.
    Unknown(PathBuf),
}

/// The places of hidden folders of an output.
#[derive(Debug, Clone, Copy)]
pub(super) enum Side {
    Beside,
    Inside,
    /// Inside, for files that become no output: how its name begins.
    Work(&'static str),
}

impl HiddenFolder {
    /// Makes one beside `output` (resolved), and the folders above it.
    ///
    /// # Errors
    /// The file system refuses.
    pub(super) fn beside(output: &Path) -> io::Result<Self> {
        let parent = parent_of(output);
        let missing: Vec<PathBuf> = parent.ancestors().take_while(|p| !p.exists()).map(Path::to_path_buf).collect();
        let made = fs::create_dir_all(parent).and_then(|()| Self::make(output, Side::Beside));
        match made {
            Ok(mut folder) => {
                folder.parents = missing;
                Ok(folder)
            }
            Err(e) => {
                remove_empty(&missing);
                Err(e)
            }
        }
    }

    /// Makes one in `output`, which is there.
    pub(super) fn inside(output: &Path) -> io::Result<Self> {
        Self::make(output, Side::Inside)
    }

    /// Makes one on that side of `output`; the folder that is to hold it is there.
    pub(super) fn in_place(output: &Path, side: Side) -> io::Result<Self> {
        Self::make(output, side)
    }

    fn make(output: &Path, side: Side) -> io::Result<Self> {
        let (folder, prefix) = side.of(output);
        for _ in 0..TRIES {
            let path = tempfile::Builder::new().prefix(&prefix).tempdir_in(folder)?.keep();
            let mut made = Self { path, lock: None, parents: Vec::new(), is_kept: false };
            let lock_path = made.path.join(LOCK);
            let lock = match FileLock::create(&lock_path) {
                Ok(Locked::Ours(lock)) if is_same_file(lock.file(), &lock_path) => Some(lock),
                Ok(Locked::Unknown) => None,
                Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(e),
                _ => continue, // another run has taken it for a dead one
            };
            let text = [MAGIC, side.key(output)].concat();
            match &lock {
                // safe before anything that it must be told apart by
                Some(lock) => lock.file().write_all(&text).and_then(|()| lock.file().sync_data())?,
                None => fs::write(&lock_path, text)?,
            }
            fs::create_dir(made.path_of_new())?;
            made.lock = lock;
            return Ok(made);
        }
        Err(io::Error::other("other runs remove the folder as it is made"))
    }

    /// All folders of that kind which were made for `output`.
    pub(super) fn find(output: &Path, side: Side) -> Vec<Found> {
        let (folder, prefix) = side.of(output);
        let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
        let is_named = |name: &OsStr| name.as_encoded_bytes().starts_with(prefix.as_bytes());
        let named = entries.flatten().filter(|e| is_named(&e.file_name()) && e.file_type().is_ok_and(|t| t.is_dir()));
        named.filter_map(|e| Self::examine(e.path(), side.key(output))).collect()
    }

    /// `None`: nothing to do with this output, or gone.
    fn examine(path: PathBuf, key: &[u8]) -> Option<Found> {
        let lock_path = path.join(LOCK);
        let is_file = fs::symlink_metadata(&lock_path).is_ok_and(|m| m.is_file());
        if !is_file {
            // one that is being made is empty, and is made again if it is gone
            return fs::remove_dir(&path)
                .err()
                .filter(|e| e.kind() != io::ErrorKind::NotFound)
                .map(|_| Found::Unknown(path));
        }
        let lock = match FileLock::open(&lock_path) {
            Ok(Locked::Ours(lock)) => lock,
            Ok(Locked::Taken) => return (Text::of(File::open(&lock_path).ok()?)?.is_for(key)).then_some(Found::Living),
            Ok(Locked::Unknown) => return Some(Found::Unknown(path)),
            Err(e) => return (e.kind() != io::ErrorKind::NotFound).then_some(Found::Unknown(path)),
        };
        if !is_same_file(lock.file(), &lock_path) {
            return None;
        }
        let text = Text::of(lock.file())?;
        let is_just_made = text.0.is_empty() && fs::read_dir(&path).is_ok_and(|entries| entries.count() == 1);
        if text.0.is_empty() && !is_just_made {
            return Some(Found::Unknown(path));
        }
        let folder = Self { path, lock: Some(lock), parents: Vec::new(), is_kept: !(is_just_made || text.is_for(key)) };
        (!folder.is_kept).then_some(Found::Dead(folder))
    }

    /// The folder itself.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// True if it is in `output`, not beside it.
    pub(super) fn is_inside(&self, output: &Path) -> bool {
        self.path.parent() == Some(output)
    }

    /// The folder in it that is to become the output.
    pub(super) fn path_of_new(&self) -> PathBuf {
        self.path.join("new")
    }

    /// The folder in it for what stood at the place of the output.
    pub(super) fn path_of_old(&self) -> PathBuf {
        self.path.join("old")
    }

    /// Called before what stands at the place of the output comes into this folder. From now on it stays when this is dropped,
    /// until [`Self::holds_ours_alone`].
    pub(super) fn will_hold_old(&self, disk: &dyn Disk) -> io::Result<()> {
        disk.permit(DiskOperation::Create)?;
        File::create(self.path.join(HOLDS_OLD))?;
        sync_folder(disk, &self.path).inspect_err(|_| {
            let _ = self.holds_ours_alone(); // nothing has come
        })
    }

    /// True if what stood at the place of the output may be in it.
    pub(super) fn may_hold_old(&self) -> bool {
        fs::symlink_metadata(self.path.join(HOLDS_OLD)).is_ok()
    }

    /// All that is in it may go, whoever finds it.
    pub(super) fn holds_ours_alone(&self) -> io::Result<()> {
        match fs::remove_file(self.path.join(HOLDS_OLD)) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e),
            _ => {
                // before what it stands for goes; where that is not kept, the next run judges once more
                let _ = sync_folder(&SystemDisk, &self.path);
                Ok(())
            }
        }
    }

    /// It stays when this is dropped.
    pub(super) fn keep(&mut self) {
        self.is_kept = true;
    }

    /// The output is in place: the folders above it stay.
    pub(super) fn keep_parents(&mut self) {
        self.parents.clear();
    }
}

impl Drop for HiddenFolder {
    fn drop(&mut self) {
        if self.is_kept || self.may_hold_old() {
            return;
        }
        for entry in fs::read_dir(&self.path).into_iter().flatten().flatten().filter(|e| e.file_name() != LOCK) {
            let is_folder = entry.file_type().is_ok_and(|t| t.is_dir());
            // What cannot be removed is tried again by the next run.
            let _ = if is_folder { fs::remove_dir_all(entry.path()) } else { fs::remove_file(entry.path()) };
        }
        if cfg!(not(unix)) {
            self.lock = None; // an open file cannot be removed
        }
        let is_empty = fs::read_dir(&self.path).is_ok_and(|entries| entries.count() <= 1);
        if is_empty {
            let _ = fs::remove_file(self.path.join(LOCK)); // not there where the disk had no room for it
            let _ = fs::remove_dir(&self.path);
        }
        remove_empty(&self.parents);
    }
}

impl Side {
    /// The folder that holds them, and how their names begin.
    fn of(self, output: &Path) -> (&Path, String) {
        match self {
            Self::Inside => (output, INSIDE.to_owned()),
            Self::Work(prefix) => (output, prefix.to_owned()),
            Self::Beside => {
                let name = output.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
                let room = NAME_BYTES - (".".len() + INSIDE.len() + RANDOM_BYTES);
                let end = (0..=name.len().min(room)).rev().find(|i| name.is_char_boundary(*i)).unwrap_or(0);
                (parent_of(output), format!(".{}{INSIDE}", &name[..end]))
            }
        }
    }

    /// What the lock file says of the output, whose name may be cut in that of the folder. A folder may be mounted
    /// elsewhere the next time.
    fn key(self, output: &Path) -> &[u8] {
        match self {
            Self::Inside => b".",
            Self::Work(prefix) => prefix.as_bytes(),
            Self::Beside => output.file_name().unwrap_or_default().as_encoded_bytes(),
        }
    }
}

/// The contents of a lock file.
struct Text(Vec<u8>);

impl Text {
    fn of(file: impl io::Read) -> Option<Self> {
        let mut text = Vec::new();
        file.take(64 << 10).read_to_end(&mut text).ok()?;
        Some(Self(text))
    }

    fn is_for(&self, key: &[u8]) -> bool {
        self.0.strip_prefix(MAGIC) == Some(key)
    }
}

fn remove_empty(folders: &[PathBuf]) {
    for folder in folders {
        let _ = fs::remove_dir(folder); // what others have put there meanwhile keeps it
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> usize {
        fs::read_dir(folder).unwrap().count()
    }

    #[test]
    fn a_folder_lives_as_long_as_its_run_and_belongs_to_one_output() {
        let dir = tempfile::tempdir().unwrap();
        let (out, other) = (dir.path().join("deep/out"), dir.path().join("deep/other"));
        let folder = HiddenFolder::beside(&out).unwrap();
        assert!(matches!(HiddenFolder::find(&out, Side::Beside)[..], [Found::Living]));
        let path = folder.path().to_path_buf();
        fs::write(folder.path_of_new().join("x"), "").unwrap();
        let mut folder = folder;
        folder.keep();
        drop(folder); // as a run that is killed leaves it
        assert!(HiddenFolder::find(&other, Side::Beside).is_empty());
        assert!(path.exists());
        let found = HiddenFolder::find(&out, Side::Beside);
        assert!(matches!(&found[..], [Found::Dead(found)] if found.path() == path), "{found:?}");
        drop(found);
        assert_eq!(names(&dir.path().join("deep")), 0);
    }

    #[test]
    fn folders_above_the_output_go_with_it() {
        let dir = tempfile::tempdir().unwrap();
        drop(HiddenFolder::beside(&dir.path().join("a/b/out")).unwrap());
        assert_eq!(names(dir.path()), 0);
    }

    #[test]
    fn long_names_are_cut_and_not_mixed_up() {
        let dir = tempfile::tempdir().unwrap();
        let [a, b] = ["ä", "ö"].map(|end| dir.path().join("é".repeat(126) + end));
        let folder = HiddenFolder::beside(&a).unwrap();
        assert!(folder.path().file_name().unwrap().len() <= NAME_BYTES);
        assert!(matches!(HiddenFolder::find(&a, Side::Beside)[..], [Found::Living]));
        assert!(HiddenFolder::find(&b, Side::Beside).is_empty());
    }

    #[test]
    fn what_is_only_called_like_one_is_left_alone() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path().join("out");
        fs::create_dir(dir.path().join(".out.unfinished-abcdef")).unwrap();
        fs::write(dir.path().join(".out.unfinished-abcdef/x"), "").unwrap();
        fs::create_dir(dir.path().join(".out.unfinished-ghijkl")).unwrap();
        fs::write(dir.path().join(".out.unfinished-ghijkl/lock"), "of something else").unwrap();
        assert!(matches!(HiddenFolder::find(&out, Side::Beside)[..], [Found::Unknown(_)]));
        assert_eq!(names(dir.path()), 2);
    }
}
