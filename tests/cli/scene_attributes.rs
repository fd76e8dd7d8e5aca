//! `--attributes scene`: what is constant or follows from another attribute is not stored, and comes back.

use std::collections::BTreeMap;
use std::fs;

use pointmill_testkit::las::{Las, Point};
use serde_json::{Value, json};

use crate::support::Dir;

/// Points whose user data follow from their source, the scan angles from the user data; the return numbers are constant, the
/// times and the colours are what they are.
fn scan(points: u16) -> Vec<u8> {
    let of = |i: u16| {
        let (source, n) = (11 + i % 3, i32::from(i));
        Point {
            intensity: (n * 7 % 1000) as u16,
            class: [2, 5, 6, 9][usize::from(i % 4)],
            user_data: [7, 9, 40][usize::from(i % 3)],
            scan_angle: [-4, -4, 12][usize::from(i % 3)],
            source,
            gps_time: f64::from(i) * 0.125,
            rgb: [i, i / 3, 65_535 - i],
            ..Point::at([n % 50 * 100, n / 50 * 100, n * 13 % 997])
        }
    };
    Las::new((0..points).map(of).collect()).bytes()
}

/// The columns of a text with titles, rows in order of the time.
fn columns(dir: &Dir, input: &str, out: &str) -> BTreeMap<String, Vec<String>> {
    dir.succeed(["export", input, "-o", out, "-q"]);
    let text = fs::read_to_string(dir.path(out)).unwrap();
    let mut rows = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let titles = rows.next().unwrap();
    let time = titles.iter().position(|title| title.contains("time")).unwrap();
    let mut rows: Vec<Vec<String>> = rows.collect();
    rows.sort_by(|a, b| a[time].parse::<f64>().unwrap().total_cmp(&b[time].parse::<f64>().unwrap()));
    let column = |i: usize| rows.iter().map(|row| row[i].clone()).collect();
    titles.iter().enumerate().map(|(i, title)| (title.clone(), column(i))).collect()
}

/// Why attributes were dropped, by name.
fn dropped(report: &Value) -> BTreeMap<String, String> {
    let list = report["outputs"][0]["attributes_dropped"].as_array().unwrap();
    let text = |value: &Value| value.as_str().unwrap().to_owned();
    list.iter().map(|d| (text(&d["name"]), text(&d["why"]))).collect()
}

#[test]
fn what_is_not_stored_comes_back_from_every_dataset() {
    let dir = Dir::new();
    dir.write("a.las", &scan(3000));
    let original = columns(&dir, "a.las", "a.csv");
    for format in ["potree2", "bintree", "batches"] {
        dir.succeed(["convert", "a.las", "-o", format, "-q", "--to", format, "--attributes", "scene"]);
        let dropped = dropped(&dir.report(format));
        assert_eq!(dropped["return number"], "constant 1", "{format}");
        // sources and user data tell each other: the one that comes first stays
        assert_eq!(dropped["point source id"], "follows from user data by a table of 3 values", "{format}");
        assert_eq!(dropped["scan angle rank"], "follows from user data by a table of 3 values", "{format}");
        for kept in ["user data", "classification", "intensity", "gps-time"] {
            assert!(!dropped.contains_key(kept), "{format}: {kept} {dropped:?}");
        }
        dir.validate(format, &["a.las"]);
        let restored = columns(&dir, format, &format!("{format}.csv"));
        for (name, values) in &original {
            if format == "batches" && ["red", "green", "blue"].contains(&name.as_str()) {
                continue; // of 8 bits there
            }
            assert_eq!(restored.get(name), Some(values), "{format}: {name}");
        }
    }
}

#[test]
fn equal_attributes_are_stored_once() {
    let dir = Dir::new();
    let row = |i: u32| format!("{},{},{},{},{},{},{}\n", i % 37, i / 37, i % 11, i, i % 500, i % 500, (i % 500) / 100);
    let text = "x,y,z,time,first,second,third\n".to_owned() + &(0..4000).map(row).collect::<String>();
    dir.write("a.csv", text.as_bytes());
    dir.succeed(["convert", "a.csv", "-o", "out", "-q", "--attributes", "scene"]);
    let dropped = dropped(&dir.report("out"));
    assert_eq!(
        dropped,
        BTreeMap::from([("second".to_owned(), "the same as first".to_owned())]),
        "500 keys are too many"
    );
    let metadata: Value = serde_json::from_slice(&fs::read(dir.path("out").join("metadata.json")).unwrap()).unwrap();
    assert_eq!(metadata["pointmill"]["attributesOmitted"][0]["sameAs"], json!("first"));
    let (original, restored) = (columns(&dir, "a.csv", "b.csv"), columns(&dir, "out", "c.csv"));
    for name in ["time", "first", "second", "third"] {
        assert_eq!(original[name], restored[name], "{name}");
    }
}

#[test]
fn the_scene_has_the_same_bytes_for_any_number_of_threads() {
    let dir = Dir::new();
    dir.write("a.las", &scan(30_000));
    for threads in ["1", "4"] {
        dir.succeed(["convert", "a.las", "-o", threads, "-q", "--attributes", "scene", "--threads", threads]);
    }
    let bytes = |name: &str| ["octree.bin", "metadata.json"].map(|file| fs::read(dir.path(name).join(file)).unwrap());
    let (one, four) = (bytes("1"), bytes("4"));
    assert_eq!(one[0], four[0]);
    let text =
        |bytes: &[u8], name: &str| String::from_utf8(bytes.to_vec()).unwrap().replace(&format!("\"{name}\""), "");
    assert_eq!(text(&one[1], "1"), text(&four[1], "4"));
}
