//! `validate` finds out what a dataset is.

use std::fs;

use pointmill_testkit::files::{dataset, fixture};

use crate::support::Dir;

#[test]
fn a_binary_tree_is_found_by_its_index_and_a_leaf_that_is_missing_is_named() {
    let dir = Dir::new();
    for (name, bytes) in dataset(&fixture("bintree/files")) {
        dir.write(&format!("tree/{name}"), &bytes);
    }
    for path in ["tree", "tree/index.json"] {
        let ended = dir.succeed(["validate", path]);
        assert!(ended.stdout().contains("bintree files, 17 points in 15 nodes"), "{}", ended.stdout());
    }
    fs::remove_file(dir.path("tree/n011.bin")).unwrap();
    dir.run(["validate", "tree"]).failed_with(7, &["leaf-files"]);
    dir.run(["validate", "tree/n00.bin"]).failed_with(2, &["index.json", "metadata.json"]);
}
