//! Text of spreadsheets and other programs, and folders with other files in them.

use serde_json::json;

use crate::support::Dir;

#[test]
fn decimal_commas_convert_to_their_values_and_validate() {
    let dir = Dir::new();
    dir.write("a.xyz", b"345678,123 5432109,456 87,250\n345679,125 5432110,500 88,000\n");
    let ended = dir.succeed(["convert", "a.xyz", "-o", "out"]);
    assert!(ended.stderr().contains("commas are decimal marks, as in 345678,123"), "{}", ended.stderr());
    let bounds = json!([345678.123, 5432109.456, 87.25, 345679.125, 5432110.5, 88.0]);
    assert_eq!(dir.report("out")["inputs"][0]["bounds_measured"], bounds);
    dir.validate("out", &["a.xyz"]);
    let point = dir.run(["validate", "out", "-q", "--against", "a.xyz", "--decimal", "point"]);
    assert_ne!(point.code(), 0, "with decimal points these are other points");
}

#[test]
fn a_comma_that_may_be_both_is_refused_until_it_is_told() {
    let dir = Dir::new();
    dir.write("a.xyz", b"1,234 5,678 87\n1,500 2,500 88\n");
    for command in [&["convert", "a.xyz", "-o", "out"][..], &["info", "a.xyz"]] {
        dir.run(command).failed_with(3, &["a.xyz", "the comma in 1,234 may be a decimal mark", "--decimal comma"]);
    }
    let object = dir.succeed(["info", "a.xyz", "--deep", "--json", "--decimal", "comma"]).stdout();
    let object: serde_json::Value = serde_json::from_str(&object).unwrap();
    assert_eq!(object[0]["measured"]["bounds"]["min"], json!([1.234, 2.5, 87.0]));
    dir.succeed(["convert", "a.xyz", "-o", "out", "-q", "--decimal", "comma"]);
    assert_eq!(dir.run(["validate", "out", "-q", "--decimal", "comma", "--against", "a.xyz"]).code(), 0);
    let ended = dir.run(["convert", "a.xyz", "-o", "out2", "--decimal", "dot"]);
    assert!(ended.code() == 2 && ended.stderr().contains("--decimal"), "{}", ended.stderr());
}

#[test]
fn titles_between_commas_say_that_commas_separate() {
    let dir = Dir::new();
    for (name, text) in [
        ("four.csv", "x,y,z,intensity\n345678,5432109,87,120\n345679,5432110,88,121\n"),
        ("six.csv", "x,y,z,r,g,b\n345678,123,87,10,20,30\n345679,124,88,11,21,31\n"),
    ] {
        dir.write(name, text.as_bytes());
        let object = dir.succeed(["info", name, "--deep", "--json"]).stdout();
        let object: serde_json::Value = serde_json::from_str(&object).unwrap();
        assert_eq!(object[0]["measured"]["bounds"]["min"][2], json!(87.0), "{name}: {object}");
        assert_eq!(object[0]["measured"]["bounds"]["min"][0], json!(345_678.0), "{name}");
    }
}

#[test]
fn a_row_that_contradicts_the_sample_is_an_error() {
    let dir = Dir::new();
    dir.write("a.xyz", (("1 2 3\n").repeat(50_000) + "1,5 2,5 3,5\n").as_bytes());
    dir.run(["convert", "a.xyz", "-o", "out"])
        .failed_with(3, &["\"1,5\" is not a number", "(byte 300000)", "--decimal"]);
    assert_eq!(dir.names(), ["a.xyz"]);
}

#[test]
fn other_files_of_a_folder_are_skipped_listed_and_counted() {
    let dir = Dir::new();
    let grid = b"ncols 2\nnrows 2\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2\n3 4\n";
    dir.write("in/dem.asc", grid);
    dir.write("in/a.xyz", b"1 2 3\n4 5 6\n");
    dir.write("in/weather.csv", b"time,temperature,humidity\n1,20.5,40\n2,21,41\n");
    dir.write("in/readme.txt", b"of 3 lines\n");
    let ended = dir.succeed(["convert", "in", "-o", "out"]);
    assert!(ended.stderr().contains("3 other files skipped, not scans (in/dem.asc, "), "{}", ended.stderr());
    let report = dir.report("out");
    assert_eq!((&report["points"]["read"], &report["other_files"]["count"]), (&json!(2), &json!(3)));
    assert_eq!(report["other_files"]["paths"], json!(["in/dem.asc", "in/readme.txt", "in/weather.csv"]));
    assert_eq!(report["warnings"][0]["kind"], "other_files");
    dir.validate("out", &["in"]);
    assert!(dir.succeed(["info", "in"]).stderr().contains("3 other files skipped"));
    dir.run(["convert", "in/dem.asc", "-o", "out2"]).failed_with(4, &["dem.asc", "Arc/Info ASCII grid", "a raster"]);
    dir.write("well.las", b"~Version Information\n VERS. 2.0\n");
    dir.run(["convert", "well.las", "-o", "out2"]).failed_with(4, &["well.las", "a well log"]);
    dir.run(["convert", "in/weather.csv", "-o", "out2"]).failed_with(3, &["weather.csv", "there is no x"]);
    dir.run(["convert", "in/*.csv", "-o", "out2"]).failed_with(3, &["no scan found", "weather.csv"]);
}

#[test]
fn a_broken_scan_of_a_folder_follows_its_own_policy() {
    let dir = Dir::new();
    dir.write("in/a.xyz", b"1 2 3\n4 5 6\n");
    dir.write("in/b.las", b"<html>not found</html>");
    dir.write("in/notes.txt", b"hello\n");
    dir.run(["convert", "in", "-o", "out"]).failed_with(3, &["b.las"]);
    dir.succeed(["convert", "in", "-o", "out", "-q", "--unreadable", "skip"]);
    let report = dir.report("out");
    assert_eq!((&report["points"]["read"], &report["other_files"]["count"]), (&json!(2), &json!(1)));
}

#[test]
fn tables_with_titles_are_scans_where_they_are_named() {
    let dir = Dir::new();
    dir.write("in/a.xyz", b"1 2 3\n4 5 6\n");
    dir.write("in/control.csv", b"label,x,y,z\nP1,1.5,2.5,3.5\nP2,4.5,5.5,6.5\n");
    dir.write("flat.csv", b"lon,lat\n9.25,48.5\n9.5,48.75\n");
    let read = |input: &str| {
        dir.succeed(["convert", input, "-o", "out", "-q", "--overwrite"]);
        dir.report("out")["inputs"][0]["bounds_measured"].clone()
    };
    assert_eq!(read("in"), json!([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), "labelled points of a folder are no scan");
    assert_eq!(read("in/control.csv"), json!([1.5, 2.5, 3.5, 4.5, 5.5, 6.5]));
    assert_eq!(read("flat.csv"), json!([9.25, 48.5, 0.0, 9.5, 48.75, 0.0]));
}
