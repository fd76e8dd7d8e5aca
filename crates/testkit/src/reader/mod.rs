//! What every reader of scans promises, whatever the bytes say.
//!
//! [`keeps_promises`] checks a [`Scan`] that is open; [`Reader`] opens files first, sound and damaged ones. A broken
//! promise is a panic that names it.

mod cloud;
mod decode;
mod errors;
mod promises;

use std::path::Path;

use pointmill_format::{ReadError, Scan, Wanted};

pub use self::cloud::{Cloud, doubles, integers, read};
pub use self::errors::{check_error, check_scan_error};
pub use self::promises::{columns_are_independent, keeps_promises};
use crate::files;

/// A reader of scans, and what a file of some bytes may make it promise and allocate.
#[derive(Debug, Clone, Copy)]
pub struct Reader {
    /// Opens a file.
    pub open: fn(&Path) -> Result<Box<dyn Scan>, ReadError>,
    /// Points at most in a file of so many bytes, which bounds what a few bytes can cost.
    pub max_points: fn(u64) -> u64,
    /// Bytes at most of [`pointmill_format::Scratch::decoded`] for a file of so many bytes.
    pub max_decoded: fn(u64) -> u64,
}

impl Reader {
    /// Reads all of a file; errors of pieces are in the cloud.
    ///
    /// # Errors
    /// The file cannot be opened.
    ///
    /// # Panics
    /// If a decode breaks a promise, or an error is not one line with a place in the file and advice.
    pub fn read(&self, path: &Path) -> Result<Cloud, ReadError> {
        let scan = (self.open)(path).inspect_err(check_scan_error)?;
        let cloud = read(scan.as_ref(), &Wanted::all(scan.info()));
        let max_points = (self.max_points)(cloud.info.file_bytes);
        assert!(cloud.promised <= max_points, "{} points, at most {max_points} fit the file", cloud.promised);
        let max_decoded = (self.max_decoded)(cloud.info.file_bytes);
        assert!(cloud.decoded_bytes <= max_decoded, "{} bytes decoded, at most {max_decoded}", cloud.decoded_bytes);
        Ok(cloud)
    }

    /// [`Self::read`] of a temporary file with these bytes.
    ///
    /// # Errors
    /// The file cannot be opened.
    pub fn read_bytes(&self, bytes: impl AsRef<[u8]>) -> Result<Cloud, ReadError> {
        self.read(&files::temporary(bytes.as_ref()))
    }

    /// [`Self::read`] and [`keeps_promises`] of a file; `what` is printed if one is broken, for the file may be
    /// temporary.
    ///
    /// # Errors
    /// The file cannot be opened.
    pub fn check(&self, path: &Path, what: &str) -> Result<Cloud, ReadError> {
        let _what = Context(what);
        let cloud = self.read(path)?;
        let scan = (self.open)(path)?;
        keeps_promises(scan.as_ref(), &Wanted::all(scan.info()), u64::MAX);
        Ok(cloud)
    }
}

/// Prints what was tested when a test fails.
struct Context<'a>(&'a str);

impl Drop for Context<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("while testing {}", self.0);
        }
    }
}
