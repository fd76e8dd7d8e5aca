//! Files that are opened, and memory that is taken, on the word of a dataset.

use std::fs::{File, FileType};
use std::io::{self, Read as _};
use std::path::Path;

/// Bytes that are read at a time where a length is that of a file, which may be sparse: what the bytes say decides how
/// many more are read.
pub(crate) const STEP: u64 = 1 << 20;

/// Opens a file to read it. A pipe, a socket, a device or a folder is refused before it is opened: some never answer.
///
/// # Errors
/// Those of the operating system; `InvalidInput` for what is no file.
pub fn open_file(path: impl AsRef<Path>) -> io::Result<File> {
    let path = path.as_ref();
    let kind = path.metadata()?.file_type();
    if !kind.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, format!("it is no file, but {}", word(kind))));
    }
    File::open(path)
}

/// All bytes of a file that has at most `most`.
///
/// # Errors
/// As [`open_file`]; `FileTooLarge` for a longer file, of which nothing is read.
pub fn read_file(path: impl AsRef<Path>, most: u64) -> io::Result<Vec<u8>> {
    let file = open_file(path)?;
    let len = file.metadata()?.len();
    if len > most {
        let what = format!("it has {len} bytes, at most {most} are read");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, what));
    }
    let mut bytes = Vec::new();
    file.take(most).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Makes `buffer` that many elements long; new ones are `T::default()`.
///
/// # Errors
/// `OutOfMemory`; the buffer is as before.
pub fn try_resize<T: Clone + Default>(buffer: &mut Vec<T>, len: u64) -> io::Result<()> {
    let none = || io::Error::new(io::ErrorKind::OutOfMemory, format!("no memory for {len} values"));
    let len = usize::try_from(len).map_err(|_| none())?;
    buffer.try_reserve_exact(len.saturating_sub(buffer.len())).map_err(|_| none())?;
    buffer.resize(len, T::default());
    Ok(())
}

#[cfg(unix)]
fn word(kind: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt as _;
    match kind {
        kind if kind.is_dir() => "a folder",
        kind if kind.is_fifo() => "a pipe",
        kind if kind.is_socket() => "a socket",
        kind if kind.is_char_device() || kind.is_block_device() => "a device",
        _ => "something else",
    }
}

#[cfg(not(unix))]
fn word(kind: FileType) -> &'static str {
    if kind.is_dir() { "a folder" } else { "something else" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_file_is_refused_and_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let fault = open_file(folder.path()).unwrap_err();
        assert_eq!(
            (fault.kind(), fault.to_string()),
            (io::ErrorKind::InvalidInput, "it is no file, but a folder".into())
        );
        assert_eq!(open_file(folder.path().join("none")).unwrap_err().kind(), io::ErrorKind::NotFound);
        #[cfg(unix)]
        {
            let socket = folder.path().join("socket");
            let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
            assert!(open_file(&socket).unwrap_err().to_string().ends_with("a socket"));
            assert!(open_file("/dev/null").unwrap_err().to_string().ends_with("a device"));
        }
    }

    #[test]
    fn a_file_longer_than_allowed_is_not_read() {
        let path = tempfile::tempdir().unwrap();
        let path = path.path().join("sparse");
        File::create(&path).unwrap().set_len(100 << 30).unwrap();
        assert_eq!(read_file(&path, 1 << 20).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        std::fs::write(&path, "abc").unwrap();
        assert_eq!(read_file(&path, 3).unwrap(), b"abc");
    }

    #[test]
    fn memory_that_is_not_there_is_an_error() {
        let mut buffer = vec![7u64];
        for len in [u64::MAX, 1 << 61, 1 << 46] {
            assert_eq!(try_resize(&mut buffer, len).unwrap_err().kind(), io::ErrorKind::OutOfMemory, "{len}");
        }
        assert_eq!(buffer, [7]);
        try_resize(&mut buffer, 3).unwrap();
        assert_eq!(buffer, [7, 0, 0]);
    }
}
