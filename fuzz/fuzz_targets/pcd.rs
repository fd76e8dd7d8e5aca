#![no_main]

use pointmill_format::scan::pcd;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| pointmill_fuzz::read(bytes, |path| pcd::open(path)));
