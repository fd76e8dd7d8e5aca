//! Pictures of datasets and scans, and what is refused.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

use pointmill_testkit::files::fixture;
use pointmill_testkit::las::{Las, Point};
use serde_json::Value;

use crate::support::Dir;

const AERIAL: &str = "las/autzen_trim.laz";

/// Width, height, and red, green and blue of each pixel.
fn pixels(path: &Path) -> (u32, u32, Vec<[u8; 3]>) {
    let mut reader = png::Decoder::new(BufReader::new(File::open(path).unwrap())).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    (reader.info().width, reader.info().height, bytes.as_chunks::<3>().0.to_vec())
}

fn json(dir: &Dir, args: &[&str]) -> Value {
    serde_json::from_str(&dir.succeed(["preview", "--json", "-q"].iter().chain(args)).stdout()).unwrap()
}

/// Pixels that differ.
fn differing(a: &[[u8; 3]], b: &[[u8; 3]]) -> usize {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).filter(|(a, b)| a != b).count()
}

/// Every point of the same scan is in the same place with the same colour, whatever it was converted to. The lattices of the
/// outputs begin elsewhere, so that positions differ by the rounding of doubles: of 110,000 points at most a few are so near
/// to the edge of a pixel. The picture is large enough that no node is too small to be drawn.
#[test]
fn a_scan_and_what_becomes_of_it_look_the_same() {
    let dir = Dir::new();
    let scan = fixture(AERIAL);
    let scan = scan.to_str().unwrap();
    dir.succeed(["convert", scan, "-o", "out", "--to", "potree2", "--to", "copc", "--to", "potree1"]);
    let camera = json(&dir, &[scan, "-o", "scan.png", "--size", "1200x900", "--shading", "plain"])["camera"].clone();
    let numbers = ["eye", "target", "up"].map(|key| camera[key].as_array().unwrap().clone()).concat();
    let camera = numbers.iter().map(ToString::to_string).collect::<Vec<_>>().join(",");
    let (_, _, expected) = pixels(&dir.path("scan.png"));
    for kind in ["potree2", "copc", "potree1"] {
        let (dataset, file) = (format!("out/{kind}"), format!("{kind}.png"));
        let camera = ["--camera", &camera, "--size", "1200x900", "--shading", "plain", "--budget", "100000000"];
        let report = json(&dir, &[&[&dataset, "-o", &file][..], &camera].concat());
        assert_eq!(
            (&report["colour"], report["points"].as_u64() > Some(1000)),
            (&Value::from("rgb"), true),
            "{report}"
        );
        let (_, _, found) = pixels(&dir.path(&file));
        let count = differing(&expected, &found);
        assert!(count <= 10, "{kind}: {count} pixels differ");
    }
}

#[test]
fn every_kind_of_dataset_has_a_picture() {
    let dir = Dir::new();
    for name in ["potree2/brotli", "potree1/words", "copc/format8.copc.laz", "bintree/files", "batches/blocks.qbatch"] {
        let ended =
            dir.succeed(["preview", fixture(name).to_str().unwrap(), "-o", "x.png", "--overwrite", "--size", "80x60"]);
        assert!(ended.stderr().contains("x.png: ") && ended.stderr().contains(" points of "), "{}", ended.stderr());
        let (width, height, rgb) = pixels(&dir.path("x.png"));
        assert_eq!((width, height), (80, 60));
        assert!(rgb.iter().any(|pixel| *pixel != rgb[0]), "{name}");
    }
}

#[test]
fn threads_make_no_difference() {
    let dir = Dir::new();
    for shading in ["plain", "hq", "filled", "edl"] {
        let picture = |threads: &str| {
            let scan = fixture(AERIAL);
            let args = ["-o", "x.png", "--overwrite", "--size", "160x120", "--shading", shading, "--threads", threads];
            dir.succeed(["preview", scan.to_str().unwrap()].iter().chain(&args));
            fs::read(dir.path("x.png")).unwrap()
        };
        assert!(picture("1") == picture("8"), "{shading}");
    }
}

#[test]
fn a_flight_is_numbered_and_begins_and_ends_at_its_keyframes() {
    let dir = Dir::new();
    let eye = |x: f64| format!(r#"{{"eye": [{x}, -20, 10], "target": [5, 5, 0], "fov": 50}}"#);
    let path = format!(r#"{{"keyframes": [{}, {}]}}"#, eye(0.0), eye(10.0));
    dir.write("path.json", path.as_bytes());
    let points: Vec<Point> = (0..200).map(|i| Point::at([i * 50 % 997, i * 70 % 991, 0])).collect();
    dir.write("a.las", &Las::new(points).bytes());
    let frames = json(&dir, &["a.las", "-o", "fly.png", "--path", "path.json", "--frames", "3", "--size", "40x30"]);
    let eyes: Vec<f64> = frames.as_array().unwrap().iter().map(|f| f["camera"]["eye"][0].as_f64().unwrap()).collect();
    assert_eq!(eyes, [0.0, 5.0, 10.0]);
    assert_eq!(dir.names(), ["a.las", "fly0001.png", "fly0002.png", "fly0003.png", "path.json"]);
    dir.write("bad.json", br#"{"keyframes": [{"eye": [0, 0, 0]}]}"#);
    let bad = ["preview", "a.las", "-o", "y.png", "--path", "bad.json", "--frames", "2"];
    dir.run(bad).failed_with(3, &["bad.json", "keyframe 1 has no \"target\""]);
    // the eye meets the target half way: known before the first picture
    dir.write(
        "meet.json",
        br#"{"keyframes": [{"eye": [0, 0, 0], "target": [2, 0, 0]}, {"eye": [2, 0, 0], "target": [0, 0, 0]}]}"#,
    );
    let meet = ["preview", "a.las", "-o", "y.png", "--path", "meet.json", "--frames", "3"];
    dir.run(meet).failed_with(3, &["meet.json: picture 2 of 3", "stands at its own target"]);
    assert!(!dir.names().iter().any(|name| name.starts_with('y')), "{:?}", dir.names());
}

#[test]
fn scenes_of_one_point_or_none_have_a_picture() {
    let dir = Dir::new();
    dir.write("one.las", &Las::new(vec![Point::at([5, 6, 7])]).bytes());
    dir.write("none.las", &Las::new(Vec::new()).bytes());
    dir.succeed(["preview", "one.las", "-o", "one.png", "--size", "40x30"]);
    let (_, _, rgb) = pixels(&dir.path("one.png"));
    assert!(differing(&rgb, &vec![rgb[0]; rgb.len()]) >= 1);
    let ended = dir.succeed(["preview", "none.las", "-o", "none.png", "--size", "40x30"]);
    assert!(ended.stderr().contains("the picture is empty"), "{}", ended.stderr());
    let away = ["preview", "one.las", "-o", "away.png", "--camera", "0,0,0,-1,0,0", "--size", "40x30"];
    assert!(dir.succeed(away).stderr().contains("away.png: no point is in the picture"));
}

#[test]
fn what_cannot_be_drawn_is_refused_before_anything_is_written() {
    let dir = Dir::new();
    let scan = fixture(AERIAL);
    let scan = scan.to_str().unwrap();
    dir.write("old.png", b"not a picture");
    let table: [(&[&str], i32, &str); 20] = [
        (&["-o", "x.png", "--size", "0x5"], 2, "each side must have 1 to 16384"),
        (&["-o", "x.png", "--size", "1000000x1000000"], 2, "each side must have 1 to 16384"),
        (&["-o", "x.png", "--camera", "nan,0,0,1,1,1"], 2, "not finite"),
        (&["-o", "x.png", "--camera", "1e300,0,0,1,1,1"], 2, "farther than 1e30"),
        (&["-o", "x.png", "--camera", "1,1,1,1,1,1"], 2, "stands at its own target"),
        (&["-o", "x.png", "--camera", "0,0,0,1,1,1,0,0,1,180"], 2, "180 degrees"),
        (&["-o", "x.png", "--view", "inside"], 2, "expected one of top, bottom"),
        (&["-o", "x.png", "--colour", "normal"], 4, "the points have no normals"),
        (&["-o", "x.jpg"], 2, "ends in .png"),
        (&["-o", "nowhere/x.png"], 2, "there is no folder nowhere"),
        (&["-o", "old.png"], 2, "exists already; pass --overwrite"),
        (&["-o", "old.png", "--overwrite"], 2, "is no picture and is not replaced"),
        (&["-o", "x.png", "--path", "missing.json", "--frames", "2"], 2, "missing.json: no such file"),
        (&["-o", "x.png", "--budget", "0"], 2, "expected a whole number from 1"),
        (&["-o", "x.png", "--clod", "-1"], 2, "expected a number above 0"),
        (&["-o", "x.png", "--clod", "inf"], 2, "expected a number above 0"),
        (&["-o", "x.png", "--clod", "1"], 2, "--clod is for quantised batches"),
        (&["-o", "x.png", "--bits", "16"], 2, "expected auto, 10, 20 or 30"),
        (&["-o", "x.png", "--bits", "10"], 2, "--bits is for quantised batches"),
        (&["-o", "x.png", "--shape", "cube"], 2, "--shape"),
    ];
    for (args, code, words) in table {
        dir.run(["preview", scan].iter().chain(args)).failed_with(code, &[words]);
    }
    dir.run(["preview", "missing.las", "-o", "x.png"]).failed_with(2, &["missing.las"]);
    assert_eq!(dir.names(), ["old.png"]);
}

#[test]
fn shapes_levels_and_bits_are_those_that_are_asked_for() {
    let dir = Dir::new();
    let scan = fixture(AERIAL);
    dir.succeed(["convert", scan.to_str().unwrap(), "-o", "batches", "--to", "batches"]);
    let drawn = |options: &[&str]| {
        let all = ["batches", "-o", "x.png", "--overwrite", "--size", "160x120"];
        let points = json(&dir, &[&all[..], options].concat())["points"].as_u64().unwrap();
        (points, pixels(&dir.path("x.png")).2)
    };
    let (all, usual) = drawn(&[]);
    assert_eq!(drawn(&["--shape", "paraboloid", "--bits", "auto"]).1, usual);
    let coarse = drawn(&["--clod", "8"]).0;
    assert!(coarse < drawn(&["--clod", "1"]).0 && coarse < all, "{coarse} of {all}");
    assert!(differing(&drawn(&["--shape", "pixel"]).1, &drawn(&["--shape", "square"]).1) > 100);
    let plain = ["--shading", "plain"];
    assert_eq!(drawn(&[&plain[..], &["--shape", "pixel"]].concat()).1, drawn(&plain).1);
    let of_bits = |bits| drawn(&["--bits", bits, "--colour", "bits", "--shading", "plain"]).1;
    assert!(differing(&of_bits("10"), &of_bits("30")) > 100);
}

#[test]
fn an_input_is_not_replaced() {
    let dir = Dir::new();
    let bytes = fs::read(fixture(AERIAL)).unwrap();
    dir.write("scan.png", &bytes);
    dir.run(["preview", "scan.png", "-o", "scan.png", "--overwrite"]).failed_with(2, &["scan.png"]);
    assert!(fs::read(dir.path("scan.png")).unwrap() == bytes);
}
