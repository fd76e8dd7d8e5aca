//! Memory of the caller: the one place where pointers with a length become slices.

use std::ffi::{CStr, c_char};
use std::mem::MaybeUninit;

use crate::status::{Fault, Outcome, PmStatus};

/// A handle or structure of the caller.
pub(crate) fn given<'a, T>(object: Option<&'a T>, name: &str) -> Outcome<&'a T> {
    object.ok_or_else(|| Fault::null(name))
}

/// Writes `value` to where the caller wants it.
pub(crate) fn put<T>(out: Option<&mut MaybeUninit<T>>, name: &str, value: T) -> Outcome {
    out.ok_or_else(|| Fault::null(name))?.write(value);
    Ok(())
}

/// A buffer of the caller with room for `capacity` values; NULL if that is 0.
///
/// # Safety
/// `pointer` is NULL, or `capacity` values may be written there as long as `'a`.
pub(crate) unsafe fn buffer<'a, T>(pointer: *mut T, capacity: usize, name: &str) -> Outcome<&'a mut [MaybeUninit<T>]> {
    if capacity == 0 {
        return Ok(&mut []);
    }
    if pointer.is_null() {
        return Err(Fault::null(name));
    }
    if !pointer.is_aligned() {
        return Err(Fault::argument(format!("{name} is not aligned to {} bytes", align_of::<T>())));
    }
    if capacity > isize::MAX as usize / size_of::<T>().max(1) {
        return Err(Fault::argument(format!("{name} cannot have room for {capacity} values")));
    }
    // SAFETY: not NULL, aligned, no longer than memory is; that it is the caller's is the caller's promise
    Ok(unsafe { std::slice::from_raw_parts_mut(pointer.cast(), capacity) })
}

/// Three coordinates of the caller; `None` of NULL.
///
/// # Safety
/// `pointer` is NULL, or three doubles may be read there.
pub(crate) unsafe fn corner(pointer: *const f64, name: &str) -> Outcome<Option<[f64; 3]>> {
    if pointer.is_null() {
        return Ok(None);
    }
    if !pointer.is_aligned() {
        return Err(Fault::argument(format!("{name} is not aligned to {} bytes", align_of::<f64>())));
    }
    // SAFETY: not NULL and aligned; that there are three is the caller's promise
    let values = unsafe { pointer.cast::<[f64; 3]>().read() };
    match values.iter().all(|v| v.is_finite()) {
        true => Ok(Some(values)),
        false => Err(Fault::argument(format!("{name} is {values:?}"))),
    }
}

/// Copies `values`, which are `count`, to the start of `out`.
pub(crate) fn fill<T>(
    out: &mut [MaybeUninit<T>],
    count: usize,
    values: impl Iterator<Item = T>,
    name: &str,
) -> Outcome {
    let room = out.len();
    let Some(out) = out.get_mut(..count) else {
        let text = format!("{name} has room for {room} values, but there are {count}");
        return Err(Fault::new(PmStatus::Buffer, text));
    };
    out.iter_mut().zip(values).for_each(|(out, value)| {
        out.write(value);
    });
    Ok(())
}

/// A text of the caller.
///
/// # Safety
/// `text` is NULL, or ends with a 0 and stays as it is as long as `'a`.
pub(crate) unsafe fn text<'a>(text: *const c_char, name: &str) -> Outcome<&'a CStr> {
    if text.is_null() {
        return Err(Fault::null(name));
    }
    // SAFETY: not NULL; that it ends is the caller's promise
    Ok(unsafe { CStr::from_ptr(text) })
}

/// Copies a text and the 0 at its end.
pub(crate) fn put_text(out: &mut [MaybeUninit<u8>], text: &CStr, name: &str) -> Outcome {
    let bytes = text.to_bytes_with_nul();
    fill(out, bytes.len(), bytes.iter().copied(), name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn buffers_that_cannot_be_are_refused() {
        let status = |pointer: *mut f64, capacity| {
            // SAFETY: what is refused is not used
            unsafe { buffer(pointer, capacity, "out") }.map(|b| b.len()).map_err(|fault| fault.status)
        };
        let mut values = [0.0f64; 2];
        assert_eq!(status(values.as_mut_ptr(), 2), Ok(2));
        assert_eq!(status(std::ptr::null_mut(), 0), Ok(0));
        let odd = values.as_mut_ptr().wrapping_byte_add(1);
        for (pointer, capacity) in [(std::ptr::null_mut(), 1), (odd, 1), (values.as_mut_ptr(), usize::MAX / 8)] {
            assert_eq!(status(pointer, capacity), Err(PmStatus::Argument));
        }
    }

    #[test]
    fn what_does_not_fit_is_not_written() {
        let mut out = [MaybeUninit::new(7u8); 3];
        assert_eq!(put_text(&mut out, c"abc", "name").unwrap_err().status, PmStatus::Buffer);
        // SAFETY: initialised above
        assert!(out.iter().all(|b| unsafe { b.assume_init() } == 7));
        put_text(&mut out, c"ab", "name").unwrap();
        // SAFETY: initialised above
        assert_eq!(out.map(|b| unsafe { b.assume_init() }), *b"ab\0");
    }
}
