//! What viewers stumble over is renamed, or told with its count, before and after a run.

use pointmill_testkit::las::{Las, Point};
use serde_json::json;

use crate::attributes::{las, ply};
use crate::support::Dir;

/// The lines of a run that warn about an octree, without what they begin with.
fn told(stderr: &str) -> Vec<&str> {
    stderr.lines().filter_map(|line| line.strip_prefix("pointmill: warning: potree2: ")).collect()
}

/// The attributes of an octree beside the position.
fn names(dir: &Dir) -> Vec<String> {
    let dataset = pointmill_format::potree2::Dataset::open(dir.path("out")).unwrap();
    dataset.metadata().attributes.iter().skip(1).map(|a| a.attribute.name.clone()).collect()
}

#[test]
fn names_that_viewers_stumble_over_are_renamed_told_and_known_to_the_validator() {
    let dir = Dir::new();
    let properties =
        ["float x", "float y", "float z", "uchar constructor", "short color", "uchar color_", "float quality"];
    dir.write("a.ply", &ply(&properties, &["0 0 0 1 2 3 4", "1 0 0 5 6 7 8"]));
    let dry = dir.succeed(["convert", "a.ply", "-o", "out", "--dry-run"]).stdout();
    let ended = dir.succeed(["convert", "a.ply", "-o", "out"]);
    let stderr = ended.stderr();
    let lines = [
        "the attribute \"constructor\" is called \"constructor_\": every object of JavaScript has a property of that \
         name, and viewers would load nothing",
        "the attribute \"color\" is called \"color_2\": viewers keep data of their own under that name",
    ];
    assert_eq!(told(&stderr), lines);
    lines.iter().for_each(|line| assert!(dry.contains(line), "{dry}"));
    assert_eq!(names(&dir), ["constructor_", "color_2", "color_", "quality"]);
    let metadata: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.path("out/metadata.json")).unwrap()).unwrap();
    let renamed = json!({ "color_2": "color", "constructor_": "constructor" });
    assert_eq!(metadata["pointmill"]["attributesRenamed"], renamed);
    let output = &dir.report("out")["outputs"][0];
    let first = json!({ "name": "constructor", "stored_as": "constructor_", "why": "java_script" });
    assert_eq!(output["attributes_renamed"][0], first);
    assert_eq!(output["attributes"], json!(["position", "constructor", "color", "color_", "quality"]));
    dir.validate("out", &["a.ply"]);

    // another value of a renamed attribute is found under its name in the source
    dir.write("b.ply", &ply(&properties, &["0 0 0 1 2 3 4", "1 0 0 9 6 7 8"]));
    let found = dir.run(["validate", "out", "--against", "b.ply", "--json"]);
    assert_eq!(found.code(), 7, "{}", found.stderr());
    assert!(found.stdout().contains("constructor of a point"), "{}", found.stdout());
}

#[test]
fn attributes_are_chosen_by_the_names_of_the_inputs_and_other_formats_keep_these() {
    let dir = Dir::new();
    let extras = [("Position", 1, None), ("level of detail", 1, None), ("a<b>", 1, None)];
    dir.write("a.las", &las(3, &extras, |i| vec![i as u8, 2, 3]));
    dir.succeed(["convert", "a.las", "-o", "out", "--attributes", "Position,level of detail,a<b>"]);
    assert_eq!(names(&dir), ["Position_", "level of detail_", "a_b_"]);
    dir.validate("out", &["a.las"]);
    let ended = dir.succeed(["convert", "a.las", "-o", "tree", "--to", "bintree", "--attributes", "Position"]);
    assert!(told(&ended.stderr()).is_empty());
    dir.validate("tree", &["a.las"]);

    // what is constant is recorded under its name in the inputs
    dir.succeed(["convert", "a.las", "-o", "out", "--overwrite", "--attributes", "scene"]);
    assert_eq!(names(&dir), ["Position_"]);
    dir.validate("out", &["a.las"]);
}

/// Points on a line, with these colours in turn.
fn coloured(points: i32, colour: impl Fn(i32) -> [u16; 3]) -> Vec<u8> {
    let point = |i| Point { rgb: colour(i), ..Point::at([10 * i, 0, 0]) };
    Las { offset: [0.0; 3], ..Las::new((0..points).map(point).collect()) }.bytes()
}

/// The colours of an octree, by the x of its points.
fn colours(dir: &Dir) -> Vec<[u16; 3]> {
    let values = crate::attributes::octree_chunks::<u16>(dir, "rgb");
    values.into_iter().map(|(_, rgb)| [rgb[0], rgb[1], rgb[2]]).collect()
}

const DARK: &str = "have 16-bit colour channels of 1 to 255";

#[test]
fn dark_channels_of_deep_colours_are_counted_and_rounded_on_request() {
    let dir = Dir::new();
    // three points of a thousand, one of them with two dark channels
    let colour = |i| match i {
        0 => [1, 127, 40_000],
        1 => [128, 300, 0],
        2 => [600, 600, 255],
        i => [0, 256, 257 + 60 * i as u16],
    };
    dir.write("a.las", &coloured(1000, colour));
    let ended = dir.succeed(["convert", "a.las", "-o", "out"]);
    let line = "3 of 1,000 points (0.30 %) have 16-bit colour channels of 1 to 255: viewers take these for 8 bits and show \
                them too bright; pass --dark-colours round to round them to 0 or 256, or --rgb-depth 8 if they have 8 bits";
    assert_eq!(told(&ended.stderr()), [line]);
    assert_eq!(dir.report("out")["outputs"][0]["details"]["points_with_dark_channels"], 3);
    assert_eq!(colours(&dir)[..3], [colour(0), colour(1), colour(2)]);
    dir.validate("out", &["a.las"]);

    for encoding in ["default", "brotli"] {
        let args = ["convert", "a.las", "-o", "out", "--overwrite", "--dark-colours", "round", "--encoding", encoding];
        let stderr = dir.succeed(args).stderr();
        assert_eq!(told(&stderr).last(), Some(&"rgb, stored as uint16: 4 values are rounded (1 to 255)"), "{stderr}");
        assert!(!stderr.contains(DARK), "{stderr}");
        assert_eq!(colours(&dir)[..4], [[0, 0, 40_000], [256, 300, 0], [600, 600, 256], colour(3)]);
        let changed = &dir.report("out")["outputs"][0]["attributes_changed"][0];
        assert_eq!((&changed["name"], &changed["changed"]["rounded"]), (&json!("rgb"), &json!(4)));
        dir.validate("out", &["a.las"]);
    }
    dir.run(["convert", "a.las", "-o", "b", "--to", "bintree", "--dark-colours", "round"])
        .failed_with(2, &["--dark-colours requires --to potree2"]);
}

#[test]
fn colours_of_eight_bits_and_too_few_dark_channels_are_no_warning() {
    let dir = Dir::new();
    dir.write("eight.las", &coloured(50, |i| [i as u16, 5, 255]));
    let stderr = dir.succeed(["convert", "eight.las", "-o", "out"]).stderr();
    assert!(told(&stderr).is_empty());
    let line = "pointmill: colours of 8 bits in 1 of 1 scan with colour, stored times 257";
    assert!(stderr.lines().any(|l| l == line), "{stderr}");
    dir.write("few.las", &coloured(10_001, |i| if i == 7 { [9, 0, 0] } else { [40_000, 0, 300] }));
    assert!(told(&dir.succeed(["convert", "few.las", "-o", "few"]).stderr()).is_empty());
    assert_eq!(dir.report("few")["outputs"][0]["details"]["points_with_dark_channels"], 1);
    // 16 bits that were stated, though all values are small
    let ended = dir.succeed(["convert", "eight.las", "-o", "stated", "--rgb-depth", "16"]);
    assert!(told(&ended.stderr())[0].starts_with("50 of 50 points (100 %) have 16-bit"), "{}", ended.stderr());
}

#[test]
fn points_that_potree_hides_for_their_returns_are_counted() {
    let dir = Dir::new();
    let las = Las { point_format: 7, offset: [0.0; 3], ..Las::new((0..20).map(|i| Point::at([i, 0, 0])).collect()) };
    let (mut bytes, start, stride) = (las.bytes(), las.header_len(), las.record_len());
    for (point, returns) in [(3, 0x88), (4, 0xF1), (5, 0x71), (6, 0x77)] {
        bytes[start + point * stride + 14] = returns;
    }
    dir.write("a.las", &bytes);
    let ended = dir.succeed(["convert", "a.las", "-o", "out"]);
    let line = "2 of 20 points have a return number or number of returns above 7: Potree does not draw them before \
                viewer.setFilterReturnNumberRange(0, 255) and viewer.setFilterNumberOfReturnsRange(0, 255)";
    assert_eq!(told(&ended.stderr()), [line]);
    assert_eq!(dir.report("out")["outputs"][0]["details"]["points_above_seven_returns"], 2);
    let ended =
        dir.succeed(["convert", "a.las", "-o", "out", "--overwrite", "--attributes", "return number,intensity"]);
    assert!(told(&ended.stderr())[0].starts_with("1 of 20 points "), "{}", ended.stderr());
}

#[test]
fn systems_and_encodings_that_viewers_do_not_show_well_are_told_before_and_after() {
    let dir = Dir::new();
    dir.write("a.las", &coloured(3, |_| [0; 3]));
    let geocentric = "coordinates are geocentric (EPSG:4978 WGS 84): viewers take z, the axis of the Earth, for up, and show \
                      the scene tilted; --reproject EPSG:n to a system in metres or feet gives a scene to look at";
    let degrees = "x and y are degrees (EPSG:4326 WGS 84): viewers draw a degree as long as a unit of height, and show the \
                   scene stretched upwards; --reproject EPSG:n to a system in metres or feet gives a scene to look at";
    let brotli = "three-loader, BA_PointCloud and compute_rasterizer do not read BROTLI";
    for (options, line) in [
        (["--crs", "EPSG:4978"], Some(geocentric)),
        (["--crs", "EPSG:4326"], Some(degrees)),
        (["--crs", "EPSG:32633"], None),
        (["--encoding", "brotli"], Some(brotli)),
    ] {
        let args = [&["convert", "a.las", "-o", "out", "--overwrite"][..], &options].concat();
        assert_eq!(told(&dir.succeed(&args).stderr()), line.as_slice());
        let dry = dir.succeed(args.iter().chain(&["--dry-run"])).stdout();
        assert_eq!(dry.matches("potree2: ").count(), usize::from(line.is_some()), "{dry}");
        assert!(dry.contains(line.unwrap_or_default()), "{dry}");
        let tree = [&args[..], &["--to", "bintree"]].concat();
        if options[0] == "--crs" {
            assert!(told(&dir.succeed(&tree).stderr()).is_empty());
        }
    }
}
