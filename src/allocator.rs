//! How the system's allocator keeps what is freed.

/// Sets it before any other thread is started.
///
/// Large buffers go back to the system as soon as they are freed, whatever sizes were freed before. glibc would raise the
/// size from which it does so up to 32 MiB, keep what is smaller, and let the resident set grow beyond what is in use: by
/// half, where records go to the disk and come back.
///
/// Units of a job are different: a process does one after the other, all of some megabytes. Of what it asked the system for it
/// got three quarters again and again, a fault for each page, which was a quarter of its processor time; kept, it is 10 MiB more
/// for each thread.
pub(crate) fn set_up(is_for_units: bool) {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        let (from_system, kept) = if is_for_units { (32 << 20, 64 << 20) } else { (512 << 10, 1 << 20) };
        // SAFETY: called before any other thread is started; the call changes how memory is kept, never what it holds.
        unsafe {
            libc::mallopt(libc::M_MMAP_THRESHOLD, from_system);
            libc::mallopt(libc::M_TRIM_THRESHOLD, kept);
        }
    }
    #[cfg(not(all(target_os = "linux", target_env = "gnu")))]
    let _ = is_for_units;
}
