//! A COPC file, validated: findings or an error of one line, no panic, however wrong the file is.

#![no_main]

use pointmill_fuzz::{check_error, write};
use pointmill_validate::{Options, validate};

/// An input takes no more memory.
const MEMORY_BYTES: u64 = 256 << 20;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if !pointmill_format::copc::is_copc(bytes) {
        return;
    }
    let options = Options { memory_bytes: MEMORY_BYTES, threads: 1, max_problems: 4, ..Options::default() };
    match validate(write(bytes), &options, &|_| {}) {
        Ok(outcome) => assert_eq!(outcome.ok, outcome.checks.iter().all(|check| check.found == 0)),
        Err(error) => check_error(&error),
    }
});
