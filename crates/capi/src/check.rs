//! Does a dataset conform to its format? In brief.

use std::ffi::c_char;
use std::mem::MaybeUninit;
use std::path::Path;

use pointmill_validate::{Finding, Options, Severity, validate};

use crate::border::{buffer, fill, put, text};
use crate::status::{Fault, Outcome, PmStatus, c_text, guard};

/// What a validation found.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PmValidation {
    /// 1: no error was found.
    pub ok: u32,
    /// 0
    pub reserved: u32,
    /// Checks with an error.
    pub failed_checks: u64,
    /// Errors, of which at most 20 per check are counted.
    pub errors: u64,
    /// Warnings, of which at most 20 per check are counted.
    pub warnings: u64,
    /// Points by the metadata.
    pub points: u64,
    /// Nodes that were reached from the root; batches.
    pub nodes: u64,
}

/// Checks the dataset at `path` (UTF-8): that every node decodes, and that boxes, counts, ranges and order are what the
/// format promises. Spacing and coverage are not measured: the program does that (`pointmill validate`).
///
/// A dataset that does not conform is not an error of the call: `*result` says it, and `message` the first finding (the
/// first error, else the first warning), cut where the buffer ends; empty if there is none. `message` has room for
/// `message_capacity` bytes, the 0 at its end included; NULL if that is 0.
///
/// `threads`: 0 is one per core. `memory_bytes`: ceiling of the resident set of the whole process; 0 is 4 GiB. Reads the
/// whole dataset. Any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_validate(
    path: *const c_char,
    threads: u32,
    memory_bytes: u64,
    result: Option<&mut MaybeUninit<PmValidation>>,
    message: *mut c_char,
    message_capacity: usize,
) -> PmStatus {
    guard(|| {
        // SAFETY: that the path ends is the caller's promise
        let path = unsafe { text(path, "path") }?;
        let path = path.to_str().map_err(|_| Fault::argument("path is not UTF-8"))?;
        // SAFETY: the caller's promise
        let message = unsafe { buffer(message.cast::<u8>(), message_capacity, "message") }?;
        let (found, line) = check(Path::new(path), threads, memory_bytes)?;
        put(result, "result", found)?;
        let line = c_text(line);
        let shown = cut(line.to_str().unwrap_or_default(), message.len().saturating_sub(1));
        if message.is_empty() {
            return Ok(());
        }
        fill(message, shown.len() + 1, shown.bytes().chain([0]), "message")
    })
}

/// The start of a text that takes at most `bytes`, without a part of a character.
fn cut(text: &str, bytes: usize) -> &str {
    let end = (0..=bytes.min(text.len())).rev().find(|end| text.is_char_boundary(*end)).unwrap_or(0);
    text.get(..end).unwrap_or_default()
}

/// Ceiling of memory if none is requested.
const MEMORY_BYTES: u64 = 4 << 30;

fn check(path: &Path, threads: u32, memory_bytes: u64) -> Outcome<(PmValidation, String)> {
    let memory_bytes = if memory_bytes == 0 { MEMORY_BYTES } else { memory_bytes };
    let options = Options { threads: threads as usize, memory_bytes, neighbourhoods: false, ..Options::default() };
    let outcome = validate(path, &options, &|_| {})?;
    let is_error = |finding: &&Finding| finding.severity == Severity::Error;
    let errors = outcome.problems.iter().filter(is_error).count() as u64;
    let first = outcome.problems.iter().find(is_error).or(outcome.problems.first());
    let found = PmValidation {
        ok: outcome.ok.into(),
        reserved: 0,
        failed_checks: outcome.checks.iter().filter(|check| !check.ok).count() as u64,
        errors,
        warnings: outcome.problems.len() as u64 - errors,
        points: outcome.points,
        nodes: outcome.nodes,
    };
    Ok((found, first.map_or_else(String::new, ToString::to_string)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_cut_between_characters() {
        assert_eq!([cut("aéb", 9), cut("aéb", 3), cut("aéb", 2), cut("aéb", 0)], ["aéb", "aé", "a", ""]);
    }
}
