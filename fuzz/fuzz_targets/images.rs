//! Pictures in E57 files: their descriptions and their bytes. Every page's checksum is made right.

#![no_main]

use std::ops::ControlFlow;

use pointmill_format::ImageEncoding;
use pointmill_format::scan::e57;
use pointmill_fuzz::{check_error, repaired, write};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let bytes = repaired(bytes);
    let path = write(&bytes);
    let scan = match e57::open(path) {
        Ok(scan) => scan,
        Err(error) => return check_error(&error),
    };
    for image in scan.info().images.iter().take(50) {
        for blob in [Some(&image.data), image.mask.as_ref()].into_iter().flatten() {
            let mut read = 0;
            let ended = e57::read_blob(path, blob, &mut |part| {
                let _ = ImageEncoding::of(part);
                read += part.len();
                ControlFlow::Continue(())
            });
            match ended {
                Ok(()) => assert!(read as u64 == blob.bytes && read <= bytes.len()),
                Err(error) => check_error(&error),
            }
        }
    }
});
