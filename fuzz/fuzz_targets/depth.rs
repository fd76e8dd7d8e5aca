//! Depth maps, their colours and the description of their camera: the first byte says which of these the rest is.

#![no_main]

use std::fs;

use pointmill_format::scan::depth;
use pointmill_format::{DepthOptions, Wanted};
use pointmill_fuzz::{MAX_POINTS, check_error, folder};
use pointmill_testkit::files::fixture_bytes;
use pointmill_testkit::reader::keeps_promises;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((which, bytes)) = bytes.split_first() else { return };
    let names = ["single.png", "single.json", "single_colour.png"];
    for (i, name) in names.iter().enumerate() {
        let is_fuzzed = usize::from(*which) % names.len() == i;
        let sound = if is_fuzzed { bytes.to_vec() } else { fixture_bytes(&format!("depth/{name}")) };
        fs::write(folder().join(name), sound).expect("the input can be written");
    }
    match depth::open(folder().join(names[0]), &DepthOptions::default(), None) {
        Ok(scan) => keeps_promises(&*scan, &Wanted::all(scan.info()), MAX_POINTS),
        Err(error) => check_error(&error),
    }
});
