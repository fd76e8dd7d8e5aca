//! Cut and mutated pictures: an error that names file and byte, or points; never a panic, bounded memory.

use std::fs;

use pointmill_format::DepthOptions;
use pointmill_testkit::files::fixture_bytes;
use pointmill_testkit::{Random, damage};

use crate::common::{SINGLE, cloud, refused, write_depth};

/// A folder with the fixture of one picture.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    for name in ["single.png", "single.json", "single_colour.png"] {
        fs::write(dir.path().join(name), fixture_bytes(&format!("depth/{name}"))).unwrap();
    }
    dir
}

#[test]
fn a_cut_picture_is_an_error_at_its_end() {
    let dir = folder();
    for name in ["single.png", "single_colour.png"] {
        let (path, whole) = (dir.path().join(name), fixture_bytes(&format!("depth/{name}")));
        for cut in damage::cuts(&whole) {
            fs::write(&path, cut).unwrap();
            let result = SINGLE.check(&dir.path().join("single.png"), &format!("{name} cut to {}", cut.len()));
            assert!(
                result.is_err() || result.is_ok_and(|cloud| !cloud.errors.is_empty()),
                "{name} cut to {}",
                cut.len()
            );
        }
        fs::write(&path, &whole).unwrap();
    }
}

#[test]
fn seeded_mutations_never_panic() {
    let dir = folder();
    let mut random = Random::new(20_261_127);
    for name in ["single.png", "single.json", "single_colour.png"] {
        let (path, whole) = (dir.path().join(name), fixture_bytes(&format!("depth/{name}")));
        for round in 0..damage::rounds(300) {
            let ranges = [0..60, whole.len() - 20..whole.len(), 0..whole.len()];
            fs::write(&path, damage::mutated(&whole, &ranges, &mut random)).unwrap();
            // an error of the description has no byte
            if name == "single.json" {
                let _ = pointmill_format::open_scan(dir.path().join("single.png"), &Default::default());
            } else {
                let _ = SINGLE.check(&dir.path().join("single.png"), &format!("{name} round {round}"));
            }
        }
        fs::write(&path, &whole).unwrap();
    }
}

#[test]
fn corrupt_jpeg_colours_are_an_error_or_colours() {
    let dir = tempfile::tempdir().unwrap();
    let size = [40, 24];
    let path = write_depth(dir.path(), "a", size, &[1000; 960], r#", "color": "c.jpg""#);
    let colours: Vec<u8> = (0..40 * 24 * 3).map(|i| (i * 7 % 251) as u8).collect();
    let mut random = Random::new(20_261_128);
    for is_progressive in [false, true] {
        let mut whole = Vec::new();
        let mut encoder = jpeg_encoder::Encoder::new(&mut whole, 90);
        encoder.set_progressive(is_progressive);
        encoder.encode(&colours, 40, 24, jpeg_encoder::ColorType::Rgb).unwrap();
        let jpeg = dir.path().join("c.jpg");
        fs::write(&jpeg, &whole).unwrap();
        assert!(cloud(&path, DepthOptions::default()).errors.is_empty());
        for cut in damage::cuts(&whole) {
            fs::write(&jpeg, cut).unwrap();
            let result = SINGLE.check(&path, &format!("cut to {}", cut.len()));
            assert!(result.is_err() || result.is_ok_and(|cloud| !cloud.errors.is_empty()), "cut to {}", cut.len());
        }
        for round in 0..damage::rounds(600) {
            let bytes = damage::mutated(&whole, &[0..whole.len() / 2, 0..whole.len()], &mut random);
            fs::write(&jpeg, bytes).unwrap();
            let _ = SINGLE.check(&path, &format!("round {round}"));
        }
    }
}

#[test]
fn a_huge_size_is_refused_before_any_memory_is_taken() {
    let dir = tempfile::tempdir().unwrap();
    let path = write_depth(dir.path(), "a", [2, 2], &[1; 4], "");
    let whole = fs::read(&path).unwrap();
    for (width, height) in [(u32::MAX, u32::MAX), (1 << 20, 1 << 20), (0, 5), (8193, 4096)] {
        let mut bytes = whole.clone();
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        fs::write(&path, bytes).unwrap();
        let line = refused(&path, DepthOptions::default());
        assert!(
            line.contains(&format!("a picture of {width} × {height} pixels; 1 to 33554432 are read (byte 16)")),
            "{line}"
        );
    }
}
