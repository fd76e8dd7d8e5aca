//! Which interface this is, and how its calls end: a status, and a line of text for each thread.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use pointmill_format::{Advice, ErrorKind, ReadError};

/// The interface that this header describes: 1000 · major + minor. Another major number is another interface; a greater
/// minor one has more functions and the same structures. pm_open() refuses what does not fit.
pub const PM_API_VERSION: u32 = 1000;

/// How a call ended. 0 is success; pm_last_error() then says nothing. Values 1 to 6 are the exit codes of the program.
#[repr(u32)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PmStatus {
    /// Done.
    Ok = 0,
    /// A fault of the library: please report it.
    Internal = 1,
    /// An argument is NULL, out of range or not a number.
    Argument = 2,
    /// The dataset is broken: cut short, corrupt or hostile.
    Broken = 3,
    /// This version does not read it, or a dataset of this kind does not have it.
    Unsupported = 4,
    /// The operating system could not read it.
    Io = 5,
    /// It would take more memory than there is, or than is allowed.
    Memory = 6,
    /// The caller's buffer is too small. Nothing was written to it.
    Buffer = 8,
    /// The dataset does not have what was asked for, as colours.
    Missing = 9,
    /// The program was compiled for an incompatible version of this interface.
    Version = 10,
}

/// Why a call ended without success.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) status: PmStatus,
    pub(crate) text: String,
}

impl Fault {
    pub(crate) fn new(status: PmStatus, text: impl Into<String>) -> Self {
        Self { status, text: text.into() }
    }

    pub(crate) fn argument(text: impl Into<String>) -> Self {
        Self::new(PmStatus::Argument, text)
    }

    pub(crate) fn null(name: &str) -> Self {
        Self::argument(format!("{name} is NULL"))
    }
}

impl From<ReadError> for Fault {
    fn from(error: ReadError) -> Self {
        let status = match (error.kind(), error.advice()) {
            (ErrorKind::Broken, _) => PmStatus::Broken,
            (ErrorKind::Unsupported, Some(Advice::MoreMemory)) => PmStatus::Memory,
            (ErrorKind::Unsupported, _) => PmStatus::Unsupported,
            (ErrorKind::Io(_), _) => PmStatus::Io,
        };
        Self::new(status, error.to_string())
    }
}

/// What a call comes to inside of the library.
pub(crate) type Outcome<T = ()> = Result<T, Fault>;

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// Runs the body of a call: no panic leaves it, and its error is kept for this thread.
pub(crate) fn guard(body: impl FnOnce() -> Outcome) -> PmStatus {
    let fault = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => Fault::new(PmStatus::Ok, ""),
        Ok(Err(fault)) => fault,
        Err(panic) => Fault::new(PmStatus::Internal, format!("a fault of pointmill: {}", reason(&*panic))),
    };
    keep(fault.text);
    fault.status
}

fn reason(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("it does not say why")
}

fn keep(text: String) {
    let text = c_text(text);
    // a thread that ends has no text any more
    let _ = LAST_ERROR.try_with(|last| *last.borrow_mut() = text);
}

/// The text for C: it ends at a character 0 where it has one.
pub(crate) fn c_text(text: impl Into<String>) -> CString {
    let mut bytes = text.into().into_bytes();
    if let Some(end) = bytes.iter().position(|b| *b == 0) {
        bytes.truncate(end);
    }
    CString::new(bytes).unwrap_or_default()
}

/// The error of the last call on this thread that returns a status: one line of UTF-8 that says what, where and what to do.
/// Empty after success, never NULL.
///
/// The text belongs to the library and is valid until the next call on this thread. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_last_error() -> *const c_char {
    LAST_ERROR.try_with(|last| last.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_help::last_error;

    #[test]
    fn a_panic_becomes_a_status_and_the_next_success_clears_its_text() {
        assert_eq!(guard(|| panic!("number {}", 7)), PmStatus::Internal);
        assert_eq!(last_error(), "a fault of pointmill: number 7");
        assert_eq!(guard(|| Ok(())), PmStatus::Ok);
        assert_eq!(last_error(), "");
    }

    #[test]
    fn each_thread_has_its_own_text() {
        assert_eq!(guard(|| Err(Fault::null("path"))), PmStatus::Argument);
        std::thread::spawn(|| assert_eq!(last_error(), "")).join().unwrap();
        assert_eq!(last_error(), "path is NULL");
    }

    #[test]
    fn a_text_with_a_zero_ends_there() {
        assert_eq!(c_text("ab\0c").to_bytes(), b"ab");
    }
}
