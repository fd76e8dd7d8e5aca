//! Opening scans without more memory than their descriptions may take.

use std::path::Path;
use std::sync::{Mutex, PoisonError};

use pointmill_format::{Advice, OpenOptions, ReadError, Scan, open_scan};

use crate::plan::Plan;

/// The description of one file may take this part of the memory while it is opened.
const DESCRIPTION_SHARE: u64 = 4;

/// Opens scans, on any number of threads.
pub(super) struct Opener {
    /// With what each of the threads may take.
    each: OpenOptions,
    /// With what all of them may take.
    alone: OpenOptions,
    gate: Mutex<()>,
}

impl Opener {
    pub(super) fn new(plan: &Plan, threads: usize) -> Self {
        let mut alone = plan.open.clone();
        let most = *alone.description_bytes.get_or_insert(plan.memory_bytes / DESCRIPTION_SHARE);
        let each = alone.clone().description_bytes(most / threads.max(1) as u64);
        Self { each, alone, gate: Mutex::default() }
    }

    /// Opens a scan; one whose description is larger than the share of a thread while no other of that kind is opened.
    pub(super) fn open(&self, path: &Path) -> Result<Box<dyn Scan>, ReadError> {
        match open_scan(path, &self.each) {
            Err(error) if error.advice() == Some(&Advice::MoreMemory) => {
                let _alone = self.gate.lock().unwrap_or_else(PoisonError::into_inner);
                open_scan(path, &self.alone)
            }
            opened => opened,
        }
    }
}
