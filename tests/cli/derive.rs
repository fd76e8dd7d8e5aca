//! `convert --derive`: what it takes, what it refuses, and that the validator agrees.

use pointmill_testkit::las::Las;

use crate::support::Dir;

#[test]
fn surfels_of_every_output_are_validated_against_the_scan() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(20_000, 3).bytes());
    for format in ["potree2", "potree1", "copc", "bintree", "batches"] {
        for more in [&["--neighbours", "9", "--orient", "up"][..], &["--neighbour-radius", "4", "--orient", "0,0,1e5"]]
        {
            let options =
                ["convert", "a.las", "-o", "out", "-q", "--overwrite", "--to", format, "--derive", "normals,radius"];
            dir.succeed([&options, more].concat());
            let report = dir.report("out");
            assert_eq!(report["derived"]["points"], 20_000, "{format}");
            let text = dir.succeed(["validate", "out", "--against", "a.las"]).stdout();
            for check in ["normals", "surfels"] {
                let is_ok = |line: &str| line.trim_start().starts_with("ok") && line.contains(check);
                assert!(text.lines().any(is_ok), "{format}: {check}\n{text}");
            }
        }
    }
    dir.succeed(["convert", "a.las", "-o", "verified", "-q", "--verify=scans", "--derive", "normals"]);
}

#[test]
fn what_makes_no_sense_is_a_line_and_no_output() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(500, 3).bytes());
    dir.succeed(["convert", "a.las", "-o", "made", "-q", "--derive", "normals"]);
    let refused = |options: &[&str], words: &str| {
        let ended = dir.run([&["convert", "a.las", "-o", "out"], options].concat());
        let said = ended.stderr();
        assert_eq!(ended.code(), 2, "{options:?}: {said}");
        assert!(said.lines().count() == 1 && said.contains(words), "{options:?}: {said}");
        assert!(!dir.path("out").exists());
    };
    refused(&["--derive", "colours"], "expected normals, normals=replace or radius");
    refused(&["--derive", "normals", "--neighbours", "2"], "--neighbours '2'");
    refused(&["--derive", "normals", "--neighbours", "8", "--neighbour-radius", "1"], "exclude each other");
    refused(&["--derive", "normals", "--neighbour-radius", "0"], "expected a length above 0");
    refused(&["--derive", "normals", "--orient", "1,2"], "expected scanner, up, none or a place");
    refused(&["--neighbours", "8"], "--derive");
    for derive in [&["--derive", "normals"][..], &[]] {
        let ended = dir.run([&["convert", "a.las", "-o", "made", "--append"], derive].concat());
        assert_eq!(ended.code(), 2, "{}", ended.stderr());
    }
    let ended = dir.run(["job", "plan", "a.las", "-o", "out", "--job", "job", "--derive", "normals"]);
    assert!(ended.code() == 2 && ended.stderr().contains("--derive: "), "{}", ended.stderr());
    assert!(!dir.path("job").exists());
}
