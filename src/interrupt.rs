//! Ctrl-C and requests to terminate.
//!
//! A command that can stop by itself and clean up asks for the flag. Until one does, and on a second Ctrl-C, the process
//! ends at once.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::exit::Failure;

static STOP: AtomicBool = AtomicBool::new(false);
static STOPS_BY_ITSELF: AtomicBool = AtomicBool::new(false);

/// Makes Ctrl-C end the process with exit code 130.
pub(crate) fn watch() {
    // Where no handler can be set the default one ends the process, and outputs are safe all the same.
    let _ = ctrlc::set_handler(|| {
        let first = !STOP.swap(true, Ordering::Relaxed);
        if !(first && STOPS_BY_ITSELF.load(Ordering::Relaxed)) {
            let failure = Failure::Interrupted("interrupted".to_owned());
            failure.print();
            std::process::exit(i32::from(failure.code()));
        }
    });
}

/// The flag that Ctrl-C sets, for a command that checks it often.
pub(crate) fn stop_flag() -> &'static AtomicBool {
    STOPS_BY_ITSELF.store(true, Ordering::Relaxed);
    &STOP
}
