//! Depth maps: single ones and folders with a trajectory, converted and compared; every kind of bad input is one line.

use std::fs;
use std::path::Path;

use pointmill_testkit::files::{entries, fixture, fixture_bytes};
use serde_json::Value;

use crate::support::Dir;

const CAMERA: [&str; 4] = ["--intrinsics", "26.25,26,15.75,11.5,32,24", "--depth-scale", "5000"];
const MIDDLE: &str = "tum/depth/1305031102.194330.png";

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in entries(from) {
        let target = to.join(entry.file_name().unwrap());
        if entry.is_dir() {
            copy(&entry, &target);
        } else {
            fs::copy(&entry, target).unwrap();
        }
    }
}

/// A folder with the sequence `tum`, and the depth map `single.png` with its files.
fn dir() -> Dir {
    let dir = Dir::new();
    copy(&fixture("depth/tum"), &dir.path("tum"));
    for name in ["single.png", "single.json", "single_colour.png"] {
        dir.write(name, &fixture_bytes(&format!("depth/{name}")));
    }
    dir
}

fn with<'a>(args: &[&'a str]) -> Vec<&'a str> {
    [args, &CAMERA[..]].concat()
}

#[test]
fn a_sequence_is_one_scan_in_every_format_and_validates_against_its_frames() {
    let dir = dir();
    for to in ["potree2", "potree1", "bintree", "batches", "copc"] {
        dir.succeed(with(&["convert", "tum", "-o", to, "--to", to, "--attributes", "all"]));
        assert_eq!(dir.report(to)["points"]["kept"], 2142, "{to}");
        dir.succeed(with(&["validate", to, "-q", "--against", "tum"]));
    }
    let more = ["--depth-normals", "--depth-filter", "median:3,bilateral:5,0.03", "--depth-range", "1..2"];
    dir.succeed([&with(&["convert", "tum", "-o", "near"])[..], &more].concat());
    dir.succeed([&with(&["validate", "near", "-q", "--against", "tum"])[..], &more].concat());
    dir.run(with(&["validate", "near", "-q", "--against", "tum"])).failed_with(7, &[]);
    let report = dir.report("near");
    assert!(report["points"]["kept"].as_u64().unwrap() < 2142, "a range drops points");
}

#[test]
fn frames_are_chosen_and_described() {
    let dir = dir();
    dir.succeed(with(&["convert", "tum", "-o", "out", "--scan", "2", "--scan", "1305031102.226738"]));
    assert_eq!(dir.report("out")["points"]["kept"], 707 + 719);
    dir.run(with(&["convert", "tum", "-o", "x", "--scan", "4"])).failed_with(2, &["--scan 4", "1 (1305031102.160407)"]);
    let text = dir.succeed(with(&["info", "tum"])).stdout();
    for line in [
        "3 depth maps with a trajectory, 32 × 24 pixels, fx 26.25 fy 26 cx 15.75 cy 11.5, 5000 units a metre",
        "2: 1305031102.194330, 707 points, at 2.5 -0.25 0.75, turned by 40° about 0.2673 0.5345 0.8018",
    ] {
        assert!(text.contains(line), "{line} is not in {text}");
    }
    let json: Value = serde_json::from_str(&dir.succeed(["info", "--json", "single.png", "--deep"]).stdout()).unwrap();
    assert_eq!(json[0]["measured"]["points"], 710);
    assert_eq!(json[0]["scans"][0]["translation"], serde_json::json!([100.5, 200.25, -3.0]));
}

#[test]
fn a_folder_has_depth_maps_that_are_described_and_sequences_and_no_colour_pictures() {
    let dir = dir();
    copy(&fixture("depth/tum/depth"), &dir.path("bare"));
    let ended = dir.succeed(with(&["convert", ".", "-o", "../out", "--outliers", "keep", "--dry-run"]));
    assert!(
        ended.stdout().contains("2 scans") || ended.stderr().contains("2 scans"),
        "{}{}",
        ended.stdout(),
        ended.stderr()
    );
    // without a trajectory, and without files that describe their camera, pictures are pictures
    dir.run(["convert", "bare", "-o", "out"]).failed_with(3, &["no scan found", "3 other files skipped"]);
    dir.run(["convert", "single_colour.png", "-o", "out"])
        .failed_with(4, &["a PNG picture, and no depth map (16-bit grey)"]);
    assert!(!dir.path("out").exists());
}

#[test]
fn options_of_the_camera_stand_in_for_files() {
    let dir = dir();
    fs::remove_file(dir.path("single.json")).unwrap();
    let pose = "1 0 0 5, 0 1 0 6, 0 0 1 7, 0 0 0 1";
    dir.write("pose.txt", pose.replace(',', "\n").as_bytes());
    for (to, pose) in [("typed", pose), ("file", "pose.txt")] {
        let camera = ["--intrinsics", "26.25,26,15.75,11.5", "--depth-scale", "1000"];
        dir.succeed([&["convert", "single.png", "-o", to, "--pose", pose], &camera[..]].concat());
        dir.succeed([&["validate", to, "-q", "--against", "single.png", "--pose", pose], &camera[..]].concat());
        dir.run([&["validate", to, "-q", "--against", "single.png"], &camera[..]].concat()).failed_with(7, &[]);
    }
    let bytes = |to: &str| fs::read(dir.path(to).join("octree.bin")).unwrap();
    assert_eq!(bytes("typed"), bytes("file"));
}

#[test]
fn options_that_no_input_can_follow_are_usage_errors() {
    let dir = dir();
    dir.write("a.xyz", b"1 2 3\n4 5 6\n");
    for option in [&["--depth-normals"][..], &["--depth-scale", "1000"], &["--pose", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"]]
    {
        for command in
            [&["convert", "a.xyz", "-o", "out"][..], &["info", "a.xyz"], &["preview", "a.xyz", "-o", "a.png"]]
        {
            let args = [command, option].concat();
            dir.run(args).failed_with(2, &[option[0], "no input is a depth map"]);
        }
    }
    let pose = ["--pose", "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"];
    dir.run([&with(&["convert", "tum", "-o", "out"])[..], &pose].concat())
        .failed_with(2, &["--pose: tum has its poses in its trajectory; --transform moves its points"]);
    let colours = ["--depth-colours", "single_colour.png"];
    for inputs in [&["tum"][..], &["single.png", "a.png"]] {
        dir.write("a.png", &fixture_bytes("depth/single.png"));
        dir.run([&with(&["convert", "-o", "out"])[..], inputs, &colours].concat())
            .failed_with(2, &["--depth-colours: a picture has the colours of one depth map"]);
    }
    dir.run(["validate", "out", "--depth-normals"]).failed_with(2, &["--depth-normals requires --against"]);
    for (option, value) in [
        ("--intrinsics", "1,2,3"),
        ("--depth-scale", "0.001"),
        ("--pose", "1 2 3"),
        ("--depth-range", "5..1"),
        ("--depth-filter", "median:4"),
    ] {
        dir.run(["convert", "single.png", "-o", "out", option, value]).failed_with(2, &[option]);
    }
}

#[test]
fn bad_depth_maps_are_one_line_with_exit_code_3() {
    type Change = fn(&Dir);
    let cases: [(&str, &[&str], Change, &str); 9] = [
        (
            "tum",
            &[],
            |_| {},
            "tum: nothing says the intrinsics of the camera; describe the camera in a JSON file beside it, or with --intrinsics and --depth-scale",
        ),
        (
            "tum",
            &["--intrinsics", "525,525,319.5,239.5", "--depth-scale", "5000"],
            |_| {},
            "the centre 319.5 239.5 of the intrinsics is far from that of the picture of 32 × 24 pixels",
        ),
        (
            "single.png",
            &["--intrinsics", "1,1,5,5,640,480"],
            |_| {},
            "single.png: the picture has 32 × 24 pixels, the intrinsics are those of 640 × 480",
        ),
        (
            "single.png",
            &[],
            |dir| drop(dir.write("single.png", &fixture_bytes("depth/single_colour.png"))),
            "single.png: a PNG picture of 8-bit colour; a depth map has 16-bit grey",
        ),
        (
            "single.png",
            &[],
            |dir| drop(dir.write("single_colour.png", &picture([8, 8]))),
            "single_colour.png: the colour picture has 8 × 8 pixels, the depth map 32 × 24",
        ),
        ("single.png", &["--depth-range", "50..60"], |_| {}, "single.png: no pixel has a depth of 50 to 60 m"),
        (
            "single.png",
            &[],
            |dir| drop(dir.write("single.png", &picture([32, 24]))),
            "single.png: no pixel has a depth: all are 0",
        ),
        (
            "single.png",
            &[],
            |dir| drop(dir.write("single.png", &fixture_bytes("depth/single.png")[..300])),
            "single.png: the picture ends before its last pixel",
        ),
        (
            "tum",
            &CAMERA,
            |dir| drop(dir.write("tum/groundtruth.txt", b"1 2 3\n")),
            "groundtruth.txt: expected the 8 numbers timestamp tx ty tz qx qy qz qw (byte 0)",
        ),
    ];
    for (input, args, change, line) in cases {
        let dir = dir();
        change(&dir);
        let args = [&["convert", input, "-o", "out"][..], args].concat();
        dir.run(args).failed_with(3, &[line]);
        assert!(!dir.path("out").exists(), "{line}");
    }
}

#[test]
fn a_frame_that_is_missing_or_has_no_pose_ends_the_run_or_is_skipped() {
    for (change, line) in [
        (
            (|dir| fs::remove_file(dir.path(MIDDLE)).unwrap()) as fn(&Dir),
            "1305031102.194330.png: no such picture; copy the file again, or pass --unreadable skip to convert the rest",
        ),
        (
            |dir| {
                let path = dir.path("tum/groundtruth.txt");
                let text = fs::read_to_string(&path).unwrap().replace("1305031102.1903", "1305031102.1603");
                fs::write(path, text).unwrap();
            },
            "groundtruth.txt: no pose for 1305031102.194330: the nearest is 0.028 s away, more than 0.02 s",
        ),
    ] {
        let dir = dir();
        change(&dir);
        dir.run(with(&["convert", "tum", "-o", "out"])).failed_with(3, &[line]);
        assert!(!dir.path("out").exists());
        let ended = dir.succeed(with(&["convert", "tum", "-o", "out", "--unreadable", "skip"]));
        assert!(ended.stderr().contains("1 of 3 depth maps cannot be read, the first: "), "{}", ended.stderr());
        assert_eq!(dir.report("out")["points"]["kept"], 716 + 719, "{line}");
        let ended = dir.run(with(&["info", "tum"]));
        assert!(ended.stdout().contains("1 of 3 depth maps cannot be read"), "{}", ended.stdout());
    }
}

#[test]
fn advice_about_a_bad_frame_names_options_that_the_command_has() {
    let dir = dir();
    dir.succeed(with(&["convert", "tum", "-o", "out"]));
    fs::remove_file(dir.path(MIDDLE)).unwrap();
    dir.succeed(with(&["job", "plan", "--job", "job", "tum", "-o", "out2"]));
    let skip = "1305031102.194330.png: no such picture; copy the file again, or pass --unreadable skip to";
    let taken = "(with 'pointmill convert', whose dataset this command takes, too)";
    for (args, line) in [
        (with(&["convert", "tum", "-o", "out3"]), format!("{skip} convert the rest")),
        (with(&["export", "tum", "-o", "out.las"]), format!("{skip} export the rest")),
        (with(&["validate", "out", "--against", "tum"]), "no such picture; copy the file again".to_owned()),
        (with(&["preview", "tum", "-o", "a.png"]), format!("{skip} convert the rest {taken}")),
        (with(&["view", "tum", "--no-open"]), format!("{skip} convert the rest {taken}")),
        (with(&["info", "tum", "--deep"]), format!("{skip} convert the rest (with 'pointmill convert')")),
        (
            vec!["job", "run", "job", "--share", "1/1"],
            format!("{skip} convert the rest (in a new 'pointmill job plan')"),
        ),
    ] {
        let ended = dir.run(args);
        ended.failed_with(3, &[]);
        assert!(ended.stderr().trim_end().ends_with(&line), "{line}: {}", ended.stderr());
    }
    for file in ["out3", "out.las", "a.png"] {
        assert!(!dir.path(file).exists(), "{file}");
    }
}

#[test]
fn a_picture_that_was_cut_within_its_header_is_broken_and_no_other_file() {
    let dir = dir();
    let whole = fixture_bytes("depth/single.png");
    for cut in [1, 8, 20, 25, 26, 32, 33] {
        dir.write("single.png", &whole[..cut]);
        for input in ["single.png", "."] {
            dir.run(with(&["convert", input, "-o", "../out", "--dry-run"]))
                .failed_with(3, &["single.png: the picture ends before its last pixel (byte "]);
        }
    }
    fs::remove_file(dir.path("single.json")).unwrap();
    dir.write("single.png", &whole[..20]);
    dir.run(["convert", "single.png", "-o", "out"]).failed_with(3, &["ends before its last pixel", "(byte 20)"]);
    assert_eq!(dir.names(), ["single.png", "single_colour.png", "tum"]);
}

/// A picture of 16-bit grey without depth.
fn picture([width, height]: [u32; 2]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Sixteen);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&vec![0; width as usize * height as usize * 2]).unwrap();
    drop(writer);
    bytes
}
