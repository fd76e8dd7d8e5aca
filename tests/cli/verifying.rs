//! `convert --verify`: what was made is validated before it gets its name. What happens when it is not valid is tested beside
//! the code, where a dataset can be broken in between.

use pointmill_testkit::files::dataset;
use pointmill_testkit::las::Las;

use crate::support::Dir;

#[test]
fn every_format_passes_and_is_the_same_as_without() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(3000, 1).bytes());
    dir.write("b.las", &Las::terrain(2000, 2).bytes());
    for format in ["potree2", "potree1", "copc", "bintree", "batches"] {
        let ended = dir.succeed(["convert", "a.las", "b.las", "-o", "out", "--to", format, "--verify=scans"]);
        assert!(ended.stderr().contains("holds every point once"), "{format}: {}", ended.stderr());
        dir.succeed(["convert", "a.las", "b.las", "-o", "plain", "--to", format, "-q"]);
        assert_eq!(dataset(&dir.path("out")), dataset(&dir.path("plain")), "{format}");
        for folder in ["out", "plain"] {
            std::fs::remove_dir_all(dir.path(folder)).unwrap();
        }
    }
}

#[test]
fn filters_several_outputs_and_an_output_that_is_replaced_are_validated_too() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(3000, 1).bytes());
    let several = ["convert", "a.las", "-o", "out", "--to", "potree2", "--to", "batches", "--every", "3"];
    for more in [&["--verify"][..], &["--verify=scans", "--overwrite"], &["--verify=dataset", "--overwrite", "-q"]] {
        let ended = dir.succeed([&several[..], more].concat());
        let is_told = ended.stderr().contains("validated before it got its name");
        assert_eq!(is_told, !more.contains(&"-q"), "{}", ended.stderr());
    }
    dir.validate("out", &["a.las"]);
    assert_eq!(dir.names(), ["a.las", "out"]);
}
