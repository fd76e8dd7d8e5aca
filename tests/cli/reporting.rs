//! What is said where: results on standard output, everything else on standard error, in a form that was asked for.

use pointmill_testkit::files::corpus;
use pointmill_testkit::las::Las;
use serde_json::Value;

use crate::support::Dir;

fn with_scan(points: usize) -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(points, 1).bytes());
    dir
}

#[test]
fn standard_output_is_for_results() {
    let dir = with_scan(1000);
    let ended = dir.succeed(["convert", "a.las", "-o", "out"]);
    assert_eq!(ended.stdout(), "");
    assert!(ended.stderr().contains("1,000 points") && ended.stderr().contains("peak memory"), "{}", ended.stderr());
    assert!(ended.stderr().lines().all(|line| line.starts_with("pointmill: ")), "{}", ended.stderr());
    let quiet = dir.succeed(["convert", "a.las", "-o", "out", "--overwrite", "-q"]);
    assert_eq!((quiet.stdout(), quiet.stderr()), (String::new(), String::new()));
}

#[test]
fn progress_for_programs_is_one_json_object_a_line() {
    let dir = with_scan(50_000);
    let stderr = dir.succeed(["convert", "a.las", "-o", "out", "--progress", "json"]).stderr();
    let lines: Vec<Value> = stderr.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of_phase =
        |phase: &str| lines.iter().rfind(|line| line["phase"] == phase).unwrap_or_else(|| panic!("{stderr}"));
    for phase in ["read", "build"] {
        let last = of_phase(phase);
        assert_eq!((&last["done"], &last["total"]), (&50_000.into(), &50_000.into()), "{stderr}");
        assert!(last["points_per_second"].as_f64().unwrap() > 0.0);
        assert_eq!(last["eta_seconds"], 0.0);
        assert_eq!(last["memory_bytes"].is_u64(), cfg!(target_os = "linux"), "{stderr}");
    }
    of_phase("finish");
}

#[test]
fn the_report_is_in_the_dataset_and_where_it_was_asked_for() {
    let dir = with_scan(1000);
    let ended = dir.succeed(["convert", "a.las", "-o", "out", "--report", "run.json", "--json"]);
    let report = dir.report("out");
    let copy: Value = serde_json::from_slice(&std::fs::read(dir.path("run.json")).unwrap()).unwrap();
    let printed: Value = serde_json::from_str(&ended.stdout()).unwrap();
    for key in ["points", "grid", "outputs", "inputs", "checksum_in"] {
        assert!(!report[key].is_null(), "{key}");
        assert!(report[key] == copy[key] && report[key] == printed[key], "{key}");
    }
    assert_eq!(report["checksum_in"], report["outputs"][0]["checksum"]);
    assert_eq!(report["outputs"][0]["accuracy"]["lattice"]["max"], serde_json::json!([0.0, 0.0, 0.0]));
}

#[test]
fn info_describes_scans_and_datasets() {
    let dir = with_scan(1000);
    dir.succeed(["convert", "a.las", "-o", "out", "-q"]);
    let text = dir.succeed(["info", "a.las", "out"]).stdout();
    for word in ["1,000", "intensity", "gps-time", "Potree 2.0", "levels"] {
        assert!(text.contains(word), "{word} is not in {text}");
    }
    let json = dir.succeed(["info", "--json", "--deep", "a.las", "out/metadata.json"]).stdout();
    let objects: Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&objects[0]["kind"], &objects[0]["measured"]["points"]), (&"scan".into(), &1000.into()));
    assert_eq!(objects[0]["measured"]["ranges"]["classification"], serde_json::json!({ "min": [2.0], "max": [6.0] }));
    assert_eq!((&objects[1]["kind"], &objects[1]["points"]), (&"dataset".into(), &1000.into()));
}

#[test]
fn info_describes_the_good_and_fails_for_the_bad() {
    let dir = with_scan(1000);
    dir.write("b.las", b"LASF, or so it says");
    let ended = dir.run(["info", "b.las", "a.las"]);
    assert!(ended.stdout().contains("1,000"), "{}", ended.stdout());
    ended.failed_with(3, &["b.las"]);
    dir.run(["info", "nowhere"]).failed_with(2, &["nowhere"]);
}

#[test]
fn datasets_of_the_reference_converter_are_known() {
    let Some(lion) = corpus("potree2/color_1065_BROTLI") else { return };
    let dir = Dir::new();
    let json = dir.succeed(["info".as_ref(), lion.as_os_str(), "--json".as_ref()]).stdout();
    let objects: Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&objects[0]["points"], &objects[0]["encoding"]), (&1065.into(), &"BROTLI".into()));
}

#[test]
fn validation_reports_in_words_and_in_json() {
    let dir = with_scan(20_000);
    dir.succeed(["convert", "a.las", "-o", "out", "-q"]);
    let text = dir.succeed(["validate", "out", "--against", "a.las"]).stdout();
    assert!(text.contains("20,000"), "{text}");
    let json = dir.succeed(["validate", "out", "--against", "a.las", "--json"]).stdout();
    let outcome: Value = serde_json::from_str(&json).unwrap();
    assert_eq!((&outcome["ok"], &outcome["points"]), (&true.into(), &20_000.into()));
    assert!(outcome["checks"].as_array().is_some_and(|checks| checks.len() > 5), "{outcome:#}");
    assert!(!outcome["quality"].is_null());
}

#[cfg(unix)]
#[test]
fn a_reader_that_has_seen_enough_is_no_fault() {
    let dir = with_scan(10);
    let script = "\"$0\" info a.las | true; \"$0\" info a.las >/dev/full; echo $?";
    let mut sh = std::process::Command::new("sh");
    let output = sh.args(["-c", script, env!("CARGO_BIN_EXE_pointmill")]).current_dir(dir.path("")).output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(stderr.lines().count(), 1, "{stderr}"); // of the full disk alone
    if std::path::Path::new("/dev/full").exists() {
        assert_eq!(output.stdout, b"5\n", "{stderr}");
    }
}
