//! `extract`: images as they are, a table of places, nothing half-written and nothing outside of the folder.

use std::fs;

use pointmill_testkit::files::fixture_bytes;

use crate::support::Dir;

fn with_fixture(name: &str) -> Dir {
    let dir = Dir::new();
    dir.write("scan.e57", &fixture_bytes(&format!("e57/{name}")));
    dir
}

fn files(dir: &Dir, folder: &str) -> Vec<String> {
    let entries = fs::read_dir(dir.path(folder)).unwrap();
    let mut names: Vec<String> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn images_masks_and_places_are_written() {
    let dir = with_fixture("images.e57");
    let ended = dir.succeed(["extract", "scan.e57", "-o", "out"]);
    assert!(ended.stderr().contains("out: 5 images and 1 mask written; poses.csv has 7 rows"), "{}", ended.stderr());
    assert!(ended.stderr().contains("image 4 is declared as JPEG and is PNG; it is named so"), "{}", ended.stderr());
    let names = [
        "001_Hall_pano_preview.png",
        "001_Hall_pano_spherical.jpg",
        "002_out_pinhole.png",
        "002_out_pinhole_mask.png",
        "003_cylindrical.jpg",
        "004_Hall_preview.png",
        "poses.csv",
    ];
    assert_eq!(files(&dir, "out"), names);
    assert_eq!(dir.names(), ["out", "scan.e57"], "no other folder stays, and no name leads out of it");
    let panorama = fs::read(dir.path("out/001_Hall_pano_spherical.jpg")).unwrap();
    assert_eq!(panorama, b"\xff\xd8\xff\xfe\0\npanorama\xff\xd9");
    let table = fs::read_to_string(dir.path("out/poses.csv")).unwrap();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(
        lines[0],
        "kind,number,name,file,mask,scan,x,y,z,qw,qx,qy,qz,width,height,focal_length,pixel_width,pixel_height,\
         principal_x,principal_y,radius,points"
    );
    assert_eq!(lines[2], "scan,2,Yard,,,2,0,0,0,1,0,0,0,,,,,,,,,6");
    let row: Vec<&str> = lines[1].split(',').collect();
    assert_eq!(row[..9], ["scan", "1", "Hall", "", "", "1", "10", "20", "30"]);
    let turn: Vec<f64> = row[9..13].iter().map(|v| v.parse().unwrap()).collect();
    assert!(turn.iter().zip([0.8, 0.0, 0.36, 0.48]).all(|(a, b)| (a - b).abs() < 1e-12), "{turn:?}");
    assert!(lines[3].starts_with("spherical,1,Hall pano,001_Hall_pano_spherical.jpg,,1,1.5,2.5,3.5,"), "{}", lines[3]);
    assert_eq!(
        lines[5],
        "pinhole,2,../../out,002_out_pinhole.png,002_out_pinhole_mask.png,2,100,200,0,1,0,0,0,6,4,0.025,0.00001,\
         0.00002,2.5,1.5,,"
    );
    assert_eq!(lines[6], "cylindrical,3,,003_cylindrical.jpg,,,,,,,,,,10,3,,0.5,0.25,0,1,4,");
}

#[test]
fn what_is_there_is_replaced_only_if_that_is_asked_for() {
    let dir = with_fixture("images.e57");
    dir.write("out/poses.csv", b"mine");
    dir.write("out/notes.txt", b"mine too");
    dir.run(["extract", "scan.e57", "-o", "out"]).failed_with(2, &["poses.csv", "--overwrite"]);
    assert_eq!(files(&dir, "out"), ["notes.txt", "poses.csv"]);
    assert_eq!(fs::read(dir.path("out/poses.csv")).unwrap(), b"mine");
    dir.succeed(["extract", "scan.e57", "-o", "out", "--overwrite", "-q"]);
    assert!(fs::read_to_string(dir.path("out/poses.csv")).unwrap().starts_with("kind,"));
    assert_eq!(fs::read(dir.path("out/notes.txt")).unwrap(), b"mine too");
    dir.write("file", b"");
    dir.run(["extract", "scan.e57", "-o", "file"]).failed_with(2, &["name a folder"]);
    dir.run(["extract", "scan.e57", "-o", "no/where"]).failed_with(2, &["no such folder"]);
    dir.run(["extract", "none.e57", "-o", "out"]).failed_with(2, &["none.e57", "no such file"]);
}

#[test]
fn an_image_that_cannot_be_read_leaves_nothing_behind_or_is_skipped() {
    let dir = Dir::new();
    let mut bytes = fixture_bytes("e57/images.e57");
    // the last image lies over several pages
    let at = bytes.windows(4).rposition(|w| w == b"\x89PNG").unwrap() + 1500;
    bytes[at] ^= 1;
    dir.write("scan.e57", &bytes);
    let ended = dir.run(["extract", "scan.e57", "-o", "out"]);
    assert_eq!((ended.code(), dir.names()), (3, vec!["scan.e57".to_owned()]), "{}", ended.stderr());
    let ended = dir.succeed(["extract", "scan.e57", "-o", "out", "--unreadable", "skip"]);
    assert!(ended.stderr().contains("image 4 is skipped: "), "{}", ended.stderr());
    let table = fs::read_to_string(dir.path("out/poses.csv")).unwrap();
    assert!(table.contains("visual_reference,4,Hall,,,1,,"), "it has a row all the same: {table}");
}

#[test]
fn files_without_images_give_the_places_of_their_scans() {
    let dir = with_fixture("scans.e57");
    let ended = dir.succeed(["extract", "scan.e57", "-o", "out"]);
    let line = "out: there are no images in the file; poses.csv has 3 rows, one for each scan";
    assert!(ended.stderr().contains(line), "{}", ended.stderr());
    assert_eq!(files(&dir, "out"), ["poses.csv"]);
    dir.write("grid.ptx", &fixture_bytes("rows/two_scans.ptx"));
    dir.succeed(["extract", "grid.ptx", "-o", "places"]);
    let table = fs::read_to_string(dir.path("places/poses.csv")).unwrap();
    assert!(table.lines().nth(1).unwrap().starts_with("scan,1,,,,1,500000,4000000.25,100,"), "{table}");
    dir.write("none.e57", &fixture_bytes("e57/no_scans.e57"));
    dir.succeed(["extract", "none.e57", "-o", "nothing"]);
    assert_eq!(fs::read_to_string(dir.path("nothing/poses.csv")).unwrap().lines().count(), 1);
    dir.write("a.las", &fixture_bytes("las/format0.las"));
    dir.run(["extract", "a.las", "-o", "las"]).failed_with(4, &["no scans or images within it"]);
}

#[test]
fn chosen_scans_bring_their_images_alone() {
    let dir = with_fixture("images.e57");
    dir.succeed(["extract", "scan.e57", "-o", "out", "--scan", "Yard"]);
    assert_eq!(files(&dir, "out"), ["002_out_pinhole.png", "002_out_pinhole_mask.png", "poses.csv"]);
    assert_eq!(fs::read_to_string(dir.path("out/poses.csv")).unwrap().lines().count(), 3);
    dir.run(["extract", "scan.e57", "-o", "x", "--scan", "Barn"])
        .failed_with(2, &["--scan Barn", "1 (Hall), 2 (Yard)"]);
}
