//! What an output replaces, what it never replaces, and what runs that were ended leave for the next.

use std::fs;

use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

use crate::support::Dir;

fn with_dataset() -> Dir {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(2000, 1).bytes());
    dir.write("b.las", &Las::terrain(3000, 2).bytes());
    dir.succeed(["convert", "a.las", "-o", "out", "-q"]);
    dir
}

fn points(dir: &Dir, dataset: &str) -> u64 {
    dir.report(dataset)["points"]["kept"].as_u64().unwrap()
}

#[test]
fn what_only_bears_a_name_of_ours_is_not_deleted() {
    for (name, is_folder) in [
        ("log.txt", false),
        ("log.txt", true),
        ("leaves.bin", true),
        ("leaves.bin", false),
        ("notes.md", false),
        ("octree.bin", true),
        ("potree2", true),
        ("n01.bin", false),
    ] {
        let dir = with_dataset();
        let path = dir.path("out").join(name);
        if is_folder {
            let _ = fs::remove_file(&path);
            fs::create_dir(&path).unwrap();
            fs::write(path.join("thesis.txt"), "years").unwrap();
        } else {
            fs::write(&path, "years").unwrap();
        }
        dir.run(["convert", "b.las", "-o", "out", "--overwrite"]).failed_with(2, &["out", name]);
        let kept = if is_folder { path.join("thesis.txt") } else { path };
        assert_eq!(fs::read(kept).unwrap(), b"years");
    }
    let dir = with_dataset();
    dir.write("mine/metadata.json", br#"{"hierarchy": {"by": "me"}, "octree": "my own"}"#);
    dir.write("mine/octree.bin", b"mine");
    dir.run(["convert", "b.las", "-o", "mine", "--overwrite"]).failed_with(2, &["mine"]);
    dir.write("tree/index.json", br#"{"format": "pointmill-bintree", "generator": "my own program"}"#);
    dir.run(["convert", "b.las", "-o", "tree", "--overwrite"]).failed_with(2, &["tree"]);
    dir.write("report/report.json", br#"{"title": "annual"}"#);
    dir.run(["convert", "b.las", "-o", "report", "--overwrite"]).failed_with(2, &["report"]);
}

#[test]
fn every_kind_of_output_of_ours_is_replaced_by_every_other() {
    let dir = with_dataset();
    let kinds: [&[&str]; 6] = [
        &["--to", "bintree", "--capacity", "100", "--layout", "files"],
        &["--to", "batches"],
        &["--to", "bintree", "--layout", "packed"],
        &["--to", "potree2", "--to", "batches"],
        &["--to", "batches", "--to", "bintree"],
        &["--to", "potree2"],
    ];
    for (i, kind) in kinds.iter().enumerate() {
        let scan = ["a.las", "b.las"][i % 2];
        dir.succeed([&["convert", scan, "-o", "out", "--overwrite", "-q", "--report", "out/run.json"], *kind].concat());
        assert_eq!(points(&dir, "out"), [2000, 3000][i % 2]);
        dir.validate("out", &[scan]);
    }
    assert_eq!(dir.names(), ["a.las", "b.las", "out"]);
}

#[test]
fn the_place_of_the_output_is_where_its_path_leads() {
    let dir = with_dataset();
    let converts = |output: &str, folder: &str| {
        let mut command = dir.command(["convert", &dir.path("b.las").display().to_string(), "-q", "--overwrite", "-o"]);
        let output = command.arg(output).current_dir(dir.path(folder)).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    converts("../out", "out");
    converts(".", "out");
    for new in ["new/.", "new2/", "new3//.", "deep/er/new4", "out/../new5"] {
        converts(new, "");
    }
    for name in ["out", "new", "new2", "new3", "deep/er/new4", "new5"] {
        assert_eq!(points(&dir, name), 3000, "{name}");
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("out", dir.path("link")).unwrap();
        dir.succeed(["convert", "a.las", "-o", "link/", "--overwrite", "-q"]);
        assert_eq!(points(&dir, "out"), 2000);
        converts("link", "");
        assert!(dir.path("link").is_symlink() && points(&dir, "out") == 3000);
        std::os::unix::fs::symlink("nowhere", dir.path("dangling")).unwrap();
        dir.run(["convert", "a.las", "-o", "dangling"]).failed_with(5, &["dangling"]);
        fs::remove_file(dir.path("link")).unwrap();
        fs::remove_file(dir.path("dangling")).unwrap();
    }
    assert_eq!(dir.names(), ["a.las", "b.las", "deep", "new", "new2", "new3", "new5", "out"]);
}

#[test]
fn an_output_among_the_inputs_is_made_and_replaced() {
    let dir = Dir::new();
    dir.write("scans/a.las", &Las::terrain(500, 1).bytes());
    for _ in 0..2 {
        dir.succeed(["convert", "scans", "-o", "scans/out", "--overwrite", "-q"]);
        assert_eq!(points(&dir, "scans/out"), 500);
    }
    dir.run(["convert", "scans", "-o", "scans", "--overwrite"]).failed_with(2, &["scans"]);
    assert!(dir.path("scans/a.las").is_file());
}

#[test]
fn names_as_long_as_the_file_system_allows_work_and_longer_ones_fail_at_once() {
    let dir = with_dataset();
    let long = "n".repeat(250);
    dir.succeed(["convert", "b.las", "-o", &long, "-q"]);
    dir.succeed(["convert", "a.las", "-o", &long, "-q", "--overwrite"]);
    assert_eq!(points(&dir, &long), 2000);
    let ended = dir.run(["convert", "b.las", "-o", &"n".repeat(300), "--progress", "json"]);
    assert_eq!(ended.code(), 5, "{}", ended.stderr());
    assert!(!ended.stderr().contains("\"read\""), "{}", ended.stderr());
}

#[cfg(unix)]
#[test]
fn the_folder_of_the_output_keeps_its_mode_and_its_owner() {
    use std::os::unix::fs::{MetadataExt as _, PermissionsExt as _, chown};
    let dir = with_dataset();
    fs::create_dir(dir.path("empty")).unwrap();
    for name in ["empty", "out"] {
        let path = dir.path(name);
        let can_give = chown(&path, Some(12_345), Some(54_321)).is_ok(); // root alone
        fs::set_permissions(&path, fs::Permissions::from_mode(0o2750)).unwrap();
        dir.succeed(["convert", "b.las", "-o", name, "--overwrite", "-q"]);
        let meta = fs::metadata(&path).unwrap();
        assert_eq!(meta.mode() & 0o7777, 0o2750, "{name}");
        if can_give {
            assert_eq!((meta.uid(), meta.gid()), (12_345, 54_321), "{name}");
        }
        assert_eq!(points(&dir, name), 3000);
    }
}

#[test]
fn the_report_replaces_neither_an_input_nor_a_file_of_a_dataset() {
    let dir = with_dataset();
    let (scan, before) = (fs::read(dir.path("b.las")).unwrap(), dataset(&dir.path("out")));
    fs::create_dir(dir.path("sub")).unwrap();
    fs::hard_link(dir.path("b.las"), dir.path("sub/hard.json")).unwrap();
    fs::write(dir.path("list.txt"), "b.las\n").unwrap();
    let mut places = vec!["b.las", "sub/../b.las", "sub/hard.json", "new", "new/octree.bin", "out/octree.bin"];
    places.extend(["sub/../new/metadata.json", "new/potree2", "list.txt", "nowhere/run.json", "sub"]);
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("../b.las", dir.path("sub/soft.json")).unwrap();
        places.push("sub/soft.json");
    }
    for report in places {
        let args = ["convert", "--files-from", "list.txt", "-o", "new", "--report", report];
        dir.run(args).failed_with(2, &["another file"]);
        assert!(!dir.path("new").exists(), "{report}: refused before the work");
    }
    assert_eq!(fs::read(dir.path("b.las")).unwrap(), scan);
    assert_eq!(dataset(&dir.path("out")), before);
    // a report of before is replaced, also where the folder of the output changes
    for _ in 0..2 {
        dir.succeed(["convert", "b.las", "-o", "out", "--overwrite", "-q", "--report", "sub/run.json"]);
        dir.succeed(["convert", "b.las", "-o", "out", "--overwrite", "-q", "--report", "out/report.json"]);
    }
    dir.validate("out", &["b.las"]);
}

#[cfg(target_os = "linux")]
#[test]
fn what_fails_after_the_dataset_is_in_place_says_so() {
    let dir = with_dataset();
    dir.run(["convert", "b.las", "-o", "one", "--report", "/dev/full"])
        .failed_with(5, &["/dev/full", "one is complete"]);
    dir.validate("one", &["b.las"]);
    let full = fs::File::options().write(true).open("/dev/full").unwrap();
    let ended = dir.command(["convert", "b.las", "-o", "two", "--json"]).stdout(full).output().unwrap();
    crate::support::Ended(ended).failed_with(5, &["two is complete"]);
    dir.validate("two", &["b.las"]);
}

/// The lock of a run that lives keeps its folder, whoever else comes.
#[test]
fn runs_at_the_same_time_do_not_hinder_each_other() {
    let dir = with_dataset();
    let start = |scan: &str| {
        let args = ["convert", scan, "-o", "out", "--overwrite", "-q", "--threads", "1"];
        dir.command(args).stderr(std::process::Stdio::piped()).spawn().unwrap()
    };
    let runs: Vec<_> = (0..8).map(|i| start(["a.las", "b.las"][i % 2])).collect();
    for run in runs {
        let ended = run.wait_with_output().unwrap();
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
    }
    dir.validate("out", &[]);
    assert_eq!(dir.names(), ["a.las", "b.las", "out"]);
}
