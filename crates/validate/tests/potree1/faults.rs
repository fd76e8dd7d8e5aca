//! Faults of the description, the index and the files.

use pointmill_format::NodeKey;
use pointmill_testkit::files::fixture;
use pointmill_validate::{Check, Options, Severity, validate};
use serde_json::json;

use crate::dataset::{Files, STRIDE, good, path};
use crate::support::{assert_only, broken};

#[test]
fn a_good_dataset_has_no_findings() {
    let outcome = good().validate();
    assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
    assert_eq!((outcome.points, outcome.encoding), (6000, Some("bin")));
    assert!(outcome.quality.len() >= 4, "{} levels", outcome.quality.len());
    assert!(outcome.quality.iter().all(|l| l.largest_hole.is_none_or(|h| h <= 2.0)));
    for check in outcome.checks.iter().filter(|c| c.skipped.is_none()) {
        assert!(check.checked > 0, "{} looked at nothing", check.name.name());
    }
    let view = outcome.first_view.unwrap();
    assert_eq!((view.points, view.nodes), (6000, outcome.nodes));
}

#[test]
fn more_points_than_a_node_may_hold() {
    let mut files = good();
    let most = good().validate().quality[0].points;
    assert!((1..6000).contains(&most));
    files.cloud["pointmill"]["maxNodePoints"] = json!(6000);
    let outcome = files.validate();
    assert!(outcome.ok && outcome.check(Check::Coverage).unwrap().skipped.is_some());
    assert!(outcome.quality.iter().any(|level| level.largest_hole.is_some()), "measured all the same");
    files.cloud["pointmill"]["maxNodePoints"] = json!(most - 1);
    let outcome = files.validate();
    assert_eq!(broken(&outcome), [Check::NodeCounts]);
    assert!(outcome.check(Check::NodeCounts).unwrap().found >= 1);
}

#[test]
fn a_description_out_of_range() {
    for (key, value) in [
        ("scale", json!([0.0025, 0.0025, 0.0025])),
        ("tightBoundingBox", json!({ "lx": 0.0 })),
        ("octreeDir", json!("../data")),
        ("spacing", json!(0)),
        ("pointAttributes", json!(["COLOR_PACKED", "POSITION_CARTESIAN", "INTENSITY"])),
    ] {
        let mut files = good();
        files.cloud[key] = value;
        let outcome = files.validate();
        let found = outcome.check(Check::Cloud).unwrap().found;
        assert!(found >= 1, "{key}: {:#?}", outcome.problems);
    }
}

#[test]
fn a_description_that_readers_refuse() {
    let mut files = good();
    files.cloud["version"] = json!("1.3");
    let outcome = files.validate();
    assert_only(&outcome, Check::Cloud, 1);
    assert!(outcome.checks.iter().skip(1).all(|c| c.skipped.is_some()));
    files.text = Some("{ \"version\": \"1.7\", ".into());
    assert!(!files.validate().ok);
}

#[test]
fn javascript_in_the_description_is_read_and_told() {
    let mut files = good();
    files.text = Some(format!("var cloud = {}; // and no more", files.cloud));
    assert_only(&files.validate(), Check::Cloud, 1);
}

#[test]
fn a_projection_that_viewers_stumble_over_is_a_warning() {
    let mut files = good();
    files.cloud["projection"] = json!("EPSG:25832");
    let outcome = files.validate();
    assert!(outcome.ok);
    assert_eq!(outcome.problems.iter().map(|p| p.severity).collect::<Vec<_>>(), [Severity::Warning]);
}

#[test]
fn records_that_no_mask_announces() {
    let mut files = good();
    files.file(NodeKey::ROOT, "hrc").extend([0; 5]);
    assert_only(&files.validate(), Check::IndexFiles, 1);
    let mut files = good();
    files.file(NodeKey::ROOT, "hrc").push(0);
    assert_only(&files.validate(), Check::IndexFiles, 1);
}

#[test]
fn a_border_node_that_is_another_in_its_own_index() {
    let mut files = good();
    let border = files.border();
    files.file(border, "hrc")[1] ^= 1;
    let outcome = files.validate();
    // the record of its own index counts, and is wrong
    let found = [Check::IndexFiles, Check::NodeCounts].map(|check| outcome.check(check).unwrap().found);
    assert_eq!(found, [1, 1], "{:#?}", outcome.problems);
    assert_eq!(outcome.problems[0].node, Some(border.into()));
}

#[test]
fn an_index_that_is_missing() {
    let mut files = good();
    let border = files.border();
    files.others.remove(&path(border, "hrc"));
    let outcome = files.validate();
    let index = outcome.check(Check::IndexFiles).unwrap();
    assert_eq!(index.found, 1, "{:#?}", outcome.problems);
    assert!(outcome.check(Check::NodeFiles).unwrap().found > 0, "nothing leads to the files below");
}

#[test]
fn nodes_without_files_and_files_without_nodes() {
    let mut files = good();
    let (leaf, _) = files.leaf();
    files.others.remove(&path(leaf, "bin"));
    let outcome = files.validate();
    assert_eq!(outcome.check(Check::NodeFiles).unwrap().found, 1, "{:#?}", outcome.problems);
    assert_eq!(outcome.problems[0].node, Some(leaf.into()));
    for stray in ["data/r/r0.txt", "data/r0.bin", "data/r/r0.hrc", "data/r/99/r.bin", "data/r/77/r7777.bin"] {
        let mut files = good();
        files.others.insert(stray.into(), vec![0; STRIDE]);
        assert_only(&files.validate(), Check::NodeFiles, 1);
    }
}

#[test]
fn a_node_that_is_cut_short() {
    let mut files = good();
    let (leaf, _) = files.leaf();
    files.file(leaf, "bin").pop();
    let outcome = files.validate();
    assert_eq!(outcome.check(Check::NodeFiles).unwrap().found, 1, "{:#?}", outcome.problems);
    assert_eq!(outcome.problems[0].found, json!(files.others[&path(leaf, "bin")].len()));
}

#[test]
fn an_empty_node() {
    let mut files = good();
    let (leaf, at) = files.leaf();
    let points = files.file(leaf, "bin").len() / STRIDE;
    files.file(leaf, "bin").clear();
    files.file(NodeKey::ROOT, "hrc")[at + 1..at + 5].fill(0);
    files.cloud["points"] = json!(6000 - points);
    let outcome = files.validate();
    assert_eq!(outcome.check(Check::EmptyNodes).unwrap().found, 1, "{:#?}", outcome.problems);
    assert_eq!(outcome.problems[0].node, Some(leaf.into()));
}

/// What the reference does.
#[test]
fn leaves_that_are_not_counted() {
    let mut files = good();
    let (leaf, at) = files.leaf();
    files.file(NodeKey::ROOT, "hrc")[at + 1..at + 5].fill(0);
    let outcome = files.validate();
    assert_only(&outcome, Check::NodeCounts, 1);
    let points = (files.file(leaf, "bin").len() / STRIDE).to_string();
    assert_eq!((&outcome.problems[0].expected, &outcome.problems[0].found), (&json!(points), &json!("0")));
}

#[test]
fn a_wrong_number_of_points() {
    let mut files = good();
    files.cloud["points"] = json!(5999);
    assert_only(&files.validate(), Check::PointCount, 1);
    files.cloud.as_object_mut().unwrap().remove("points");
    let outcome = files.validate();
    assert!(outcome.ok && outcome.check(Check::PointCount).unwrap().skipped.is_some());
}

/// Only nodes that are LAZ files can fail to decode.
#[test]
fn a_compressed_node_that_does_not_decode() {
    let laz = std::fs::read(fixture("las/format2.laz")).unwrap();
    let mut files = las_nodes(&laz, "LAZ");
    let whole = files.validate();
    assert_eq!(whole.check(Check::Payloads).unwrap().found, 0, "{:#?}", whole.problems);
    // the header says that there is one point more
    files.others.get_mut("data/r/r.laz").unwrap()[107] += 1;
    let outcome = files.validate();
    assert_eq!(outcome.check(Check::Payloads).unwrap().found, 1, "{:#?}", outcome.problems);
}

/// A root alone.
fn las_nodes(bytes: &[u8], word: &str) -> Files {
    let mut files = good();
    files.cloud["pointAttributes"] = json!(word);
    files.cloud.as_object_mut().unwrap().remove("pointmill");
    files.others = [
        (format!("data/r/r.{}", word.to_lowercase()), bytes.to_vec()),
        ("data/r/r.hrc".to_owned(), vec![0, 0, 0, 0, 0]),
    ]
    .into();
    files
}

#[test]
fn a_list_of_nodes_is_checked_like_an_index() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(fixture("potree1/flat/cloud.js")).unwrap();
    let write = |text: &str| {
        for entry in std::fs::read_dir(fixture("potree1/flat/data")).unwrap() {
            let path = entry.unwrap().path();
            std::fs::create_dir_all(folder.path().join("data")).unwrap();
            std::fs::copy(&path, folder.path().join("data").join(path.file_name().unwrap())).unwrap();
        }
        std::fs::write(folder.path().join("cloud.js"), text).unwrap();
        validate(folder.path(), &Options::default(), &|_| {}).unwrap()
    };
    let outcome = write(&text);
    // it is JavaScript, and so few points cover nothing
    assert_eq!(broken(&outcome), [Check::Cloud, Check::Coverage], "{:#?}", outcome.problems);
    assert_eq!((outcome.nodes, outcome.points), (7, 13));
    let wrong = write(&text.replace("\"r7\",\n\t\t\t2", "\"r7\",\n\t\t\t3"));
    assert_eq!(wrong.check(Check::NodeCounts).unwrap().found, 1, "{:#?}", wrong.problems);
}
