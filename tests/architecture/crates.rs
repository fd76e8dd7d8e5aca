//! The arrows between the crates: `pointmill → converter → format ← validate ← pointmill`, and none back.

use std::collections::BTreeSet;
use std::process::Command;

use serde_json::Value;

/// What each crate of the workspace may depend on, for whatever purpose, among the crates of the workspace.
const ALLOWED: [(&str, &[&str]); 10] = [
    (
        "pointmill",
        &[
            "pointmill-converter",
            "pointmill-crs",
            "pointmill-format",
            "pointmill-measure",
            "pointmill-render",
            "pointmill-validate",
            "pointmill-view",
            "pointmill-testkit",
        ],
    ),
    ("pointmill-capi", &["pointmill-format", "pointmill-validate", "pointmill-testkit"]),
    ("pointmill-crs", &["pointmill-format", "pointmill-testkit"]),
    ("pointmill-converter", &["pointmill-format", "pointmill-testkit"]),
    ("pointmill-measure", &["pointmill-format", "pointmill-render", "pointmill-testkit"]),
    ("pointmill-render", &["pointmill-format", "pointmill-testkit"]),
    ("pointmill-validate", &["pointmill-format", "pointmill-testkit"]),
    ("pointmill-view", &["pointmill-format", "pointmill-testkit"]),
    ("pointmill-format", &["pointmill-testkit"]),
    ("pointmill-testkit", &["pointmill-format"]),
];

/// The packages of the workspace, as cargo describes them.
pub(crate) fn packages() -> Vec<Value> {
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    let args = ["metadata", "--format-version", "1", "--no-deps", "--offline", "--manifest-path", manifest];
    let output = Command::new(env!("CARGO")).args(args).output().unwrap();
    let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
    metadata["packages"].as_array().unwrap().clone()
}

fn dependencies(package: &Value) -> BTreeSet<&str> {
    package["dependencies"].as_array().unwrap().iter().map(|d| d["name"].as_str().unwrap()).collect()
}

#[test]
fn crates_depend_in_one_direction() {
    for package in packages() {
        let name = package["name"].as_str().unwrap();
        let Some((_, allowed)) = ALLOWED.iter().find(|(n, _)| *n == name) else { continue };
        for dependency in dependencies(&package).into_iter().filter(|d| d.starts_with("pointmill")) {
            assert!(allowed.contains(&dependency), "{name} must not depend on {dependency}");
        }
    }
}

/// What the tests share is built for tests alone.
#[test]
fn the_testkit_is_a_dependency_of_tests_only() {
    for package in packages() {
        for dependency in package["dependencies"].as_array().unwrap() {
            let is_testkit = dependency["name"] == "pointmill-testkit";
            assert!(!is_testkit || dependency["kind"] == "dev", "{} depends on the testkit", package["name"]);
        }
    }
}

/// A renderer that loads datasets pays for neither threads nor temporary files nor LAZ.
#[test]
fn the_format_crate_stays_light() {
    let packages = packages();
    let format = packages.iter().find(|p| p["name"] == "pointmill-format").unwrap();
    let required = format["dependencies"].as_array().unwrap().iter();
    let required: BTreeSet<&str> = required
        .filter(|d| d["kind"].is_null() && d["optional"] == false)
        .map(|d| d["name"].as_str().unwrap())
        .collect();
    let light = BTreeSet::from(["brotlic", "bytemuck", "serde", "serde_json", "thiserror"]);
    assert!(required.is_subset(&light), "new dependencies of the format crate: {:?}", &required - &light);
}
