//! Faults of the index and of files.

use pointmill_testkit::Random;
use pointmill_validate::{Check, Severity};
use serde_json::json;

use crate::support::{Cloud, STRIDE, assert_only, broken, check};

#[test]
fn counts_that_do_not_add_up() {
    let mut files = Cloud::default().build();
    let leaf = files.some_leaf();
    let count = files.node(&leaf)["count"].as_u64().unwrap();
    files.node(&leaf)["count"] = json!(count - 1);
    let outcome = files.validate();
    assert_only(&outcome, &[(Check::Index, 1)]);
    assert!(outcome.checks[1..].iter().all(|c| c.skipped.is_some()));

    let mut files = Cloud::default().build();
    files.head["points"] = json!(751);
    assert_only(&files.validate(), &[(Check::Index, 1)]);
}

#[test]
fn an_index_that_was_cut_short_or_is_none() {
    let mut files = Cloud::default().build();
    let text = files.text();
    for text in [&text[..text.len() / 2], "{}", ""] {
        files.text = Some(text.to_owned());
        assert_only(&files.validate(), &[(Check::Index, 1)]);
    }
}

#[test]
fn keys_that_are_missing_or_out_of_order() {
    let mut files = Cloud::default().build();
    files.head.remove("projection");
    assert_only(&files.validate(), &[(Check::Index, 1)]);

    let mut files = Cloud::default().build();
    files.text =
        Some(files.text().replacen("\"version\":1,", "", 1).replacen("\"nodes\":", "\"version\":1,\"nodes\":", 1));
    let outcome = files.validate();
    assert_only(&outcome, &[(Check::Index, 1)]);
    assert_eq!(outcome.problems[0].subject, "order of keys");
}

#[test]
fn without_the_lattice_nothing_is_said_about_integers() {
    let mut files = Cloud::default().build();
    files.head.remove("lattice");
    let outcome = files.validate();
    assert_only(&outcome, &[(Check::Index, 1)]);
    assert!(outcome.check(Check::Positions).unwrap().skipped.is_some());
}

#[test]
fn an_origin_that_is_elsewhere_or_broken() {
    let mut files = Cloud::default().build();
    files.head["origin"] = json!([1.0, 2.0, 3.0]);
    let outcome = files.validate();
    assert!(outcome.ok);
    assert_eq!(outcome.problems.iter().map(|p| p.severity).collect::<Vec<_>>(), [Severity::Warning]);
    files.head["origin"] = json!([1.5, 2.0, 3.0]);
    assert_only(&files.validate(), &[(Check::Index, 1)]);
}

#[test]
fn columns_that_are_not_where_they_have_to_be() {
    let mut files = Cloud::default().build();
    // rgba at byte 26 instead of 24: reads nonsense, but nothing overlaps
    files.head["attributes"][6]["offset"] = json!(26);
    let outcome = files.validate();
    assert_eq!(outcome.check(Check::Index).unwrap().found, 1);

    let cloud = Cloud::default();
    let mut files = cloud.build();
    files.head["stride"] = json!(48);
    for bytes in files.leaves.values_mut() {
        *bytes = bytes.chunks_exact(STRIDE).flat_map(|r| [r, &[0; 8]].concat()).collect();
    }
    assert_only(&files.validate(), &[(Check::Index, 1)]);
}

#[test]
fn keys_of_nodes_that_do_not_go_together() {
    let mut files = Cloud::default().build();
    let place = files.nodes.iter().position(|n| n.get("degenerate").is_some()).unwrap();
    files.nodes[place]["split"] = json!(1.0);
    assert_only(&files.validate(), &[(Check::Index, 1)]);

    let mut files = Cloud::default().build();
    files.node("n")["degenerate"] = json!(false);
    assert_only(&files.validate(), &[(Check::Index, 1)]);
}

#[test]
fn leaf_files_that_are_missing_short_or_too_long() {
    let mut files = Cloud::default().build();
    let leaf = files.some_leaf();
    let mut short = files.clone();
    short.leaf(&leaf).truncate(3 * STRIDE - 1);
    let mut long = files.clone();
    long.leaf(&leaf).push(0);
    files.leaves.remove(&leaf);
    for files in [files, short, long] {
        let outcome = files.validate();
        assert_only(&outcome, &[(Check::LeafFiles, 1)]);
        assert_eq!(outcome.problems[0].node.unwrap().to_string(), leaf);
        assert!(outcome.check(Check::Split).unwrap().skipped.is_some());
        assert!(outcome.check(Check::Split).unwrap().checked > 20, "the splits elsewhere are looked at");
    }
}

#[test]
fn a_leaves_bin_that_is_short_missing_or_has_bytes_of_nobody() {
    let cloud = Cloud { packed: true, ..Cloud::default() };
    let mut files = cloud.build();
    let last = files.leaves.keys().next_back().unwrap().clone();
    files.leaf(&last).pop();
    let outcome = files.validate();
    assert_only(&outcome, &[(Check::LeafFiles, 1)]);
    assert_eq!(outcome.problems[0].node.unwrap().to_string(), last);
    files.leaf(&last).extend([0, 0, 0]);
    assert_only(&files.validate(), &[(Check::LeafFiles, 1)]);

    let folder = tempfile::tempdir().unwrap();
    cloud.build().write(folder.path());
    std::fs::remove_file(folder.path().join("leaves.bin")).unwrap();
    assert_only(&check(folder.path()), &[(Check::LeafFiles, 1)]);
}

#[test]
fn ranges_that_overlap() {
    let mut files = Cloud { packed: true, ..Cloud::default() }.build();
    let last = files.paths.last().unwrap().clone();
    let start = files.node(&last)["start"].as_u64().unwrap();
    files.node(&last)["start"] = json!(start - 8);
    assert_eq!(broken(&files.validate()), [(Check::LeafFiles, 1)]);
}

#[test]
fn files_that_belong_to_no_leaf() {
    for (packed, orphan) in [(false, "n0.bin"), (false, "n0110101010101.bin"), (false, "leaves.bin"), (true, "n00.bin")]
    {
        let folder = tempfile::tempdir().unwrap();
        Cloud { packed, ..Cloud::default() }.build().write(folder.path());
        std::fs::write(folder.path().join(orphan), "").unwrap();
        std::fs::write(folder.path().join("notes.txt"), "free").unwrap();
        let outcome = check(folder.path());
        assert_only(&outcome, &[(Check::LeafFiles, 1)]);
        assert_eq!(outcome.problems[0].subject, orphan);
    }
}

/// Whatever the bytes say: an outcome or an error, and time and memory within bounds.
#[test]
fn no_changed_byte_makes_the_validator_panic() {
    let mut random = Random::new(99);
    let points = Cloud::default().points.split_off(690);
    let cloud = Cloud { points, packed: true, ..Cloud::default() };
    let folder = tempfile::tempdir().unwrap();
    cloud.build().write(folder.path());
    let mut faults = 0;
    for file in ["index.json", "leaves.bin"] {
        let path = folder.path().join(file);
        let good = std::fs::read(&path).unwrap();
        for _ in 0..400 {
            let mut bytes = good.clone();
            let at = random.index(bytes.len());
            bytes[at] = match file {
                "index.json" => random.pick(b"0123456789-e.,:[]{}\"nt"),
                _ => random.below(256) as u8,
            };
            std::fs::write(&path, &bytes).unwrap();
            faults += usize::from(!check(folder.path()).ok);
        }
        std::fs::write(&path, &good).unwrap();
    }
    // colours, intensities and times of single points are known to the sources alone
    assert!(faults > 400, "{faults}");
}
