//! Potree 1.x datasets of other programs: described and validated.

use std::fs;
use std::path::Path;

use pointmill_testkit::files::{corpus, fixture};
use serde_json::{Value, json};

use crate::support::Dir;

fn info(dir: &Dir, path: &Path) -> Value {
    let json = dir.succeed(["info", path.to_str().unwrap(), "--json"]).stdout();
    serde_json::from_str::<Value>(&json).unwrap()[0].clone()
}

#[test]
fn every_layout_is_described_by_what_its_files_hold() {
    let dir = Dir::new();
    for (layout, format, wrong) in [("words", "Potree 1.7", 2), ("objects", "Potree 1.8", 0), ("flat", "Potree 1.4", 0)]
    {
        let object = info(&dir, &fixture(&format!("potree1/{layout}")));
        assert_eq!((&object["format"], &object["kind"]), (&json!(format), &json!("dataset")), "{layout}");
        assert_eq!((&object["points"], &object["nodes"], &object["levels"]), (&json!(13), &json!(7), &json!(6)));
        assert_eq!(object["points_per_level"], json!([3, 3, 1, 1, 1, 4]), "{layout}");
        assert_eq!(object["nodes_counted_wrong"], json!(wrong), "{layout}");
    }
    let text = dir.succeed(["info", fixture("potree1/words/cloud.js").to_str().unwrap()]).stdout();
    assert!(text.contains("wrong about 2 nodes of 7: it counts 7 points"), "{text}");
}

#[test]
fn the_lion_is_described_and_sound() {
    let Some(lion) = corpus("potree1/lion_takanawa") else { return };
    let dir = Dir::new();
    let object = info(&dir, &lion);
    assert_eq!((&object["points"], &object["nodes"]), (&json!(272_768), &json!(167)));
    assert_eq!(object["points_per_level"], json!([3751, 14_314, 54_281, 200_422]));
    dir.succeed(["validate", lion.to_str().unwrap(), "-q"]);
}

#[test]
fn wrong_counts_and_missing_nodes_are_findings_and_errors() {
    let dir = Dir::new();
    let words = fixture("potree1/words");
    dir.run(["validate", words.to_str().unwrap(), "-q"]).failed_with(7, &["node-counts"]);
    for (name, bytes) in [("cloud.js", "cloud.js"), ("data/r/r.hrc", "data/r/r.hrc"), ("data/r/r.bin", "data/r/r.bin")]
    {
        let to = dir.path(&format!("part/{name}"));
        fs::create_dir_all(to.parent().unwrap()).unwrap();
        fs::copy(words.join(bytes), to).unwrap();
    }
    dir.run(["info", "part"]).failed_with(3, &["r00.hrc", "is missing", "copied in part"]);
    dir.run(["validate", "part", "-q"]).failed_with(7, &["index-files", "node-files"]);
    let text = fs::read_to_string(words.join("cloud.js")).unwrap();
    fs::write(dir.path("part/cloud.js"), text.replace("\"data\"", "\"../data\"")).unwrap();
    dir.run(["info", "part"]).failed_with(3, &["cloud.js", "octreeDir is \"../data\""]);
    fs::write(dir.path("part/cloud.js"), text.replace("\"1.7\"", "\"1.2\"")).unwrap();
    dir.run(["info", "part"]).failed_with(4, &["cloud.js", "version \"1.2\""]);
}
