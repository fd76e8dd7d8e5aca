//! What can be typed, and what is said to what cannot.

use pointmill_testkit::las::Las;

use crate::support::Dir;

#[test]
fn nothing_typed_is_a_mistake_and_help_is_none() {
    let dir = Dir::new();
    assert_eq!(dir.run([""; 0]).code(), 2);
    let help = dir.succeed(["convert", "--help"]);
    for option in ["--memory", "--threads", "--overwrite", "--dry-run", "--attributes", "--bounds", "--sampling"] {
        assert!(help.stdout().contains(option), "{option}");
    }
    assert!(dir.succeed(["--version"]).stdout().starts_with("pointmill "));
}

#[test]
fn mistakes_end_with_code_2_and_leave_nothing_behind() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(10, 1).bytes());
    let table: [(&[&str], &str); 10] = [
        (&["a.las"], "--output"),
        (&["-o", "out"], "no input"),
        (&["b.las", "-o", "out"], "b.las"),
        (&["a.las", "-o", "out", "--memory", "some"], "size"),
        (&["a.las", "-o", "out", "--seed", "1"], "--seed"),
        (&["a.las", "-o", "out", "--brotli-quality", "5"], "--brotli-quality"),
        (&["a.las", "-o", "out", "--bounds", "5,0,0..1,1,1"], "empty"),
        (&["a.las", "-o", "out", "--temp-dir", "nowhere"], "nowhere"),
        (&["a.las", "-o", "out", "--report", "nowhere/r.json"], "nowhere"),
        (&["a.las", "-o", "out", "--attributes", "colour of the sky"], "colour of the sky"),
    ];
    for (args, word) in table {
        let ended = dir.run(["convert"].iter().chain(args));
        assert_eq!(ended.code(), 2, "{args:?}: {}", ended.stderr());
        assert!(ended.stderr().contains(word), "{args:?}: {}", ended.stderr());
        assert_eq!(dir.names(), ["a.las"], "{args:?}");
    }
}

#[test]
fn a_dry_run_reports_and_writes_nothing() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(12_345, 1).bytes());
    let text = dir.succeed(["convert", "a.las", "-o", "out", "--dry-run"]).stdout();
    assert!(text.contains("12,345"), "{text}");
    let json = dir.succeed(["convert", "a.las", "-o", "out", "--dry-run", "--json"]).stdout();
    let estimate: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(estimate["points"], 12_345);
    assert!(estimate["output_bytes"].as_u64().unwrap() >= 12_345 * 35);
    assert_eq!(dir.names(), ["a.las"]);
}

#[test]
fn filters_keep_what_was_asked_for_and_account_for_the_rest() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(3000, 1).bytes());
    let box_ = "500000,5400000,-100..500005,5400005,100";
    dir.succeed(["convert", "a.las", "-o", "out", "--class", "2,6", "--every", "2", "--bounds", box_, "-q"]);
    let report = dir.report("out");
    let n = |name: &str| report["points"][name].as_u64().unwrap();
    assert_eq!(n("read"), 3000);
    assert!(n("kept") > 0 && n("outside_bounds") > 0 && n("other_class") > 0 && n("thinned") > 0, "{report}");
    assert_eq!(n("kept") + n("outside_bounds") + n("other_class") + n("thinned"), 3000);
    dir.validate("out", &["a.las"]);
}

#[test]
fn every_sampling_and_encoding_holds_every_point() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(40_000, 3).bytes());
    for (i, options) in [
        ["--sampling", "poisson", "--encoding", "brotli"],
        ["--sampling", "grid", "--encoding", "default"],
        ["--sampling", "random", "--seed", "7"],
        ["--attributes", "scene", "--leaf-capacity", "500"],
    ]
    .iter()
    .enumerate()
    {
        let out = format!("out{i}");
        dir.succeed(["convert", "a.las", "-q", "-o", &out].iter().chain(options));
        dir.validate(&out, &["a.las"]);
    }
}

#[test]
fn the_spacing_of_an_octree_can_be_chosen() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(40_000, 3).bytes());
    let mut in_root = Vec::new();
    for (out, spacing, sampling) in
        [("usual", "auto", "poisson"), ("fine", "0.4", "poisson"), ("coarse", "2.5", "poisson"), ("grid", "1", "grid")]
    {
        dir.succeed(["convert", "a.las", "-q", "-o", out, "--spacing", spacing, "--sampling", sampling]);
        dir.validate(out, &["a.las"]);
        let metadata: serde_json::Value =
            serde_json::from_slice(&std::fs::read(dir.path(out).join("metadata.json")).unwrap()).unwrap();
        let report = dir.report(out)["outputs"][0].clone();
        let (stated, found) = (&metadata["spacing"], &report["details"]["spacing"]);
        assert_eq!(stated, &found["root"]);
        match spacing.parse::<f64>() {
            Ok(spacing) if sampling == "poisson" => assert!((stated.as_f64().unwrap() / spacing - 1.0).abs() < 1e-12),
            Ok(spacing) => assert!((1.0..2.0).contains(&(stated.as_f64().unwrap() / spacing)), "{stated}"),
            Err(_) => assert!((148.0..=200.0).contains(&found["per_side"].as_f64().unwrap()), "{found}"),
        }
        in_root.push(report["tree"]["points_per_level"][0].as_u64().unwrap());
    }
    assert!(in_root[1] * 4 > in_root[0] * 3 && in_root[0] > 2 * in_root[2], "{in_root:?}");
}

#[test]
fn single_points_taken_back_from_far_below_are_no_holes() {
    let dir = Dir::new();
    for seed in [2, 5, 7, 9, 11] {
        let mut random = pointmill_testkit::Random::new(seed);
        let mut at = || random.below(127) as i32;
        let mut positions: Vec<[i32; 3]> = (0..12_000).map(|_| [at(), at(), at()]).collect();
        positions.extend([[0; 3], [126; 3]]);
        dir.write("a.las", &Las::numbered(positions).bytes());
        // side / 16 of 129 steps of a centimetre
        let options = ["--leaf-capacity", "1", "--spacing", "0.08", "--overwrite"];
        dir.succeed(["convert", "a.las", "-q", "-o", "out"].iter().chain(&options));
        dir.validate("out", &["a.las"]);
    }
}

#[test]
fn what_a_scene_drops_as_constant_is_checked_by_the_validator() {
    let dir = Dir::new();
    let mut scan = Las::terrain(500, 1);
    dir.write("a.las", &scan.bytes());
    dir.succeed(["convert", "a.las", "-q", "-o", "out", "--attributes", "scene"]);
    let metadata = std::fs::read(dir.path("out/metadata.json")).unwrap();
    let metadata: serde_json::Value = serde_json::from_slice(&metadata).unwrap();
    assert_eq!(metadata["pointmill"]["attributesDropped"]["user data"], serde_json::json!([7.0]), "{metadata:#}");
    dir.validate("out", &["a.las"]);
    scan.points[3].user_data = 8;
    dir.write("a.las", &scan.bytes());
    dir.run(["validate", "out", "--against", "a.las"]).failed_with(7, &["against"]);
}
