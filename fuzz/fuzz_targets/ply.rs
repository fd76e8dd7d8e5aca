#![no_main]

use pointmill_format::scan::ply;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| pointmill_fuzz::read(bytes, |path| ply::open(path)));
