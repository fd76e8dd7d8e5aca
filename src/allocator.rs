//! How the system's allocator keeps what is freed.

/// Large buffers go back to the system as soon as they are freed, whatever sizes were freed before. glibc would raise the
/// size from which it does so up to 32 MiB, keep what is smaller, and let the resident set grow beyond what is in use: by
/// half, where records go to the disk and come back.
pub(crate) fn give_back_early() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: called before any other thread is started; the call changes how memory is kept, never what it holds.
    unsafe {
        libc::mallopt(libc::M_MMAP_THRESHOLD, 512 << 10);
        libc::mallopt(libc::M_TRIM_THRESHOLD, 1 << 20);
    }
}
