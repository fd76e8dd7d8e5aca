//! Bounds that a header declares may cost a second read, never precision.

use std::fs;
use std::path::Path;

use pointmill_converter::{Plan, Potree2Settings, Report, Silent, Warning, convert};
use pointmill_testkit::files::corpus;

/// Bytes of a page, and of its checksum at the end.
const PAGE: usize = 1024;
const CHECKSUM: usize = 4;

/// The file with every `xMaximum` of its XML exchanged for nines of the same length.
fn lie(file: &[u8]) -> Vec<u8> {
    let mut logical: Vec<u8> = file.chunks(PAGE).flat_map(|page| &page[..PAGE - CHECKSUM]).copied().collect();
    let (open, close) = (&b"<xMaximum type=\"Float\">"[..], &b"</xMaximum>"[..]);
    let find =
        |from: usize, what: &[u8]| logical[from..].windows(what.len()).position(|w| w == what).map(|at| from + at);
    let mut places = Vec::new();
    let mut at = 0;
    while let Some(start) = find(at, open).map(|at| at + open.len()) {
        at = find(start, close).unwrap();
        places.push(start..at);
    }
    assert!(!places.is_empty() && places.iter().all(|p| p.len() > 6), "{places:?}");
    places.into_iter().for_each(|place| logical[place].fill(b'9'));
    let page = |bytes: &[u8]| [bytes, &crc32c::crc32c(bytes).to_be_bytes()].concat();
    logical.chunks(PAGE - CHECKSUM).flat_map(page).collect()
}

fn report_of(scan: &Path) -> Report {
    let out = scan.with_extension("out");
    convert(&Plan::new(vec![scan.to_path_buf()], out), &[Potree2Settings::default().into()], &Silent).unwrap()
}

#[test]
fn declared_bounds_far_too_wide_do_not_make_the_step_coarser() {
    let dir = tempfile::tempdir().unwrap();
    let Some(path) = corpus("e57/bunnyInt32.e57") else { return };
    let honest = fs::read(path).unwrap();
    let files = [("honest.e57", honest.clone()), ("liar.e57", lie(&honest))];
    let [honest, liar] = files.map(|(name, bytes)| {
        let path = dir.path().join(name);
        fs::write(&path, bytes).unwrap();
        report_of(&path)
    });
    let is_read_again = |w: &Warning| matches!(w, Warning::ReadAgain | Warning::FinerStep { .. });
    assert!(liar.warnings.iter().any(is_read_again), "{:?}", liar.warnings);
    assert_eq!((liar.grid.scale, liar.outputs[0].points), (honest.grid.scale, honest.outputs[0].points));
    assert_eq!(liar.checksum_in, honest.checksum_in);
}
