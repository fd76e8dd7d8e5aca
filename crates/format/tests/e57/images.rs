//! Images within a file: what is said of them, and their bytes.

use std::ops::ControlFlow;

use pointmill_format::scan::e57;
use pointmill_format::{Blob, ImageEncoding, ImageKind, ReadError, ScanImage, ScanInfo};
use pointmill_testkit::damage::{mutated, rounds, u64_at};
use pointmill_testkit::reader::check_error;
use pointmill_testkit::{Random, files};

use crate::common::{fixture, repair, replace};

fn info() -> ScanInfo {
    e57::open(files::fixture("e57").join("images.e57")).unwrap().info().clone()
}

fn bytes(path: &std::path::Path, blob: &Blob) -> Result<Vec<u8>, ReadError> {
    let mut out = Vec::new();
    e57::read_blob(path, blob, &mut |bytes| {
        out.extend_from_slice(bytes);
        ControlFlow::Continue(())
    })?;
    Ok(out)
}

#[test]
fn images_are_described_with_kind_size_place_and_geometry() {
    let images = info().images;
    let kinds: Vec<_> = images.iter().map(|i| (i.number, i.kind, i.encoding, i.pixels, i.scan)).collect();
    use ImageEncoding::{Jpeg, Png};
    use ImageKind::{Cylindrical, Pinhole, Spherical, VisualReference};
    let expected = [
        (1, Spherical, Jpeg, [8, 4], Some(1)),
        (1, VisualReference, Png, [2, 2], Some(1)),
        (2, Pinhole, Png, [6, 4], Some(2)),
        (3, Cylindrical, Jpeg, [10, 3], None),
        (4, VisualReference, Jpeg, [1, 1], Some(1)),
    ];
    assert_eq!(kinds, expected);
    let names: Vec<_> = images.iter().map(|i| i.name.as_str()).collect();
    assert_eq!(names, ["Hall pano", "Hall pano", "../../out", "", "Hall"]);
    let turn = std::f64::consts::FRAC_PI_4;
    let pose = images[0].pose.unwrap();
    assert_eq!((pose.translation, images[0].geometry.pixel_size), ([1.5, 2.5, 3.5], Some([turn, turn])));
    // the quaternion is 0.8, 0, 0.36, 0.48
    let first_row = [0.28, -0.768, 0.576];
    assert!(pose.rotation[0].iter().zip(first_row).all(|(a, b)| (a - b).abs() < 1e-12), "{:?}", pose.rotation);
    let pinhole = &images[2].geometry;
    assert_eq!((pinhole.focal_length, pinhole.principal_point), (Some(0.025), Some([2.5, 1.5])));
    assert_eq!((pinhole.pixel_size, pinhole.radius, images[2].mask.is_some()), (Some([1e-5, 2e-5]), None, true));
    let cylinder = &images[3];
    assert_eq!((cylinder.geometry.radius, cylinder.geometry.principal_point), (Some(4.0), Some([0.0, 1.0])));
    assert_eq!(cylinder.pose, None);
    let scans: Vec<_> = info().parts.into_iter().map(|p| (p.name, p.points, p.bounds.is_some())).collect();
    assert_eq!(scans, [("Hall".to_owned(), 4, true), ("Yard".to_owned(), 6, false)]);
}

#[test]
fn the_bytes_of_images_are_those_that_were_stored() {
    let path = files::fixture("e57").join("images.e57");
    let images = info().images;
    let of = |image: &ScanImage| bytes(&path, &image.data).unwrap();
    assert_eq!(of(&images[0]), b"\xff\xd8\xff\xfe\0\npanorama\xff\xd9");
    for (image, png) in [(1, true), (2, true), (3, false), (4, true)] {
        let bytes = of(&images[image]);
        assert_eq!((bytes.len() as u64, bytes.starts_with(b"\x89PNG")), (images[image].data.bytes, png));
    }
    assert!(of(&images[4]).len() > 3000, "it lies over several pages");
    assert!(bytes(&path, &images[2].mask.unwrap()).unwrap().starts_with(b"\x89PNG"));
    let mut calls = 0;
    let stopped = e57::read_blob(&path, &images[4].data, &mut |_| {
        calls += 1;
        ControlFlow::Break(())
    });
    assert!(stopped.is_ok() && calls == 1);
}

#[test]
fn an_image_that_is_not_where_it_should_be_is_told() {
    let image = info().images[4].clone();
    let mut damaged = fixture("images.e57");
    damaged[image.data.byte_offset as usize + 1500] ^= 1;
    let error = bytes(&files::temporary(&damaged), &image.data).unwrap_err().to_string();
    assert!(error.contains("does not match its checksum"), "{error}");
    let path = files::fixture("e57").join("images.e57");
    let far = Blob { byte_offset: 1 << 40, bytes: 10 };
    assert!(bytes(&path, &far).unwrap_err().to_string().contains("an image should be 10 bytes"));
    let long = Blob { bytes: u64::MAX, ..image.data };
    assert!(bytes(&path, &long).is_err());
    // a section of points
    let points = Blob { byte_offset: 48, bytes: 10 };
    let told = bytes(&path, &points).unwrap_err().to_string();
    assert!(told.contains("no image here"), "{told}");
    let mut lost = fixture("images.e57");
    replace(&mut lost, "length=\"", "len=\"");
    let scan = e57::open(files::temporary(&lost)).unwrap();
    assert!(scan.info().warnings.iter().any(|w| w.to_string().contains("has no length")), "{:?}", scan.info().warnings);
}

#[test]
fn damaged_descriptions_give_images_or_an_error() {
    let whole = &fixture("images.e57")[..];
    let xml = u64_at(whole, 24) as usize;
    // anything, and more often where images are said to be
    let places = ["fileOffset=\"", "length=\""].into_iter().flat_map(|name| {
        let found = (xml..whole.len() - name.len()).filter(move |at| whole[*at..].starts_with(name.as_bytes()));
        found.map(move |at| at + name.len()..at + name.len() + 4)
    });
    let ranges: Vec<_> = places.chain([xml..whole.len()]).collect();
    let (path, mut random, mut read) = (files::temporary(b""), Random::new(41), [0; 2]);
    for _ in 0..rounds(500) {
        let mut damaged = mutated(whole, &ranges, &mut random);
        repair(&mut damaged);
        std::fs::write(&path, &damaged).unwrap();
        let Ok(scan) = e57::open(&path).inspect_err(check_error) else { continue };
        for image in &scan.info().images {
            for blob in [Some(image.data), image.mask].into_iter().flatten() {
                match bytes(&path, &blob).inspect_err(check_error) {
                    Ok(bytes) => assert_eq!(bytes.len() as u64, blob.bytes),
                    Err(_) => read[1] += 1,
                }
                read[0] += 1;
            }
        }
    }
    assert!(read[0] > 200 && read[1] > 5, "{read:?}");
}
