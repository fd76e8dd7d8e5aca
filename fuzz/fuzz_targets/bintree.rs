//! A binary tree in memory: the length of the index (u32, little-endian), the index, then the bytes of every other file.

#![no_main]

#[path = "../../crates/format/tests/bintree/exercise.rs"]
mod exercise;

use exercise::exercise;
use pointmill_fuzz::check_error;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((length, rest)) = bytes.split_first_chunk::<4>() else { return };
    let (index, leaves) = rest.split_at((u32::from_le_bytes(*length) as usize).min(rest.len()));
    if let Err(error) = exercise(index, leaves) {
        check_error(&error);
    }
});
