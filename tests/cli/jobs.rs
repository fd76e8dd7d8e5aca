//! `pointmill job`: a conversion that several processes do together.

use pointmill_testkit::files::{assert_same_dataset, dataset};
use pointmill_testkit::las::Las;
use serde_json::Value;

use crate::support::Dir;

const SHARES: usize = 3;

fn stage() -> Dir {
    let dir = Dir::new();
    for seed in 1..=4 {
        dir.write(&format!("scans/{seed}.las"), &Las::terrain(60_000, seed).bytes());
    }
    dir.succeed(["convert", "scans", "-o", "plain", "-q", "--name", "city"]);
    dir
}

fn plan(dir: &Dir) {
    dir.succeed([
        "job",
        "plan",
        "scans",
        "-o",
        "out",
        "--job",
        "the.job",
        "--checkpoint",
        "50000",
        "--name",
        "city",
        "-q",
    ]);
}

#[test]
fn processes_with_a_share_each_make_the_bytes_of_one_even_if_one_is_killed() {
    let dir = stage();
    plan(&dir);
    let share = |i: usize| {
        let share = format!("{}/{SHARES}", i + 1);
        dir.command(["job", "run", "the.job", "--threads", "1", "-q", "--share", &share]).spawn().unwrap()
    };
    let mut processes: Vec<_> = (0..SHARES).map(share).collect();
    std::thread::sleep(std::time::Duration::from_millis(150));
    processes[0].kill().unwrap();
    processes[0].wait().unwrap();
    processes[0] = share(0);
    for process in &mut processes {
        assert!(process.wait().unwrap().success());
    }
    let status = dir.succeed(["job", "status", "the.job", "-q"]).stdout();
    assert!(status.contains("all units are done"), "{status}");
    dir.succeed(["job", "finish", "the.job", "-q"]);
    assert_same_dataset(&dataset(&dir.path("out")), &dataset(&dir.path("plain")), "a job");
    assert_eq!(dir.names(), ["out", "plain", "scans"]);
}

#[test]
fn a_share_whose_others_never_begin_does_their_units_too() {
    let dir = stage();
    plan(&dir);
    // one of three, alone
    dir.succeed(["job", "run", "the.job", "-q", "--share", "2/3", "--patience", "1"]);
    let foreign = "the.job/units/notes.txt";
    dir.write(foreign, b"mine");
    dir.succeed(["job", "finish", "the.job", "-q"]);
    assert_same_dataset(&dataset(&dir.path("out")), &dataset(&dir.path("plain")), "a job");
    assert_eq!(std::fs::read(dir.path(foreign)).unwrap(), b"mine", "files of others stay");
    let units = std::fs::read_dir(dir.path("the.job/units")).unwrap().count();
    assert_eq!((units, dir.names()), (1, ["out", "plain", "scans", "the.job"].map(String::from).to_vec()));
}

#[test]
fn who_looks_at_a_job_writes_nothing_into_it() {
    let dir = stage();
    plan(&dir);
    let changed = || std::fs::metadata(dir.path("the.job")).unwrap().modified().unwrap();
    let before = changed();
    dir.succeed(["job", "units", "the.job"]);
    dir.succeed(["job", "status", "the.job"]);
    assert_eq!(changed(), before);
    // a unit that is not whole is not done, and stays as it is for whoever looks
    dir.succeed(["job", "run", "the.job", "read-1-0"]);
    let unit = dir.path("the.job/units/read-1-0");
    let bytes = std::fs::read(&unit).unwrap();
    std::fs::write(&unit, &bytes[..bytes.len() / 2]).unwrap();
    dir.succeed(["job", "run", "the.job", "read-1-1", "read-1-2", "read-1-3"]);
    assert!(dir.succeed(["job", "units", "the.job"]).stdout().contains("read-1-0"));
    // records that are gone are named
    dir.succeed(["job", "run", "the.job", "read-1-0"]);
    let units = dir.path("the.job/units");
    let names = std::fs::read_dir(units).unwrap().map(|e| e.unwrap().path());
    names.filter(|p| p.extension().is_some_and(|e| e == "records")).for_each(|p| std::fs::write(p, "").unwrap());
    dir.run(["job", "run", "the.job", "settle-1-0"]).failed_with(2, &["the.job", ".records", "plan the job anew"]);
}

#[test]
fn units_are_listed_for_people_and_for_programs() {
    let dir = stage();
    plan(&dir);
    let names = dir.succeed(["job", "units", "the.job"]).stdout();
    let names: Vec<&str> = names.lines().collect();
    assert_eq!(names, ["read-1-0", "read-1-1", "read-1-2", "read-1-3"]);
    let json =
        || -> Value { serde_json::from_str(&dir.succeed(["job", "units", "the.job", "--json"]).stdout()).unwrap() };
    let all = json();
    assert_eq!((&all["complete"], &all["ready"][3]), (&Value::from(false), &Value::from("read-1-3")));
    assert_eq!((&all["units"][1]["points"], &all["units"][1]["done"]), (&Value::from(60_000), &Value::from(false)));
    // from anywhere: the job knows where it was planned
    let folder = dir.path("the.job");
    let args = ["job", "run", folder.to_str().unwrap(), "read-1-1"];
    assert!(dir.command(args).current_dir(std::env::temp_dir()).status().unwrap().success());
    assert_eq!(json()["units"][1]["done"], true);
    let status: Value = serde_json::from_str(&dir.succeed(["job", "status", "the.job", "--json"]).stdout()).unwrap();
    assert_eq!(status["read"], serde_json::json!({ "done": 1, "units": 4 }));
    assert_eq!(dir.succeed(["job", "status", "the.job"]).stdout(), "1 of 4 units to read are done\n");
    dir.succeed(["job", "run", "the.job", "read-1-0", "read-1-2", "read-1-3"]);
    assert_eq!(dir.succeed(["job", "units", "the.job"]).stdout(), "settle-1-0\n");
}

#[test]
fn mistakes_are_one_line_and_leave_the_job_alone() {
    let dir = stage();
    dir.run(["job", "units", "scans"]).failed_with(2, &["not the folder of a planned job", "job plan"]);
    dir.run(["job", "units", "nowhere"]).failed_with(2, &["nowhere", "not the folder of a planned job"]);
    dir.run(["job", "plan", "scans", "-o", "out", "--job", "out/the.job"]).failed_with(2, &["inside of the output"]);
    dir.run(["job", "plan", "--files-from", "-", "-o", "out", "--job", "the.job"]).failed_with(2, &["--files-from -"]);
    dir.run(["job", "plan", "scans", "-o", "out", "--job", "scans"]).failed_with(2, &["not empty", "another folder"]);
    dir.run(["job", "plan", "scans", "-o", "plain", "--job", "the.job"]).failed_with(2, &["plain", "--overwrite"]);
    dir.run(["job", "plan", "scans", "-o", "out", "--job", "the.job", "--resume"]).failed_with(2, &["--resume"]);
    dir.run(["job", "plan", "scans", "-o", "out"]).failed_with(2, &["--job"]);
    let inside = ["job", "plan", "scans", "-o", "out", "--job", "the.job", "--report", "the.job/report.json"];
    dir.run(inside).failed_with(2, &["--report", "folder of the job"]);
    assert_eq!(dir.names(), ["plain", "scans"]);
    plan(&dir);
    dir.run(["job", "plan", "scans", "-o", "out", "--job", "the.job"]).failed_with(2, &["the.job", "not empty"]);
    dir.run(["job", "run", "the.job"]).failed_with(2, &[]);
    dir.run(["job", "run", "the.job", "build-x"]).failed_with(2, &["build-x", "job units"]);
    dir.run(["job", "run", "the.job", "build-0-0"]).failed_with(2, &["build-0-0", "not yet"]);
    dir.run(["job", "run", "the.job", "--share", "4/3"]).failed_with(2, &["4/3", "I/N"]);
    dir.run(["job", "finish", "the.job"]).failed_with(2, &["4 of 4", "read-1-0"]);
    dir.write("the.job/plan.json", b"{}");
    dir.run(["job", "units", "the.job"]).failed_with(3, &["plan.json"]);
    assert_eq!(dir.names(), ["plain", "scans", "the.job"]);
}
