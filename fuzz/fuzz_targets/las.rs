//! LAS and LAZ.

#![no_main]

use pointmill_format::scan::las;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| pointmill_fuzz::read(bytes, |path| las::open(path)));
