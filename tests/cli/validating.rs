//! `validate` with what is missing, what lies, and what is scarce.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use pointmill_format::potree2::{BrotliScratch, NodeRecord, encode_brotli};
use pointmill_format::{Attribute, AttributeType};
use pointmill_testkit::las::Las;
use serde_json::Value;

use crate::support::{Dir, Ended};

/// The object that is printed, whatever the exit code.
fn object(ended: &Ended) -> Value {
    serde_json::from_str(&ended.stdout()).unwrap_or_else(|e| panic!("{e}: {}{}", ended.stdout(), ended.stderr()))
}

fn with_three() -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(3_000, 1).bytes());
    dir.succeed(["convert", "a.las", "-o", "out", "--to", "potree2", "--to", "bintree", "--to", "batches"]);
    dir
}

fn with_one(to: &str) -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(3_000, 1).bytes());
    dir.succeed(["convert", "a.las", "-o", "out", "--to", to]);
    dir
}

fn change_report(dir: &Dir, change: impl Fn(&mut Value)) {
    let mut report = dir.report("out");
    change(&mut report);
    fs::write(dir.path("out/report.json"), report.to_string()).unwrap();
}

#[test]
fn outputs_that_the_report_names_and_nobody_finds_are_missed() {
    let dir = with_three();
    dir.succeed(["validate", "out", "-q"]);
    fs::remove_file(dir.path("out/potree2/metadata.json")).unwrap();
    fs::remove_dir_all(dir.path("out/bintree")).unwrap();
    let ended = dir.run(["validate", "out"]);
    assert!(ended.stdout().contains("found a folder without it") && ended.stdout().contains("found nothing"));
    ended.failed_with(7, &["report.json names other outputs", "potree2", "bintree"]);
    let object = object(&dir.run(["validate", "out", "--json"]));
    assert_eq!((&object["ok"], object["problems"].as_array().map(Vec::len)), (&false.into(), Some(2)));
    assert_eq!(object["datasets"][0]["outcome"]["ok"], true, "what is left is sound");
    fs::remove_dir_all(dir.path("out/batches")).unwrap();
    dir.run(["validate", "out"]).failed_with(7, &["potree2", "bintree", "batches"]);
}

#[test]
fn outputs_that_the_report_does_not_name_are_told() {
    let dir = with_three();
    change_report(&dir, |report| drop(report["outputs"].as_array_mut().map(|outputs| outputs.remove(0))));
    dir.run(["validate", "out"]).failed_with(7, &["potree2"]);
    fs::write(dir.path("out/report.json"), "{\"outputs\": [").unwrap();
    dir.run(["validate", "out"]).failed_with(7, &["report.json"]);
    fs::remove_file(dir.path("out/report.json")).unwrap();
    let ended = dir.succeed(["validate", "out"]);
    assert!(ended.stderr().contains("whether these are all outputs is not checked"), "{}", ended.stderr());
}

#[test]
fn counts_and_accuracy_of_the_report_are_held_against_the_dataset() {
    for to in ["potree2", "bintree", "batches"] {
        let dir = with_one(to);
        let sound = dir.report("out");
        let count = if to == "batches" { "/outputs/0/details/batches" } else { "/outputs/0/tree/nodes" };
        for place in ["/outputs/0/points", count] {
            change_report(&dir, |report| *report.pointer_mut(place).unwrap() = 77.into());
            dir.run(["validate", "out", "-q"]).failed_with(7, &["report"]);
            fs::write(dir.path("out/report.json"), sound.to_string()).unwrap();
        }
        change_report(&dir, |report| drop(report["outputs"][0].as_object_mut().unwrap().remove("accuracy")));
        let ended = dir.run(["validate", "out", "-q"]);
        assert!(ended.stdout().contains("accuracy in the report"), "{}", ended.stdout());
        ended.failed_with(7, &["accuracy"]);
        fs::remove_file(dir.path("out/report.json")).unwrap();
        let ended = dir.succeed(["validate", "out"]);
        assert!(ended.stdout().contains("there is no report of the conversion beside the dataset"));
    }
}

#[test]
fn json_prints_its_object_whatever_is_missing() {
    for file in ["octree.bin", "hierarchy.bin"] {
        let dir = with_one("potree2");
        fs::remove_file(dir.path("out").join(file)).unwrap();
        let ended = dir.run(["validate", "out", "--json"]);
        ended.failed_with(7, &[file, "missing"]);
        let object = object(&ended);
        assert_eq!((&object["ok"], &object["format"]), (&false.into(), &"potree2".into()));
        assert_eq!(object["problems"][0]["subject"], file);
        dir.run(["info", "out"]).failed_with(3, &[file, "is missing"]);
    }
    let dir = with_one("bintree");
    fs::remove_file(dir.path("out/n.bin")).unwrap();
    let ended = dir.run(["validate", "out", "--json"]);
    ended.failed_with(7, &["leaf-files"]);
    assert_eq!(object(&ended)["ok"], false);

    let ended = dir.run(["validate", "nothing", "--json"]);
    ended.failed_with(2, &["nothing"]);
    assert_eq!(object(&ended)["ok"], false);
    let ended = dir.run(["validate", "out", "--memory", "1MiB", "--json"]);
    ended.failed_with(6, &["--memory"]);
    assert!(object(&ended)["error"].as_str().unwrap().contains("MiB of memory at least"));
}

#[test]
fn pipes_in_place_of_files_are_refused_at_once() {
    let cases = [
        ("potree2", "metadata.json"),
        ("potree2", "hierarchy.bin"),
        ("potree2", "octree.bin"),
        ("potree2", "report.json"),
        ("bintree", "index.json"),
        ("batches", "points.qbatch"),
    ];
    for (to, file) in cases {
        let dir = with_one(to);
        let path = dir.path("out").join(file);
        fs::remove_file(&path).unwrap();
        assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
        let ended = dir.run(["validate", "out", "--json"]);
        ended.failed_with(5, &[file, "a pipe"]);
        assert_eq!(object(&ended)["ok"], false);
        if file != "report.json" {
            dir.run(["info", "out"]).failed_with(5, &[file, "a pipe"]);
        }
    }
}

#[test]
fn files_longer_than_anything_in_them_are_not_read_to_their_end() {
    let hole = |path: &Path| fs::File::options().write(true).open(path).unwrap().set_len(100 << 30).unwrap();
    let cases = [
        ("potree2", "metadata.json"),
        ("potree2", "hierarchy.bin"),
        ("potree2", "octree.bin"),
        ("potree2", "report.json"),
        ("bintree", "index.json"),
        ("bintree", "n.bin"),
        ("batches", "points.qbatch"),
    ];
    for (to, file) in cases {
        let dir = with_one(to);
        hole(&dir.path("out").join(file));
        let (ended, peak) = watched(dir.command(["validate", "out", "-q"]));
        assert_eq!(ended.code(), 7, "{file}: {}{}", ended.stdout(), ended.stderr());
        assert!(peak < 100 << 20, "{file}: {peak}");
    }
}

/// Runs a command and returns its peak of resident memory as well, bytes.
fn watched(mut command: Command) -> (Ended, u64) {
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let status = format!("/proc/{}/status", child.id());
    let (stop, stopped) = std::sync::mpsc::channel::<()>();
    let watch = std::thread::spawn(move || {
        let mut peak = 0;
        while stopped.recv_timeout(std::time::Duration::from_millis(2)).is_err() {
            let text = fs::read_to_string(&status).unwrap_or_default();
            let line = text.lines().find_map(|l| l.strip_prefix("VmHWM:")).unwrap_or("0 kB");
            let kib: u64 = line.trim().trim_end_matches("kB").trim().parse().unwrap_or(0);
            peak = peak.max(kib << 10);
        }
        peak
    });
    let output = child.wait_with_output().unwrap();
    stop.send(()).unwrap();
    (Ended(output), watch.join().unwrap())
}

/// A root of 4 million points in a stream of a few hundred bytes that says that it has ten times as many.
#[test]
fn a_stream_that_claims_more_than_it_gives_takes_no_memory_for_it() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(100, 1).bytes());
    dir.succeed(["convert", "a.las", "-o", "out", "--encoding", "brotli", "--attributes", "rgb"]);
    let attributes =
        [Attribute::new("position", AttributeType::Int32, 3), Attribute::new("rgb", AttributeType::UInt16, 3)];
    let mut payload = Vec::new();
    let records = vec![0; 18 * 4_000_000];
    encode_brotli(&attributes, &records, 4, &mut BrotliScratch::default(), &mut payload).unwrap();
    fs::write(dir.path("out/octree.bin"), &payload).unwrap();
    let bytes = fs::read(dir.path("out/hierarchy.bin")).unwrap();
    let mut root = NodeRecord::from_bytes(bytes.first_chunk().unwrap());
    (root.points, root.byte_offset, root.byte_size) = (40_000_000, 0, payload.len() as u64);
    fs::write(dir.path("out/hierarchy.bin"), root.to_bytes()).unwrap();
    let (ended, peak) = watched(dir.command(["validate", "out"]));
    assert!(ended.stdout().contains("decompresses to 96000000 bytes"), "{}", ended.stdout());
    ended.failed_with(7, &["payloads"]);
    assert!(peak < 64 << 20, "{peak}");
    // four million points at one place are another matter: they take their memory, or are refused before they do
    root.points = 4_000_000;
    fs::write(dir.path("out/hierarchy.bin"), root.to_bytes()).unwrap();
    let (ended, peak) = watched(dir.command(["validate", "out", "--memory", "100MiB"]));
    ended.failed_with(6, &["--memory", "the ceiling is 100 MiB"]);
    assert!(peak < 64 << 20, "{peak}");
}

#[test]
fn more_scans_than_files_may_be_open_are_compared() {
    let dir = Dir::new();
    for i in 0..150 {
        dir.write(&format!("scans/{i}.las"), &Las::terrain(3 + i % 5, i as u64).bytes());
    }
    dir.succeed(["convert", "scans", "-o", "out"]);
    let program = env!("CARGO_BIN_EXE_pointmill");
    let script = "ulimit -n 90; exec \"$0\" validate out -q --against scans";
    let output = Command::new("sh").args(["-c", script, program]).current_dir(dir.path("")).output().unwrap();
    let ended = Ended(output);
    assert_eq!(ended.code(), 0, "{}{}", ended.stdout(), ended.stderr());
    // a point more in one of them is found all the same
    dir.write("scans/77.las", &Las::terrain(6, 77).bytes());
    dir.run(["validate", "out", "-q", "--against", "scans"]).failed_with(7, &["against"]);
}

#[test]
fn the_ceiling_of_a_validation_is_kept() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(800_000, 1).bytes());
    for (to, ceiling) in [("potree2", 80u64), ("bintree", 64), ("batches", 80)] {
        dir.succeed(["convert", "a.las", "-o", "out", "--to", to, "--overwrite"]);
        for against in [false, true] {
            let memory = format!("{ceiling}MiB");
            let mut args = vec!["validate", "out", "-q", "--memory", &memory];
            args.extend(against.then_some(["--against", "a.las"]).into_iter().flatten());
            let (ended, peak) = watched(dir.command(args));
            assert_eq!(ended.code(), 0, "{to}: {}{}", ended.stdout(), ended.stderr());
            assert!(peak > 8 << 20 && peak <= ceiling << 20, "{to}, against: {against}: {} MiB", peak >> 20);
        }
        dir.run(["validate", "out", "--memory", "25MiB"]).failed_with(6, &["MiB of memory at least", "--memory"]);
    }
}
