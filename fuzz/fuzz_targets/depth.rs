//! Depth maps, their colours and the description of their camera, alone and as a folder with a trajectory: the first byte says
//! which of the files the rest is.

#![no_main]

use std::fs;
use std::sync::Once;

use pointmill_format::scan::depth;
use pointmill_format::{DepthOptions, Intrinsics, Wanted};
use pointmill_fuzz::{DEPTH_FILES, MAX_POINTS, check_error, folder};
use pointmill_testkit::files::{entries, fixture};
use pointmill_testkit::reader::keeps_promises;

/// All fixtures of depth maps in the folder of this process.
fn copy(name: &str) {
    fs::create_dir_all(folder().join(name)).expect("a folder can be made");
    for entry in entries(&fixture(name)) {
        let name = format!("{name}/{}", entry.file_name().unwrap_or_default().to_string_lossy());
        if entry.is_dir() {
            copy(&name);
        } else {
            fs::copy(entry, folder().join(name)).expect("a fixture can be copied");
        }
    }
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    static COPIED: Once = Once::new();
    COPIED.call_once(|| copy("depth"));
    let Some((which, bytes)) = bytes.split_first() else { return };
    let name = DEPTH_FILES[usize::from(*which) % DEPTH_FILES.len()];
    let file = folder().join("depth").join(name);
    fs::write(&file, bytes).expect("the input can be written");
    let mut options = DepthOptions::default();
    let scan = match name.split_once('/') {
        None => "single.png",
        Some((sequence, _)) => {
            options.intrinsics =
                Some(Intrinsics { focal: [26.25, 26.0], centre: [15.75, 11.5], size: Some([32, 24]) });
            options.units_per_metre = Some(5000.0);
            sequence
        }
    };
    match depth::open(folder().join("depth").join(scan), &options, None) {
        Ok(scan) => keeps_promises(&*scan, &Wanted::all(scan.info()), MAX_POINTS),
        Err(error) => check_error(&error),
    }
    fs::copy(fixture("depth").join(name), file).expect("the fixture can be copied");
});
