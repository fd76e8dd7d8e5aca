//! Ctrl-C, requests to terminate, and other signals.
//!
//! A command that can stop by itself and clean up asks for the flag; it stops within a second. Cleaning up may take longer
//! and is not cut short by a second signal, only by a third. Other commands end at once.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use crate::exit::{Failure, print_line};

static STOP: AtomicBool = AtomicBool::new(false);
static STOPS_BY_ITSELF: AtomicBool = AtomicBool::new(false);
static SIGNALS: AtomicU32 = AtomicU32::new(0);

/// Makes Ctrl-C end the process with exit code 130, and a file that grows beyond the limit an error of the write.
pub(crate) fn watch() {
    let ignored = signals::ignored();
    // Where no handler can be set the default one ends the process, and outputs are safe all the same.
    let _ = ctrlc::set_handler(|| {
        STOP.store(true, Ordering::Relaxed);
        let before = SIGNALS.fetch_add(1, Ordering::Relaxed);
        match before {
            _ if !STOPS_BY_ITSELF.load(Ordering::Relaxed) => end("interrupted"),
            0 => {}
            1 => say("stopping already, and removing what was made so far; once more ends the program at once"),
            _ => end("interrupted; the next run with the same output removes what this one leaves"),
        }
    });
    // As for `nohup`: who started the program has said that it must not hear these.
    ignored.into_iter().for_each(signals::ignore);
    signals::ignore_file_size();
}

/// The flag that Ctrl-C sets, for a command that checks it often.
pub(crate) fn stop_flag() -> &'static AtomicBool {
    STOPS_BY_ITSELF.store(true, Ordering::Relaxed);
    &STOP
}

/// The command does not check the flag any more: from now on a signal ends the process at once.
pub(crate) fn no_more_checks() {
    STOPS_BY_ITSELF.store(false, Ordering::Relaxed);
}

fn end(line: &'static str) {
    say(line);
    std::process::exit(i32::from(Failure::Interrupted(String::new()).code()));
}

/// Does not wait for long: another thread may hold standard error, whose reader has stopped reading.
fn say(line: &'static str) {
    let (done, wait) = std::sync::mpsc::channel();
    let printer = std::thread::Builder::new().spawn(move || {
        print_line(line);
        let _ = done.send(());
    });
    if printer.is_ok() {
        let _ = wait.recv_timeout(Duration::from_millis(200));
    }
}

#[cfg(unix)]
mod signals {
    /// Those of the signals watched that are ignored now.
    pub(super) fn ignored() -> Vec<libc::c_int> {
        let is_ignored = |signal: &libc::c_int| {
            // SAFETY: without a new action the call only writes the present one, to memory of that type that lives here.
            let (result, action) = unsafe {
                let mut action: libc::sigaction = std::mem::zeroed();
                (libc::sigaction(*signal, std::ptr::null(), &mut action), action)
            };
            result == 0 && action.sa_sigaction == libc::SIG_IGN
        };
        [libc::SIGINT, libc::SIGTERM, libc::SIGHUP].into_iter().filter(is_ignored).collect()
    }

    pub(super) fn ignore(signal: libc::c_int) {
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
    pub(super) fn ignored() -> Vec<i32> {
        Vec::new()
    }

    pub(super) fn ignore(_: i32) {}

    pub(super) fn ignore_file_size() {}
}
