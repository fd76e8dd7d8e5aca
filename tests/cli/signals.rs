//! Signals to a program that runs, at a state that it has reached rather than after a time: machines differ.

use std::process::Child;
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

/// Sends the signal at once; starting another program for it would leave the run time to end.
pub(crate) fn send(child: &Child, signal: Signal) {
    kill(Pid::from_raw(i32::try_from(child.id()).unwrap()), signal).unwrap();
}

/// Waits until the state is reached; panics where it never is.
pub(crate) fn wait_until(what: &str, mut is_reached: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !is_reached() {
        assert!(begun.elapsed() < Duration::from_secs(120), "never: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Waits until the program answers signals itself, or has ended.
pub(crate) fn until_it_watches(child: &mut Child) {
    if cfg!(target_os = "linux") {
        let status = format!("/proc/{}/status", child.id());
        wait_until("it watches for signals", || {
            child.try_wait().unwrap().is_some()
                || has(&std::fs::read_to_string(&status).unwrap_or_default(), "SigCgt:", Signal::SIGINT)
        });
    } else {
        std::thread::sleep(Duration::from_millis(500));
    }
}

/// True if this process ignores the signal, as below `nohup`: those it starts do so too.
pub(crate) fn is_ignored_here(signal: Signal) -> bool {
    has(&std::fs::read_to_string("/proc/self/status").unwrap_or_default(), "SigIgn:", signal)
}

fn has(status: &str, mask: &str, signal: Signal) -> bool {
    let mask = status.lines().find_map(|line| u64::from_str_radix(line.strip_prefix(mask)?.trim(), 16).ok());
    mask.is_some_and(|mask| mask >> (signal as i32 - 1) & 1 == 1)
}
