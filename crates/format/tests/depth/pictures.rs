//! Colours of all kinds, normals, and pictures that do not fit.

use std::fs;

use png::{BitDepth, ColorType};
use pointmill_format::DepthOptions;

use crate::common::{cloud, refused, write_depth, write_png};

const SIZE: [u32; 2] = [3, 2];
const DEPTHS: [u16; 6] = [1000, 2000, 0, 1500, 0, 3000];

/// The colours of the four points of a depth map whose colours are in the file `name`.
fn colours(folder: &std::path::Path, name: &str) -> Vec<[u16; 3]> {
    let path = write_depth(folder, "a", SIZE, &DEPTHS, &format!(r#", "color": "{name}""#));
    let cloud = cloud(&path, DepthOptions::default());
    assert_eq!((cloud.len(), cloud.errors.len(), cloud.info.rgb_is_16_bit), (4, 0, true));
    let rgb = cloud.column("rgb").values::<u16>().unwrap();
    rgb.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect()
}

#[test]
fn positions_are_those_of_the_pinhole() {
    let dir = tempfile::tempdir().unwrap();
    let pose = r#", "pose": [0,0,1,10, -1,0,0,20, 0,-1,0,30, 0,0,0,1]"#;
    let path = write_depth(dir.path(), "a", SIZE, &DEPTHS, pose);
    let found = cloud(&path, DepthOptions::default()).xyz;
    // (u − 1) · z, v · z, z; then z forward becomes x, x right becomes −y, y down becomes −z
    assert_eq!(found, [vec![11.0, 12.0, 11.5, 13.0], vec![21.0, 20.0, 21.5, 17.0], vec![30.0, 30.0, 28.5, 27.0]]);
}

#[test]
fn png_colours_of_every_kind_become_16_bits() {
    let dir = tempfile::tempdir().unwrap();
    let at = dir.path().join("c.png");
    write_png(&at, SIZE, ColorType::Rgb, BitDepth::Eight, &std::array::from_fn::<u8, 18, _>(|i| i as u8 * 10));
    let expected = [[0, 10, 20], [30, 40, 50], [90, 100, 110], [150, 160, 170]].map(|c: [u16; 3]| c.map(|v| v * 257));
    assert_eq!(colours(dir.path(), "c.png"), expected);
    write_png(&at, SIZE, ColorType::Grayscale, BitDepth::Eight, &[1, 2, 3, 4, 5, 6]);
    assert_eq!(colours(dir.path(), "c.png"), [1, 2, 4, 6].map(|v| [v * 257; 3]));
    let path = write_depth(dir.path(), "b", SIZE, &DEPTHS, "");
    let mut options = DepthOptions::default();
    options.colours = Some(at.clone());
    let named = cloud(&path, options);
    assert_eq!(named.column("rgb").values::<u16>().unwrap()[..4], [257, 257, 257, 514], "named in options");
    let wide: Vec<u8> = (0..24u16).flat_map(|i| (i * 1000).to_be_bytes()).collect();
    write_png(&at, SIZE, ColorType::Rgba, BitDepth::Sixteen, &wide);
    let expected = [0, 4, 12, 20].map(|first| [first, first + 1, first + 2].map(|v| v * 1000));
    assert_eq!(colours(dir.path(), "c.png"), expected);
}

#[test]
fn jpeg_colours_are_read_in_colour_and_grey() {
    let dir = tempfile::tempdir().unwrap();
    let at = dir.path().join("c.jpg");
    let near = |found: u16, expected: u16| found.abs_diff(expected * 257) <= 3 * 257;
    let encode = |bytes: &[u8], colour| {
        let mut encoder = jpeg_encoder::Encoder::new_file(&at, 100).unwrap();
        encoder.set_sampling_factor(jpeg_encoder::SamplingFactor::F_1_1);
        encoder.encode(bytes, 3, 2, colour).unwrap();
    };
    encode(&[[200, 100, 50]; 6].concat(), jpeg_encoder::ColorType::Rgb);
    for colour in colours(dir.path(), "c.jpg") {
        assert!(colour.iter().zip([200, 100, 50]).all(|(found, expected)| near(*found, expected)), "{colour:?}");
    }
    encode(&[90; 6], jpeg_encoder::ColorType::Luma);
    for colour in colours(dir.path(), "c.jpg") {
        assert!(colour.iter().all(|found| near(*found, 90)), "{colour:?}");
    }
}

#[test]
fn normals_of_a_wall_look_at_the_camera() {
    let dir = tempfile::tempdir().unwrap();
    let pose = r#", "pose": [0,0,1,10, -1,0,0,20, 0,-1,0,30, 0,0,0,1]"#;
    let path = write_depth(dir.path(), "a", SIZE, &[2000; 6], pose);
    let mut options = DepthOptions::default();
    options.normals = true;
    let cloud = cloud(&path, options);
    for (axis, expected) in [("NormalX", -1.0), ("NormalY", 0.0), ("NormalZ", 0.0)] {
        let found = cloud.column(axis).values::<f32>().unwrap();
        assert!(found.iter().all(|n| (n - expected).abs() < 1e-6), "{axis}: {found:?}");
    }
}

#[test]
fn what_does_not_fit_is_refused_with_the_reason() {
    let dir = tempfile::tempdir().unwrap();
    let none = DepthOptions::default;
    let at = write_depth(dir.path(), "a", SIZE, &DEPTHS, r#", "color": "c.png""#);
    assert!(refused(&at, none()).contains("c.png: no such picture"));
    for (name, shown) in [(".", "/.: "), ("", ": "), ("..", "/..: "), ("sub", "sub: ")] {
        fs::create_dir_all(dir.path().join("sub")).unwrap();
        let at = write_depth(dir.path(), "folder", SIZE, &DEPTHS, &format!(r#", "color": "{name}""#));
        let line = refused(&at, none());
        assert!(line.contains(&format!("{shown}this is a folder, not a picture; correct the path")), "{line}");
    }
    write_png(&dir.path().join("c.png"), [2, 3], ColorType::Grayscale, BitDepth::Eight, &[0; 6]);
    assert!(refused(&at, none()).contains("the colour picture has 2 × 3 pixels, the depth map 3 × 2"));
    fs::write(dir.path().join("c.png"), "BM").unwrap();
    assert!(refused(&at, none()).contains("neither PNG nor JPEG"));

    let at = write_depth(dir.path(), "b", SIZE, &[0; 6], "");
    assert!(refused(&at, none()).contains("no pixel has a depth: all are 0"));
    let at = write_depth(dir.path(), "b", SIZE, &DEPTHS, "");
    let mut far = none();
    far.range = Some(10.0..=20.0);
    assert!(refused(&at, far).contains("no pixel has a depth of 10 to 20 m"));
    write_png(&at, SIZE, ColorType::Grayscale, BitDepth::Eight, &[1; 6]);
    assert!(refused(&at, none()).contains("a PNG picture of 8-bit grey; a depth map has 16-bit grey"));
    write_png(&at, [2, 2], ColorType::Grayscale, BitDepth::Sixteen, &[1; 8]);
    assert!(refused(&at, none()).contains("the picture has 2 × 2 pixels, the intrinsics are those of 3 × 2"));
    let sidecar = dir.path().join("b.json");
    for (text, what) in [
        (r#"{"fx": 1, "fy": 1, "cx": 1, "cy": 0}"#, "nothing says the scale of the depths"),
        (r#"{"depth_scale": 1000}"#, "nothing says the intrinsics of the camera"),
        (r#"{"fx": "1"}"#, r#"b.json: not the description of a camera: fx is "1", not a number; correct it"#),
        ("[1, 2]", "b.json: not the description of a camera: it is an array, not an object; correct it"),
        (r#"{"fx": 1,"#, "b.json: is not valid JSON: it ends within a value (byte 8); correct it, or give the camera"),
        (r#"{"fx": NaN}"#, "b.json: is not valid JSON: a number is written as inf or nan (byte 7); correct it"),
        (r#"{"width": 1.5}"#, "width is 1.5, not a whole number below 2^32"),
        (r#"{"cx": 1, "ppx": 1}"#, "cx and ppx are the same: leave one of them out"),
        (r#"{"color": 7}"#, "color is 7, not a string"),
        (r#"{"pose": {"a": 1}}"#, r#"pose is {"a":1}, not an array of numbers"#),
        (
            r#"{"fx": 1, "fy": 1, "cx": 1, "cy": 0, "width": 2, "height": 2, "depth_scale": 1000, "pose": [1]}"#,
            "1 numbers",
        ),
    ] {
        fs::write(&sidecar, text).unwrap();
        let line = refused(&at, none());
        assert!(line.contains(what), "{line}");
    }
    fs::remove_file(sidecar).unwrap();
    assert!(refused(&at, none()).contains("nothing says the intrinsics of the camera"));
}
