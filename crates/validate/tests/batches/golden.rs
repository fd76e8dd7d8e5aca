//! Files of others and of all shapes are accepted.

use std::path::Path;

use pointmill_validate::{Check, Options, validate};

use super::cloud::{Cloud, Point, good, terrain};

#[test]
fn golden_files_have_no_findings() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/batches");
    let mut files = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "qbatch") {
            let outcome = validate(&path, &Options::default(), &|_| {}).unwrap();
            assert!(outcome.ok, "{}: {:#?}", path.display(), outcome.problems);
            files += 1;
        }
    }
    assert_eq!(files, 5);
}

#[test]
fn a_good_file_has_no_findings_and_every_check_looks_at_something() {
    let outcome = good().validate();
    assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
    assert_eq!((outcome.points, outcome.nodes), (31_720, 4));
    for check in &outcome.checks {
        let skipped = [Check::Blocks, Check::Against, Check::Report, Check::Accuracy].contains(&check.name);
        assert_eq!(check.skipped.is_some(), skipped, "{check}");
        assert!(skipped || check.checked > 0, "{check}");
    }
}

#[test]
fn grey_and_white_clouds_are_checked_for_their_colours() {
    for colour in ["intensity", "none"] {
        let mut parts = Cloud { colour, ..terrain() }.parts();
        let range = parts.description["intensityRange"].as_array_mut().unwrap();
        range.iter_mut().for_each(|v| *v = v.as_f64().unwrap().into()); // 20.0 is a whole number, too
        let outcome = parts.validate();
        assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
        let at = (0..parts.points).find(|i| parts.level(*i) == 3).unwrap();
        parts.colours[at] ^= 0x01_0101;
        let outcome = parts.validate();
        // and the mean of its cells is another one now, as far as rounding shows it
        assert!(!outcome.check(Check::Colours).unwrap().ok);
    }
}

/// Points of extremes: X, Y, Z and the step.
fn extreme(points: Vec<[i64; 3]>, scale: f64, offset: [f64; 3], cell: f64) -> Cloud {
    let points = points.into_iter().enumerate();
    let points = points.map(|(i, x)| Point {
        x,
        rgb: [i as u8, 7, 255],
        intensity: 20 + (i % 9) as u16,
        class: 2,
        surfel: None,
    });
    Cloud { points: points.collect(), scale, offset, cell, ..terrain() }
}

#[test]
fn extremes_have_no_findings() {
    let grid = |n: i64| (0..n).map(|i| [i % 23, i / 23 % 29, i / 667]).collect::<Vec<_>>();
    let clouds = [
        ("one point", extreme(vec![[1, 2, 3]], 0.001, [4_428_000.0, -1e7, 0.1], 1.0)),
        ("one batch", extreme(grid(10_240), 0.01, [0.0; 3], 0.5)),
        ("two batches", extreme(grid(20_480), 0.125, [-1.0, -2.0, -3.0], 1.0)),
        ("all equal", extreme(vec![[5, 5, 5]; 10_300], 0.001, [0.0; 3], 1.0)),
        ("a line", extreme((0..11_000).map(|i| [i, 0, 0]).collect(), 0.001, [-5.5, 0.0, 1e7], 1.0)),
        ("wide", extreme((0..99).map(|i| [i * 10_000_000, i % 7 * 9_000_000, 0]).collect(), 0.001, [0.0; 3], 1.0)),
        ("tiny", extreme(grid(5000), 1e-6, [12.0, 0.0, -7.0], 1.0)),
        ("borders", extreme(grid(3000), 0.25, [0.0; 3], 1.0)),
    ];
    for (name, cloud) in clouds {
        let outcome = cloud.parts().validate();
        assert!(outcome.ok && outcome.problems.is_empty(), "{name}: {:#?}", outcome.problems);
        let levels = outcome.check(Check::Levels).unwrap();
        assert!(levels.skipped.is_none() && levels.checked > 0, "{name}: {levels}");
    }
}
