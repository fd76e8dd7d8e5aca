//! Cut and mutated pictures: an error that names file and byte, or points; never a panic, bounded memory.

use std::fs;

use pointmill_format::{Advice, DepthOptions, ErrorKind, ReadError, Wanted};
use pointmill_testkit::files::fixture_bytes;
use pointmill_testkit::reader::{check_error, read};
use pointmill_testkit::{Random, damage};

use crate::common::{SEQUENCE, SINGLE, cloud, copy_of, open, refused, write_depth};

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
fn a_picture_cut_within_its_header_is_damaged_and_no_picture_of_another_kind() {
    let dir = folder();
    let whole = fixture_bytes("depth/single.png");
    for name in ["single.png", "without_camera.png"] {
        let path = dir.path().join(name);
        for cut in 8..=60 {
            fs::write(&path, &whole[..cut]).unwrap();
            let error = pointmill_format::open_scan(&path, &Default::default()).err().unwrap();
            assert!(matches!(error.kind(), ErrorKind::Broken), "{name} cut to {cut}: {error}");
            // a camera that nothing describes is reported of a header that is whole
            if name == "single.png" || cut < 26 {
                assert_eq!(error.advice(), Some(&Advice::CutShort), "{name} cut to {cut}: {error}");
            }
        }
    }
    let picture = fixture_bytes("depth/single_colour.png");
    fs::write(dir.path().join("without_camera.png"), &picture[..33]).unwrap();
    let error = pointmill_format::open_scan(dir.path().join("without_camera.png"), &Default::default()).err().unwrap();
    assert!(matches!(error.kind(), ErrorKind::Unsupported), "{error}");
}

/// Where each chunk of a PNG file starts, and its name.
fn chunks(png: &[u8]) -> Vec<(usize, [u8; 4])> {
    let mut at = 8;
    let mut found = Vec::new();
    while at + 12 <= png.len() {
        let bytes = u32::from_be_bytes(png[at..at + 4].try_into().unwrap()) as usize;
        found.push((at, png[at + 4..at + 8].try_into().unwrap()));
        at += bytes + 12;
    }
    found
}

#[test]
fn what_is_wrong_with_a_picture_is_said_in_plain_words() {
    let dir = folder();
    let whole = fixture_bytes("depth/single.png");
    let chunks = chunks(&whole);
    let start = |name: &[u8; 4]| chunks.iter().find(|(_, found)| found == name).unwrap().0;
    let (data, end) = (start(b"IDAT"), start(b"IEND"));
    type Change<'a> = &'a dyn Fn(&mut Vec<u8>);
    let changes: [(Change<'_>, &str); 8] = [
        (&|bytes| bytes[29] ^= 1, "the checksum of its chunk IHDR is wrong"),
        (&|bytes| bytes[data + 20] ^= 1, "its compressed pixels are corrupt"),
        (&|bytes| bytes[end - 1] ^= 1, "the checksum of its chunk IDAT is wrong"),
        (&|bytes| bytes[end + 9] ^= 1, "the checksum of its chunk IEND is wrong"),
        (
            &|bytes| {
                bytes[26] = 9; // a method of compression; with the checksum that goes with it
                bytes[29..33].copy_from_slice(&0xe179_4724_u32.to_be_bytes());
            },
            "its header is wrong",
        ),
        (&|bytes| drop(bytes.drain(data..end)), "it has no pixels"),
        (&|bytes| bytes[data + 4..data + 8].copy_from_slice(b"IXXX"), "its chunk IXXX is not known"),
        (&|bytes| drop(bytes.splice(data..data, whole[8..33].iter().copied())), "its chunk IHDR is there twice"),
    ];
    for (change, what) in changes {
        let mut bytes = whole.clone();
        change(&mut bytes);
        fs::write(dir.path().join("single.png"), &bytes).unwrap();
        let line = refused(&dir.path().join("single.png"), DepthOptions::default());
        assert!(line.contains(&format!("single.png: the picture cannot be decoded: {what} (byte ")), "{what}: {line}");
        assert!(line.ends_with("; it is damaged; copy or export it again"), "{line}");
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
fn what_is_wrong_with_a_jpeg_is_said_in_plain_words() {
    let dir = tempfile::tempdir().unwrap();
    let path = write_depth(dir.path(), "a", [40, 24], &[1000; 960], r#", "color": "c.jpg""#);
    let colours: Vec<u8> = (0..40 * 24 * 3).map(|i| (i * 7 % 251) as u8).collect();
    let mut whole = Vec::new();
    jpeg_encoder::Encoder::new(&mut whole, 90).encode(&colours, 40, 24, jpeg_encoder::ColorType::Rgb).unwrap();
    let marker = |second: u8| whole.windows(2).position(|pair| pair == [0xff, second]).unwrap();
    let (frame, scan) = (marker(0xc0), marker(0xda));
    type Change<'a> = &'a dyn Fn(&mut Vec<u8>);
    let changes: [(Change<'_>, bool, &str); 6] = [
        (
            &|bytes| bytes[frame + 1] = 0xc3,
            false,
            "the colour picture is a JPEG of a coding that is not read: lossless",
        ),
        (
            &|bytes| bytes[frame + 1] = 0xc9,
            false,
            "the colour picture is a JPEG of a coding that is not read: arithmetic coding",
        ),
        (&|bytes| bytes[frame + 9] = 77, true, "its header of a frame is wrong"),
        (&|bytes| bytes[scan + 4] = 77, true, "its header of a scan is wrong"),
        (&|bytes| bytes[frame + 5..frame + 9].fill(0), true, "it declares no pixels"),
        (&|bytes| bytes.truncate(scan + 1), true, "it ends before its last pixel"),
    ];
    for (change, is_broken, what) in changes {
        let mut bytes = whole.clone();
        change(&mut bytes);
        fs::write(dir.path().join("c.jpg"), &bytes).unwrap();
        let error = open(&path, DepthOptions::default()).err().unwrap();
        assert!(error.what().contains(what), "{what}: {error}");
        assert_eq!(matches!(error.kind(), ErrorKind::Broken), is_broken, "{error}");
        assert!(error.advice().is_some(), "{error}");
    }
}

#[test]
fn damage_of_any_file_of_a_folder_is_an_error_or_a_frame_less() {
    let mut random = Random::new(20_261_129);
    let dir = copy_of("tum");
    let at = |name: &str| dir.path().join(name);
    let camera = r#"{"fx": 26.25, "fy": 26, "cx": 15.75, "cy": 11.5, "width": 32, "height": 24, "depth_scale": 5000}"#;
    fs::write(at("camera.json"), camera).unwrap();
    let files = [
        "camera.json",
        "depth.txt",
        "rgb.txt",
        "groundtruth.txt",
        "depth/1305031102.194330.png",
        "rgb/1305031102.209430.png",
    ];
    let sequence = |what: &str| {
        // an error of the description of a camera has no byte
        if !what.starts_with("camera.json") {
            return SEQUENCE.check(dir.path(), what).map(|cloud| cloud.errors.len());
        }
        let scan = open(dir.path(), DepthOptions::default()).inspect_err(check_error)?;
        Ok::<_, ReadError>(read(scan.as_ref(), &Wanted::all(scan.info())).errors.len())
    };
    assert_eq!(sequence("the whole").unwrap(), 0);
    let mut ends = [0; 3];
    for name in files {
        let whole = fs::read(at(name)).unwrap();
        let cuts = damage::cuts(&whole).map(<[u8]>::to_vec);
        let mutations = (0..damage::rounds(60)).map(|_| match random.below(2) {
            0 => damage::mutated(&whole, &[0..60, 0..whole.len()], &mut random),
            _ => {
                let mut bytes = whole.clone();
                let place = random.index(bytes.len());
                damage::hit(&mut bytes, place, &mut random);
                bytes
            }
        });
        let damaged: Vec<Vec<u8>> = cuts.chain(mutations).collect();
        for (i, bytes) in damaged.iter().enumerate() {
            fs::write(at(name), bytes).unwrap();
            let end = sequence(&format!("{name}, damage {i}"));
            ends[end.map_or(0, |errors| 1 + usize::from(errors > 0))] += 1;
        }
        fs::write(at(name), &whole).unwrap();
    }
    assert!(ends.iter().all(|count| *count > 20), "refused, whole, with bad frames: {ends:?}");
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
