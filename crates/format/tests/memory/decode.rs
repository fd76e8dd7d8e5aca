//! `decode_bytes` is what a decode takes, and not much more.

use std::ops::ControlFlow;

use pointmill_format::{Scan, Scratch, Wanted};

use crate::counting::peak_of;
use crate::scenes::{self, Scene};

/// The most that decoding one of the first pieces takes, each with memory of its own, when the next one will follow.
pub(crate) fn taken(scan: &dyn Scan, wanted: &Wanted) -> u64 {
    let decode = |piece: usize| {
        let decoded = || {
            let scratch = &mut Scratch::default();
            scratch.next_piece = Some(piece + 1);
            scan.decode(piece, wanted, scratch, &mut |_| ControlFlow::Continue(())).unwrap();
        };
        peak_of(decoded).1
    };
    (0..scan.pieces().len()).map(decode).max().unwrap_or(0)
}

/// Checks a scan; returns what is said and what is taken for all columns.
fn check(scene: &Scene) -> (u64, u64) {
    let scan = scene.open();
    let all = Wanted::all(scan.info());
    for wanted in [Wanted::positions(scan.info()), all.clone()] {
        let (said, taken) = (scan.decode_bytes(&wanted), taken(scan.as_ref(), &wanted));
        assert!(taken <= said, "{}: {taken} bytes are taken, {said} should be enough", scene.name);
        assert!(said <= 4 * taken, "{}: {said} bytes are said, {taken} are taken", scene.name);
    }
    (scan.decode_bytes(&all), taken(scan.as_ref(), &all))
}

#[test]
fn what_decoding_takes_is_known_beforehand() {
    for scene in scenes::wide().iter().chain(&scenes::usual()) {
        let (said, taken) = check(scene);
        println!("{}: {taken} bytes of {said}", scene.name);
    }
}
