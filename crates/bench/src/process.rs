//! Runs a program and measures its cost; what programs of this crate ask of the system.

use std::io;
use std::process::Command;

/// The cost of one run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cost {
    /// From start to end, seconds.
    pub wall_secs: f64,
    /// Processor time in the program, with that of the children it waited for, seconds.
    pub user_secs: f64,
    /// Processor time in the kernel, likewise.
    pub system_secs: f64,
    /// Highest resident set, bytes. Never below that of the program which measures (some MB).
    pub peak_bytes: u64,
    /// The exit code; −1 if a signal ended it.
    pub exit_code: i32,
}

impl Cost {
    /// All processor time, seconds.
    pub fn cpu_secs(&self) -> f64 {
        self.user_secs + self.system_secs
    }
}

/// Brings what earlier runs wrote to the disk, so that later ones do not pay for it.
#[cfg(unix)]
pub fn settle() {
    // SAFETY: no arguments, cannot fail.
    unsafe { libc::sync() };
}

/// There is no `sync` here.
#[cfg(not(unix))]
pub fn settle() {}

/// Runs `command` to its end.
///
/// # Errors
/// The program cannot be started.
#[cfg(unix)]
pub fn run(command: &mut Command) -> io::Result<Cost> {
    let start = std::time::Instant::now();
    let child = command.spawn()?;
    let pid = child.id() as libc::pid_t;
    let mut status = 0;
    // SAFETY: a struct of integers, for which zeros are a value.
    let mut usage: libc::rusage = unsafe { std::mem::zeroed() };
    loop {
        // SAFETY: `status` and `usage` outlive the call. `pid` is our child, and nobody else waits for it: `child` is
        // never asked again, and dropping it does not wait.
        if unsafe { libc::wait4(pid, &mut status, 0, &mut usage) } == pid {
            break;
        }
        let error = io::Error::last_os_error();
        if error.kind() != io::ErrorKind::Interrupted {
            return Err(error);
        }
    }
    let secs = |t: libc::timeval| t.tv_sec as f64 + t.tv_usec as f64 * 1e-6;
    let unit = if cfg!(target_os = "macos") { 1 } else { 1024 };
    Ok(Cost {
        wall_secs: start.elapsed().as_secs_f64(),
        user_secs: secs(usage.ru_utime),
        system_secs: secs(usage.ru_stime),
        peak_bytes: usage.ru_maxrss as u64 * unit,
        exit_code: if libc::WIFEXITED(status) { libc::WEXITSTATUS(status) } else { -1 },
    })
}

/// There is no `wait4` here.
///
/// # Errors
/// Always.
#[cfg(not(unix))]
pub fn run(_command: &mut Command) -> io::Result<Cost> {
    Err(io::Error::new(io::ErrorKind::Unsupported, "processor time and memory are measured on Unix only"))
}

/// Asks for pages of 2 MiB, as pointmill does: with 4 KiB, faults are an eighth of all time.
pub fn prefer_large_pages(memory: &mut [u8]) {
    #[cfg(target_os = "linux")]
    {
        let (start, end) = ((memory.as_ptr() as usize).next_multiple_of(4096), memory.as_ptr_range().end as usize);
        if start < end {
            // SAFETY: the range lies inside memory that is borrowed mutably; the call changes how it is backed, never
            // what it holds, and a refusal is harmless.
            unsafe { libc::madvise(start as *mut libc::c_void, end - start, libc::MADV_HUGEPAGE) };
        }
    }
    #[cfg(not(target_os = "linux"))]
    let _ = memory;
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn time_memory_and_exit_code_are_those_of_the_child() {
        let mut sleeper = Command::new("sh");
        let cost = run(sleeper.args(["-c", "sleep 0.2; exit 3"])).unwrap();
        assert_eq!(cost.exit_code, 3);
        assert!(cost.wall_secs >= 0.2 && cost.cpu_secs() < cost.wall_secs, "{cost:?}");
        assert!(cost.peak_bytes > 100 << 10, "{cost:?}");
        let mut counts = Command::new("sh");
        let cost = run(counts.args(["-c", "i=0; while [ $i -lt 100000 ]; do i=$((i+1)); done"])).unwrap();
        assert!(cost.user_secs > 0.0 && cost.user_secs > cost.system_secs, "{cost:?}");
        let mut killed = Command::new("sh");
        assert_eq!(run(killed.args(["-c", "kill -9 $$"])).unwrap().exit_code, -1);
        assert!(run(&mut Command::new("no-such-program")).is_err());
    }
}
