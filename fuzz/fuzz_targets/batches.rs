//! A file of quantised batches in memory: opened, and read to its end.

#![no_main]

use pointmill_format::batches::{AlignedBytes, Batches};
use pointmill_fuzz::check_error;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let opened = Batches::from_bytes(AlignedBytes::from(bytes), "points.qbatch");
    if let Err(error) = opened.and_then(|batches| batches.read_everything()) {
        check_error(&error);
    }
});
