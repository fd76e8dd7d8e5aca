//! E57 as it comes, and with every page's checksum made right.

#![no_main]

use pointmill_format::scan::e57::{self, E57Options};
use pointmill_fuzz::{read, repaired};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    read(bytes, |path| e57::open(path));
    read(&repaired(bytes), |path| e57::open_with(path, E57Options::default().keep_row_column(true)));
});
