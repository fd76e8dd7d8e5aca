//! Ctrl-C, requests to terminate, and other signals.
//!
//! A command that can stop by itself and clean up asks for the flag. Where it does not stop soon, because a library or the
//! system keeps its threads, what it made is removed from here and the process ends: it stops within a second. Cleaning up
//! may take longer, which is told, and is not cut short by a second signal, only by a third. Other commands end at once.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::exit::{Failure, print_line};

static STOP: AtomicBool = AtomicBool::new(false);
static STOPS_BY_ITSELF: AtomicBool = AtomicBool::new(false);
static SIGNALS: AtomicU32 = AtomicU32::new(0);

/// Who removes what was made: the command (`SETTLING`) or, if it does not stop in time, this module (`ABANDONED`).
static STAGE: AtomicU8 = AtomicU8::new(WORKING);
const WORKING: u8 = 0;
const SETTLING: u8 = 1;
const ABANDONED: u8 = 2;
static FOLDER: Mutex<Option<PathBuf>> = Mutex::new(None);
static KEPT: Mutex<Option<String>> = Mutex::new(None);

/// A command that was asked to stop has this long to do so.
const GRACE: Duration = Duration::from_millis(600);
/// Cleaning up that takes longer than this is told.
const PATIENCE: Duration = Duration::from_millis(500);

/// Makes Ctrl-C end the process with exit code 130, and a file that grows beyond the limit an error of the write.
pub(crate) fn watch() {
    let is_hangup_ignored = signals::is_hangup_ignored();
    // Where no handler can be set the default one ends the process, and outputs are safe all the same.
    let _ = ctrlc::set_handler(|| {
        STOP.store(true, Ordering::Relaxed);
        let before = SIGNALS.fetch_add(1, Ordering::Relaxed);
        match before {
            _ if !STOPS_BY_ITSELF.load(Ordering::Relaxed) => end("interrupted"),
            0 => drop(std::thread::Builder::new().spawn(abandon_late_work)),
            1 => say("stopping already, and removing what was made so far; once more ends the program at once"),
            _ => end("interrupted; the next run with the same output removes what this one leaves"),
        }
    });
    if is_hangup_ignored {
        signals::ignore_hangup(); // `nohup` has said that the end of the session is not that of the run
    }
    signals::ignore_file_size();
}

/// The flag that Ctrl-C sets, for a command that checks it often.
pub(crate) fn stop_flag() -> &'static AtomicBool {
    STOPS_BY_ITSELF.store(true, Ordering::Relaxed);
    &STOP
}

/// The command does not check the flag any more: from now on a signal ends the process at once.
pub(crate) fn no_more_checks() {
    settling();
    STOPS_BY_ITSELF.store(false, Ordering::Relaxed);
}

/// Where the command makes its output, all of which is to be removed if it stops.
pub(crate) fn works_in(folder: &Path) {
    *FOLDER.lock().unwrap_or_else(PoisonError::into_inner) = Some(folder.to_path_buf());
}

/// What the user reads if the command is ended in its work, where not everything is lost.
pub(crate) fn keeps(line: impl Into<Option<String>>) {
    *KEPT.lock().unwrap_or_else(PoisonError::into_inner) = line.into();
}

/// That line, once.
pub(crate) fn kept() -> Option<String> {
    KEPT.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// The command has stopped working: it cleans up, or gives its output the name, and is not disturbed.
pub(crate) fn settling() {
    if STAGE.compare_exchange(WORKING, SETTLING, Ordering::AcqRel, Ordering::Acquire) == Err(ABANDONED) {
        loop {
            std::thread::park(); // the process is about to end
        }
    }
}

/// Says that what was made is being removed, if the process still lives after a while.
pub(crate) fn tell_of_cleaning(tell: impl FnOnce() + Send + 'static) {
    let teller = || {
        std::thread::sleep(PATIENCE);
        tell();
    };
    let _ = std::thread::Builder::new().spawn(teller);
}

/// The line for people.
pub(crate) fn cleaning_line() {
    print_line("removing what was made so far");
}

/// Ends the process in place of a command that has not stopped in time.
fn abandon_late_work() {
    std::thread::sleep(GRACE);
    if STAGE.compare_exchange(WORKING, ABANDONED, Ordering::AcqRel, Ordering::Acquire).is_err() {
        return;
    }
    tell_of_cleaning(cleaning_line);
    let folder = FOLDER.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(folder) = folder {
        // Threads make files in it until the process ends, but not under another name. What is left the next run removes.
        let mut other = folder.clone().into_os_string();
        other.push("0");
        let folder = if fs::rename(&folder, &other).is_ok() { PathBuf::from(other) } else { folder };
        let _ = (0..3).find(|_| fs::remove_dir_all(&folder).is_ok());
    }
    end(kept().unwrap_or_else(|| "interrupted; nothing was written".to_owned()));
}

fn end(line: impl Into<String>) {
    say(line);
    std::process::exit(i32::from(Failure::Interrupted(String::new()).code()));
}

/// Prints a line, and does not wait for long: another thread may hold standard error, whose reader has stopped reading.
pub(crate) fn say(line: impl Into<String>) {
    let line = line.into();
    let (done, wait) = std::sync::mpsc::channel();
    let printer = std::thread::Builder::new().spawn(move || {
        print_line(&line);
        let _ = done.send(());
    });
    if printer.is_ok() {
        let _ = wait.recv_timeout(Duration::from_millis(400)); // on a busy machine a thread begins late
    }
}

#[cfg(unix)]
mod signals {
    /// True if the signal at the end of a session is ignored now.
    pub(super) fn is_hangup_ignored() -> bool {
        // SAFETY: without a new action the call only writes the present one, to memory of that type that lives here.
        let (result, action) = unsafe {
            let mut action: libc::sigaction = std::mem::zeroed();
            (libc::sigaction(libc::SIGHUP, std::ptr::null(), &mut action), action)
        };
        result == 0 && action.sa_sigaction == libc::SIG_IGN
    }

    pub(super) fn ignore_hangup() {
        ignore(libc::SIGHUP);
    }

    fn ignore(signal: libc::c_int) {
        // SAFETY: ignoring a signal runs no code and touches no memory of ours.
        unsafe { libc::signal(signal, libc::SIG_IGN) };
    }

    /// A write beyond the limit on the size of files (`ulimit -f`) fails then, instead of ending the process.
    pub(super) fn ignore_file_size() {
        ignore(libc::SIGXFSZ);
    }
}

#[cfg(not(unix))]
mod signals {
    pub(super) fn is_hangup_ignored() -> bool {
        false
    }

    pub(super) fn ignore_hangup() {}

    pub(super) fn ignore_file_size() {}
}
