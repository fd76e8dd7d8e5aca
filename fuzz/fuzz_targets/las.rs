//! LAS and LAZ.

#![no_main]

use pointmill_format::scan::las;
use pointmill_format::{ScanInfo, Wanted};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| pointmill_fuzz::read_some(bytes, |path| las::open(path), wanted));

/// All but the GPS time of layered chunks (point formats 6–10): laz 0.13 calls itself there without a bound on damaged
/// data, and every long run would end with a stack overflow. `fixtures/broken/gps_time_recursion.laz` is one of them.
fn wanted(info: &ScanInfo) -> Wanted {
    let mut wanted = Wanted::all(info);
    let is_layered = info.format.contains("LAZ") && info.attributes.iter().any(|a| a.name == "scanner channel");
    if let Some(time) = info.attributes.iter().position(|a| a.name == "gps-time").filter(|_| is_layered) {
        wanted.set(time, false);
    }
    wanted
}
