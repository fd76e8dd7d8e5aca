//! What viewers stumble over is renamed, or told with its count, before and after a run.

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
        "the attribute \"color\" is called \"color__\": viewers keep data of their own under that name",
    ];
    assert_eq!(told(&stderr), lines);
    lines.iter().for_each(|line| assert!(dry.contains(line), "{dry}"));
    assert_eq!(names(&dir), ["constructor_", "color__", "color_", "quality"]);
    let metadata: serde_json::Value =
        serde_json::from_slice(&std::fs::read(dir.path("out/metadata.json")).unwrap()).unwrap();
    let renamed = json!({ "color__": "color", "constructor_": "constructor" });
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
