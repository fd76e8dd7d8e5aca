#![no_main]

use pointmill_format::las;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| pointmill_fuzz::read(bytes, las::open));
