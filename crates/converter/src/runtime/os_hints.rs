//! Hints to the operating system: calls that change no data.
//!
//! Large buffers in large pages: the kernel hands out memory in pages of 4 KiB, a fault for each; on the way from a LAS
//! file to a dataset these faults were an eighth of all processor time. Asked for 2 MiB pages it faults 512 times less
//! often. Early write-back: a dataset is synced before it gets its name; begun while it is still being built, that
//! costs no waiting at the end.

use std::fs::File;

/// Bytes of a file that are read or written together where only their number counts. The allocator keeps buffers of that size for
/// the next; for much larger ones it asks the system each time, which costs a fault for each page.
pub(crate) const PART_BYTES: usize = 256 << 10;

/// An empty buffer of that capacity, in large pages where the system has them.
pub(crate) fn buffer(capacity: usize) -> Vec<u8> {
    let mut buffer = Vec::with_capacity(capacity);
    prefer_large_pages(&mut buffer);
    buffer
}

/// Makes room for `additional` more bytes, in large pages where the system has them.
pub(crate) fn reserve(buffer: &mut Vec<u8>, additional: usize) {
    if buffer.capacity() - buffer.len() < additional {
        buffer.reserve_exact(additional);
        prefer_large_pages(buffer);
    }
}

#[cfg(target_os = "linux")]
fn prefer_large_pages(buffer: &mut Vec<u8>) {
    const LARGE: usize = 2 << 20;
    const SMALL: usize = 4096;
    if buffer.capacity() < LARGE {
        return;
    }
    let start = buffer.as_mut_ptr() as usize;
    let first = start.next_multiple_of(SMALL);
    let end = (start + buffer.capacity()) / SMALL * SMALL;
    if first < end {
        // SAFETY: the range lies inside an allocation that `buffer` owns and borrows mutably. MADV_HUGEPAGE changes how
        // the range is backed, never what it holds; a refusal is harmless. Paid for by the whole-program benchmark.
        unsafe { libc::madvise(first as *mut libc::c_void, end - first, libc::MADV_HUGEPAGE) };
    }
}

#[cfg(not(target_os = "linux"))]
fn prefer_large_pages(_buffer: &mut Vec<u8>) {}

/// Asks the system to begin writing this range of a file to the disk, and does not wait.
pub(crate) fn start_write_back(file: &File, offset: u64, len: usize) {
    #[cfg(target_os = "linux")]
    {
        use std::os::fd::AsRawFd;
        let (offset, len) = (offset as i64, len as i64);
        // SAFETY: the descriptor is open while `file` is borrowed; the call touches no memory of ours, and a refusal is
        // harmless because the file is synced later. Paid for by the whole-program benchmark (wall time).
        unsafe { libc::sync_file_range(file.as_raw_fd(), offset, len, libc::SYNC_FILE_RANGE_WRITE) };
    }
    #[cfg(not(target_os = "linux"))]
    let _ = (file, offset, len);
}

/// Waits until all that is written to the file system of `folder` is on the disk; false where the system cannot be asked.
pub(crate) fn sync_file_system(folder: &File) -> std::io::Result<bool> {
    #[cfg(target_os = "linux")]
    {
        use std::os::fd::AsRawFd;
        // SAFETY: the descriptor is open while `folder` is borrowed; the call touches no memory of ours.
        match unsafe { libc::syncfs(folder.as_raw_fd()) } {
            0 => Ok(true),
            _ => Err(std::io::Error::last_os_error()),
        }
    }
    #[cfg(not(target_os = "linux"))]
    {
        let _ = folder;
        Ok(false)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_hold_what_they_are_given() {
        let mut b = buffer(5 << 20);
        b.resize(4 << 20, 7);
        reserve(&mut b, 9 << 20);
        assert!(b.capacity() >= 13 << 20 && b.len() == 4 << 20 && b.iter().all(|v| *v == 7));
        assert_eq!(buffer(0).capacity(), 0);
    }
}
