//! Pictures of fixtures as they were looked at, kept as files.
//!
//! Another processor, or another library of functions, may round a sine or a tangent differently by one unit of the last place.
//! Then a point that falls on the edge of two pixels, to 13 digits, moves to the other one. Of 160 × 120 pixels, one that
//! changes altogether, from black to white, is a mean square of 255² / 19,200: 42.8 dB. So a picture may differ from its file by
//! that one pixel, or by several whose colours are more alike, and still has 40 dB; two such pixels have 39.8 dB.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::PathBuf;

use pointmill_render::{Camera, Colour, PointSize, Scene, Shape, Size, Style, View};

const LEAST_DB: f64 = 40.0;

fn fixture(name: &str) -> PathBuf {
    PathBuf::from(format!("{}/../../fixtures/{name}", env!("CARGO_MANIFEST_DIR")))
}

/// Name of the picture, dataset, side, and style.
fn pictures() -> Vec<(&'static str, &'static str, View, Style)> {
    let squares = Style { shape: Shape::Square, size: PointSize::Pixels(7.0), is_filled: false, ..Style::default() };
    vec![
        ("octree", "potree2/default", View::Fit, Style { colour: Colour::Height, ..squares.clone() }),
        (
            "octree-level",
            "potree1/words",
            View::Top,
            Style { colour: Colour::Level, has_boxes: true, ..Style::default() },
        ),
        (
            "bintree",
            "bintree/packed",
            View::South,
            Style { colour: Colour::Level, shape: Shape::Paraboloid, ..squares.clone() },
        ),
        ("batches", "batches/example.qbatch", View::Fit, Style { is_averaged: true, ..squares.clone() }),
        ("aerial", "las/autzen_trim.laz", View::North, Style { eye_dome: 1.0, ..Style::default() }),
        ("aerial-averaged", "las/autzen_trim.laz", View::Top, Style { colour: Colour::Class, ..Style::averaged() }),
        ("scans", "e57/scans.e57", View::East, squares),
    ]
}

fn size() -> Size {
    Size::new(160, 120).unwrap()
}

fn rendered(dataset: &str, view: View, style: &Style) -> pointmill_render::Picture {
    let scene = Scene::open(fixture(dataset)).unwrap();
    let camera: Camera = scene.view(view, size());
    scene.render(&camera, size(), style, u64::MAX, 2).unwrap()
}

fn decoded(path: &PathBuf) -> Vec<u8> {
    let file = BufReader::new(File::open(path).unwrap());
    let mut reader = png::Decoder::new(file).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut pixels).unwrap();
    pixels
}

/// Peak signal to noise, dB.
fn psnr(a: &[u8], b: &[u8]) -> f64 {
    assert_eq!(a.len(), b.len());
    let squares: f64 = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum();
    10.0 * (255.0 * 255.0 * a.len() as f64 / squares).log10()
}

#[test]
fn pictures_are_as_they_were() {
    for (name, dataset, view, style) in pictures() {
        let picture = rendered(dataset, view, &style);
        let db = psnr(picture.rgb.as_flattened(), &decoded(&fixture(&format!("pictures/{name}.png"))));
        assert!(db >= LEAST_DB, "{name}: {db:.1} dB");
    }
}

#[test]
fn the_measure_is_that_of_one_pixel() {
    let (black, mut other) = (vec![0; 160 * 120 * 3], vec![0; 160 * 120 * 3]);
    assert_eq!(psnr(&black, &other), f64::INFINITY);
    other[300..303].fill(255);
    assert!((psnr(&black, &other) - 42.83).abs() < 0.01);
    other[600..603].fill(255);
    assert!(psnr(&black, &other) < LEAST_DB);
}

/// Look at the pictures before they are committed.
#[test]
#[ignore = "writes the files"]
fn write_the_pictures_anew() {
    fs::create_dir_all(fixture("pictures")).unwrap();
    for (name, dataset, view, style) in pictures() {
        let png = rendered(dataset, view, &style).png().unwrap();
        fs::write(fixture(&format!("pictures/{name}.png")), png).unwrap();
    }
}
