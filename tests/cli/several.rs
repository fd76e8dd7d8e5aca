//! Several formats from one read.

use pointmill_testkit::las::Las;

use crate::support::Dir;

#[test]
fn each_format_has_its_folder_and_one_command_validates_and_tells_of_all() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(3_000, 1).bytes());
    let formats = ["--to", "potree2", "--to", "bintree", "--to", "batches"];
    dir.succeed(["convert", "a.las", "-o", "out"].into_iter().chain(formats));
    for file in ["potree2/metadata.json", "bintree/index.json", "batches/points.qbatch", "report.json"] {
        assert!(dir.path("out").join(file).is_file(), "{file}");
    }
    let ended = dir.succeed(["validate", "out", "--against", "a.las"]).stdout();
    for format in ["potree2", "bintree", "batches"] {
        assert!(ended.contains(&format!("out/{format}")), "{ended}");
    }
    let ended = dir.succeed(["info", "out"]).stdout();
    assert!(
        ended.contains("Potree 2.0") && ended.contains("mean-split") && ended.contains("quantised batches"),
        "{ended}"
    );
    let all: serde_json::Value = serde_json::from_str(&dir.succeed(["validate", "out", "--json"]).stdout()).unwrap();
    assert_eq!((&all["ok"], all["datasets"].as_array().map(Vec::len)), (&true.into(), Some(3)));

    // A fault in one of them is found, and the others are reported all the same.
    std::fs::remove_file(dir.path("out").join("bintree/n.bin")).unwrap();
    let ended = dir.run(["validate", "out"]);
    assert!(ended.stdout().contains("out/batches"));
    ended.failed_with(7, &["out/bintree"]);
    // What a conversion to several formats made may be replaced, by one of another kind too.
    dir.succeed(["convert", "a.las", "-o", "out", "--overwrite", "--to", "bintree"]);
    dir.succeed(["validate", "out", "--against", "a.las"]);
    dir.succeed(["convert", "a.las", "-o", "out", "--overwrite", "--to", "batches"]);
    dir.succeed(["convert", "a.las", "-o", "out", "--overwrite"]);
}

#[test]
fn options_of_a_format_that_is_not_made_and_formats_named_twice_are_mistakes() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(10, 1).bytes());
    dir.run(["convert", "a.las", "-o", "out", "--capacity", "10"]).failed_with(2, &["--capacity", "bintree"]);
    dir.run(["convert", "a.las", "-o", "out", "--planes", "20"]).failed_with(2, &["--planes", "batches"]);
    let twice = ["convert", "a.las", "-o", "out", "--to", "bintree", "--to", "bintree"];
    dir.run(twice).failed_with(2, &["--to", "twice"]);
    dir.run(["convert", "a.las", "-o", "out", "--to", "bintree", "--duplicates", "drop"])
        .failed_with(4, &["--duplicates drop", "for octrees only"]);
}
