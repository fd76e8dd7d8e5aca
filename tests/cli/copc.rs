//! COPC files: scans that are octrees, too.

use pointmill_testkit::damage::put;
use pointmill_testkit::files::{fixture, fixture_bytes};
use pointmill_testkit::las::{Las, Point};
use serde_json::{Value, json};

use crate::support::Dir;

#[test]
fn info_tells_the_octree_of_a_copc_file_beside_the_scan() {
    let dir = Dir::new();
    let path = fixture("copc/pages.copc.laz");
    let text = dir.succeed(["info", path.to_str().unwrap()]).stdout();
    for words in [
        "COPC, LAZ 1.4, point format 7",
        "octree        7 nodes\n",
        "spacing       0.5 at the root, halved per level",
        "levels        0: 7 points in 1 node\n",
        "1: 4 points in 3 nodes\n",
        "4: 2 points in 1 node\n",
    ] {
        assert!(text.contains(words), "{words} is not in {text}");
    }
    let ended = dir.succeed(["info", "--json", path.to_str().unwrap()]);
    let octree = serde_json::from_str::<Value>(&ended.stdout()).unwrap()[0]["octree"].take();
    assert_eq!((&octree["nodes"], &octree["points"]), (&json!(7), &json!(22)));
    assert_eq!(octree["points_per_level"], json!([7, 4, 4, 5, 2]));
    assert_eq!(octree["nodes_per_level"], json!([1, 3, 1, 1, 1]));
    assert_eq!((&octree["spacing"], &octree["levels"]), (&json!(0.5), &json!(5)));
    assert_eq!(octree["cube"]["max"], json!([500_016.0, 4_000_016.0, -16.0]));
    let plain = fixture("las/format7.laz");
    let text = dir.succeed(["info", plain.to_str().unwrap()]).stdout();
    assert!(!text.contains("octree"), "{text}");
}

#[test]
fn a_broken_hierarchy_is_an_error_of_info_and_no_obstacle_to_reading_the_scan() {
    let dir = Dir::new();
    let mut bytes = fixture_bytes("copc/pages.copc.laz");
    // the page of r0 is beyond the end
    put(&mut bytes, 2870 + 64 + 16, &1_000_000u64.to_le_bytes());
    dir.write("broken.copc.laz", &bytes);
    let ended = dir.run(["info", "broken.copc.laz"]);
    assert_eq!(ended.code(), 3);
    assert!(ended.stdout().contains("COPC, LAZ 1.4, point format 7") && !ended.stdout().contains("octree"));
    let line = ended.stderr();
    assert!(
        line.contains("the hierarchy page of node r0 is said to have 64 bytes that are not in the file")
            && line.trim_end().lines().count() == 1,
        "{line}"
    );
    dir.succeed(["convert", "broken.copc.laz", "-o", "out", "-q"]);
    assert_eq!(dir.report("out")["outputs"][0]["points"], 22);
}

#[test]
fn a_copc_file_is_validated_by_its_content_also_against_itself_as_a_scan() {
    let dir = Dir::new();
    let bytes = fixture_bytes("copc/pages.copc.laz");
    dir.write("tile.laz", &bytes);
    let text = dir.succeed(["validate", "tile.laz", "--against", "tile.laz"]).stdout();
    for words in ["tile.laz: copc laz, 22 points in 7 nodes", "ok       chunks", "1 scan: 22 points expected, 22 found"]
    {
        assert!(text.contains(words), "{words} is not in {text}");
    }
    let ended = dir.succeed(["validate", "tile.laz", "--fast", "--json"]);
    let outcome: Value = serde_json::from_str(&ended.stdout()).unwrap();
    assert_eq!((&outcome["format"], &outcome["points"], &outcome["nodes"]), (&json!("copc"), &json!(22), &json!(7)));
    assert_eq!(outcome["checks"].as_array().unwrap().len(), 19);

    let mut broken = bytes;
    // the header counts another point
    put(&mut broken, 247, &23u64.to_le_bytes());
    dir.write("broken.copc.laz", &broken);
    let ended = dir.run(["validate", "broken.copc.laz", "-q"]);
    assert_eq!(ended.code(), 7);
    assert!(ended.stdout().contains("point-count: points: expected 22, found 23"), "{}", ended.stdout());
    dir.write("none.copc.laz", b"LASF");
    let ended = dir.run(["validate", "none.copc.laz"]);
    assert_eq!(ended.code(), 7);
    assert!(ended.stdout().contains("bytes of the file"), "{}", ended.stdout());
}

#[test]
fn a_file_has_wkt_or_says_that_it_has_none_and_is_an_input_like_others() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(500, 1).bytes());
    let named = dir.succeed(["convert", "a.las", "-o", "named", "--to", "copc", "--crs", "EPSG:25832"]);
    assert!(!named.stderr().contains("not written"), "{}", named.stderr());
    let told = dir.succeed(["info", "named"]).stdout();
    assert!(told.contains("EPSG:25832"), "{told}");
    let unknown =
        dir.succeed(["convert", "a.las", "-o", "unknown", "--to", "copc", "--crs", "+proj=utm +zone=32 +datum=WGS84"]);
    assert!(unknown.stderr().contains(") is not written"), "{}", unknown.stderr());
    // the report beside it is no file that was left out
    let again = dir.succeed(["convert", "named", "-o", "again"]);
    assert!(!again.stderr().contains("skipped"), "{}", again.stderr());
    dir.succeed(["validate", "again", "--against", "named", "-q"]);
}

#[test]
fn an_export_is_not_called_copc() {
    let dir = Dir::new();
    dir.write("in.las", &Las::new(vec![Point::numbered(0, [1, 2, 3])]).bytes());
    for name in ["x.copc.laz", "x.COPC.las"] {
        dir.run(["export", "in.las", "-o", name]).failed_with(2, &[name, "--to copc"]);
        assert!(!dir.path(name).exists());
    }
    dir.succeed(["export", "in.las", "-o", "copc.laz"]);
}

#[test]
fn nothing_is_put_into_a_dataset_that_is_read() {
    let dir = Dir::new();
    dir.write("in.las", &Las::new(vec![Point::numbered(0, [1, 2, 3])]).bytes());
    dir.succeed(["convert", "in.las", "-o", "octree"]);
    dir.run(["convert", "octree", "-o", "octree/again"]).failed_with(2, &["inside of the input octree"]);
    assert!(!dir.path("octree/again").exists());
    dir.validate("octree", &["in.las"]);
}
