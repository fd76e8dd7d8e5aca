//! What the tests of all modules share.

use std::ffi::{CStr, CString};
use std::mem::MaybeUninit;
use std::path::{Path, PathBuf};

use crate::{PM_API_VERSION, PmAxes, PmDataset, PmStatus, pm_last_error, pm_open};

pub(crate) fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures").join(name)
}

/// Opens as C does.
pub(crate) fn try_open(path: &Path, axes: u32) -> Result<Box<PmDataset>, PmStatus> {
    let path = CString::new(path.to_str().unwrap()).unwrap();
    let mut out = MaybeUninit::uninit();
    // SAFETY: the path ends; the handle is written whatever the status is
    match unsafe { (pm_open(PM_API_VERSION, path.as_ptr(), axes, Some(&mut out)), out.assume_init()) } {
        (PmStatus::Ok, dataset) => Ok(dataset.unwrap()),
        (status, dataset) => {
            assert!(dataset.is_none());
            Err(status)
        }
    }
}

pub(crate) fn open(name: &str, axes: PmAxes) -> Box<PmDataset> {
    try_open(&fixture(name), axes as u32).unwrap()
}

pub(crate) fn last_error() -> String {
    // SAFETY: a text that ends
    unsafe { CStr::from_ptr(pm_last_error()) }.to_str().unwrap().to_owned()
}
