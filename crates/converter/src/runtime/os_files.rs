//! What the standard library cannot ask of a file system: that two names change places at once, and a lock that ends with
//! the process.

use std::fs::{self, File};
use std::io;
use std::path::Path;

/// What two paths lead to changes places, at once: there is no moment without either name. False: the system or the
/// file system cannot do that, and nothing has changed.
pub(crate) fn exchange(a: &Path, b: &Path) -> io::Result<bool> {
    match exchange_names(a, b) {
        Ok(()) => Ok(true),
        Err(e) if is_unable(&e) => Ok(false),
        Err(e) => Err(e),
    }
}

#[cfg(any(target_os = "linux", target_os = "macos"))]
fn exchange_names(a: &Path, b: &Path) -> io::Result<()> {
    use std::ffi::CString;
    use std::os::unix::ffi::OsStrExt as _;
    let [a, b] = [a, b].map(|path| CString::new(path.as_os_str().as_bytes()));
    let (a, b) = (a?, b?);
    #[cfg(target_os = "linux")]
    // SAFETY: both paths are strings that end with a zero and live until the call is over; it reads no other memory.
    // Called by number, because older C libraries lack the function.
    let result = unsafe {
        let (cwd, flags) = (libc::AT_FDCWD as libc::c_long, libc::RENAME_EXCHANGE as libc::c_long);
        libc::syscall(libc::SYS_renameat2, cwd, a.as_ptr(), cwd, b.as_ptr(), flags)
    };
    #[cfg(target_os = "macos")]
    // SAFETY: both paths are strings that end with a zero and live until the call is over; it reads no other memory.
    let result = unsafe { libc::renamex_np(a.as_ptr(), b.as_ptr(), libc::RENAME_SWAP) };
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}

#[cfg(not(any(target_os = "linux", target_os = "macos")))]
fn exchange_names(_: &Path, _: &Path) -> io::Result<()> {
    Err(io::ErrorKind::Unsupported.into())
}

#[cfg(unix)]
fn is_unable(error: &io::Error) -> bool {
    let unable = [libc::ENOSYS, libc::EINVAL, libc::ENOTSUP, libc::EOPNOTSUPP];
    error.raw_os_error().is_some_and(|code| unable.contains(&code))
}

#[cfg(not(unix))]
fn is_unable(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::Unsupported
}

/// True if it is a file of this name and no other, of the same owner as `ours`; false where the system does not tell.
pub(crate) fn is_only_name(path: &Path, ours: &fs::Metadata) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        let is_ours = |meta: fs::Metadata| meta.is_file() && meta.nlink() == 1 && meta.uid() == ours.uid();
        fs::symlink_metadata(path).is_ok_and(is_ours)
    }
    #[cfg(not(unix))]
    {
        let _ = (path, ours);
        false
    }
}

/// A lock on a file, held until it is dropped or the process ends, however it ends.
#[derive(Debug)]
pub(crate) struct FileLock {
    file: File,
}

/// What came of an attempt to lock a file.
#[derive(Debug)]
pub(crate) enum Locked {
    /// It is ours.
    Ours(FileLock),
    /// Another process, or another lock of this one, has it.
    Taken,
    /// The file system has no locks.
    Unknown,
}

impl FileLock {
    /// Makes the file, which must not be there, and locks it.
    pub(crate) fn create(path: &Path) -> io::Result<Locked> {
        Self::lock(path, options().create_new(true))
    }

    /// Locks a file that is there.
    pub(crate) fn open(path: &Path) -> io::Result<Locked> {
        Self::lock(path, &options())
    }

    /// The file.
    pub(crate) fn file(&self) -> &File {
        &self.file
    }

    #[cfg(unix)]
    fn lock(path: &Path, options: &fs::OpenOptions) -> io::Result<Locked> {
        use std::os::fd::AsRawFd as _;
        let file = options.open(path)?;
        // SAFETY: the descriptor is open while `file` lives; the call touches no memory of ours. The lock belongs to the
        // open file and ends when the last descriptor of it is closed, by us or by the end of the process.
        let result = unsafe { libc::flock(file.as_raw_fd(), libc::LOCK_EX | libc::LOCK_NB) };
        let error = io::Error::last_os_error();
        match result {
            0 => Ok(Locked::Ours(Self { file })),
            _ if error.kind() == io::ErrorKind::WouldBlock => Ok(Locked::Taken),
            _ => Ok(Locked::Unknown),
        }
    }

    /// A file that is open cannot be opened by others.
    #[cfg(windows)]
    fn lock(path: &Path, options: &fs::OpenOptions) -> io::Result<Locked> {
        use std::os::windows::fs::OpenOptionsExt as _;
        const SHARING_VIOLATION: i32 = 32;
        match options.clone().share_mode(0).open(path) {
            Ok(file) => Ok(Locked::Ours(Self { file })),
            Err(e) if e.raw_os_error() == Some(SHARING_VIOLATION) => Ok(Locked::Taken),
            Err(e) => Err(e),
        }
    }

    #[cfg(not(any(unix, windows)))]
    fn lock(path: &Path, options: &fs::OpenOptions) -> io::Result<Locked> {
        options.open(path).map(|_| Locked::Unknown)
    }
}

fn options() -> fs::OpenOptions {
    let mut options = File::options();
    options.read(true).write(true);
    options
}

/// True if a path still leads to this open file.
pub(crate) fn is_same_file(file: &File, path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        match (file.metadata(), fs::symlink_metadata(path)) {
            (Ok(a), Ok(b)) => (a.dev(), a.ino()) == (b.dev(), b.ino()),
            _ => false,
        }
    }
    #[cfg(not(unix))]
    {
        let _ = file;
        path.exists()
    }
}

/// True if the folder at `path` is the one that `meta` was read of; where the system does not tell, if there is one.
pub(crate) fn is_same_folder(path: &Path, meta: &fs::Metadata) -> bool {
    let Ok(found) = fs::symlink_metadata(path) else { return false };
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        found.is_dir() && (found.dev(), found.ino()) == (meta.dev(), meta.ino())
    }
    #[cfg(not(unix))]
    {
        let _ = meta;
        found.is_dir()
    }
}

/// Gives a folder the owner and group of another; false if that is not permitted.
pub(crate) fn adopt_owner(folder: &Path, of: &fs::Metadata) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::{MetadataExt as _, chown};
        let Ok(own) = fs::metadata(folder) else { return false };
        (own.uid(), own.gid()) == (of.uid(), of.gid()) || chown(folder, Some(of.uid()), Some(of.gid())).is_ok()
    }
    #[cfg(not(unix))]
    {
        let _ = (folder, of);
        true
    }
}

/// Gives a folder permissions of another; `and_write`: and its owner the right to change it.
pub(crate) fn adopt_mode(folder: &Path, of: &fs::Metadata, and_write: bool) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _};
        let mode = of.mode() & 0o7777 | if and_write { 0o300 } else { 0 };
        if fs::metadata(folder)?.mode() & 0o7777 != mode {
            fs::set_permissions(folder, fs::Permissions::from_mode(mode))?;
        }
    }
    let _ = (folder, of, and_write);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_change_places() {
        let dir = tempfile::tempdir().unwrap();
        let [a, b] = ["a", "b"].map(|name| dir.path().join(name));
        for path in [&a, &b] {
            fs::create_dir(path).unwrap();
        }
        fs::write(a.join("of a"), "").unwrap();
        if exchange(&a, &b).unwrap() {
            assert!(b.join("of a").exists() && !a.join("of a").exists());
        }
        assert!(
            exchange(&a, &dir.path().join("nothing")).is_err()
                || cfg!(not(any(target_os = "linux", target_os = "macos")))
        );
    }

    #[cfg(any(unix, windows))]
    #[test]
    fn a_lock_is_held_once_until_it_is_dropped() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lock");
        let Locked::Ours(lock) = FileLock::create(&path).unwrap() else { panic!() };
        assert!(is_same_file(lock.file(), &path) && FileLock::create(&path).is_err());
        assert!(matches!(FileLock::open(&path).unwrap(), Locked::Taken));
        drop(lock);
        assert!(matches!(FileLock::open(&path).unwrap(), Locked::Ours(_)));
    }
}
