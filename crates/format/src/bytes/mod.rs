//! Where bytes come from: sources of a dataset's files, and positioned reads and writes of open files, which any number
//! of threads share without a cursor; files that are opened and memory that is taken on the word of a dataset.

#[cfg(feature = "zip")]
mod archive;
#[cfg(feature = "zip")]
mod archive_parts;
mod room;
mod source;
mod tree;

use std::fs::File;
use std::io;

#[cfg(feature = "zip")]
pub use archive::Archive;
#[cfg(feature = "zip")]
pub use archive_parts::{ArchivedFile, MIN_ARCHIVE_PADDING, put_archive_end};
pub(crate) use room::STEP;
pub use room::{open_file, read_file, try_resize};
pub use source::{ByteSource, Folder, Memory};
pub use tree::FolderTree;

/// Fills `buf` with the bytes of `file` from `offset` on.
///
/// # Errors
/// Those of the operating system; `UnexpectedEof` if the file ends before `buf` is full, `Unsupported` on a system
/// without positioned reads.
pub fn read_exact_at(file: &File, buf: &mut [u8], offset: u64) -> io::Result<()> {
    system::read_exact_at(file, buf, offset)
}

/// Writes all of `buf` at `offset`; the file grows as needed.
///
/// # Errors
/// Those of the operating system; `WriteZero` if it takes no more bytes, `Unsupported` on a system without positioned
/// writes.
pub fn write_all_at(file: &File, buf: &[u8], offset: u64) -> io::Result<()> {
    system::write_all_at(file, buf, offset)
}

#[cfg(unix)]
mod system {
    use std::os::unix::fs::FileExt;
    use std::{fs::File, io};

    pub(super) fn read_exact_at(file: &File, buf: &mut [u8], offset: u64) -> io::Result<()> {
        file.read_exact_at(buf, offset)
    }

    pub(super) fn write_all_at(file: &File, buf: &[u8], offset: u64) -> io::Result<()> {
        file.write_all_at(buf, offset)
    }
}

#[cfg(windows)]
mod system {
    use std::os::windows::fs::FileExt;
    use std::{fs::File, io};

    pub(super) fn read_exact_at(file: &File, mut buf: &mut [u8], mut offset: u64) -> io::Result<()> {
        while !buf.is_empty() {
            match file.seek_read(buf, offset) {
                Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
                Ok(n) => {
                    buf = &mut buf[n..];
                    offset += n as u64;
                }
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(e),
            }
        }
        Ok(())
    }

    pub(super) fn write_all_at(file: &File, mut buf: &[u8], mut offset: u64) -> io::Result<()> {
        while !buf.is_empty() {
            match file.seek_write(buf, offset) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(n) => {
                    buf = &buf[n..];
                    offset += n as u64;
                }
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(e),
            }
        }
        Ok(())
    }
}

#[cfg(not(any(unix, windows)))]
mod system {
    use std::{fs::File, io};

    pub(super) fn read_exact_at(_: &File, _: &mut [u8], _: u64) -> io::Result<()> {
        Err(io::Error::new(io::ErrorKind::Unsupported, "no positioned reads here; use another byte source"))
    }

    pub(super) fn write_all_at(_: &File, _: &[u8], _: u64) -> io::Result<()> {
        Err(io::Error::new(io::ErrorKind::Unsupported, "no positioned writes here"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_at_a_position_is_read_there_and_not_past_the_end() {
        let file = tempfile::tempfile().unwrap();
        write_all_at(&file, b"points", 3).unwrap();
        let mut buf = [0; 4];
        read_exact_at(&file, &mut buf, 5).unwrap();
        assert_eq!(&buf, b"ints");
        assert_eq!(read_exact_at(&file, &mut buf, 6).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }
}
