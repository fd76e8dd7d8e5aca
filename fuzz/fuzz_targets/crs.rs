//! What scans and users say of coordinate reference systems: WKT, proj4 definitions and codes, to be reprojected, and as viewers get
//! them.

#![no_main]

use pointmill_converter::resolve_crs;
use pointmill_crs::Placing;
use pointmill_format::Crs;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let _ = Placing::is_unknown_code(text);
    for placing in [Placing::default().with_crs(text), Placing::default().with_target(text)] {
        if let Err(error) = placing {
            let line = error.to_string();
            assert!(!line.is_empty() && !line.contains('\n'), "{line}");
        }
    }
    for is_wkt in [true, false] {
        let mut found = Crs::default();
        if is_wkt { &mut found.wkt } else { &mut found.proj4 }.replace(text.to_owned());
        let resolved = resolve_crs(&found);
        assert!(!resolved.projection.contains('\n') && !resolved.label.contains('\n'), "{resolved:?}");
    }
});
