//! Large buffers in large pages. The kernel hands out memory in pages of 4 KiB, a fault for each; on the way from a
//! LAS file to a dataset these faults were a quarter of all processor time. Asked for 2 MiB pages it faults 512 times
//! less often.
//!
//! The only `unsafe` code of the crate: one call that gives the kernel a hint.

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
