//! E57 as it comes, and with every page's checksum made right: no mutation would get past these.

#![no_main]

use pointmill_format::scan::e57::{self, E57Options};

const PAGE: usize = 1024;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    pointmill_fuzz::read(bytes, |path| e57::open(path));
    let repaired: Vec<u8> = bytes.chunks_exact(PAGE).flat_map(repair).collect();
    pointmill_fuzz::read(&repaired, |path| e57::open_with(path, E57Options::default().keep_row_column(true)));
});

fn repair(page: &[u8]) -> Vec<u8> {
    let data = &page[..PAGE - 4];
    [data, &crc32c::crc32c(data).to_be_bytes()].concat()
}
