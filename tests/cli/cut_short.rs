//! Inputs that were cut short: exit code 3, one line with file and byte, nothing left. The readers' and the converter's
//! own tests cut every fixture at 64 places; here is what a user sees, for one file of each kind.

use std::fs;
use std::path::Path;

use pointmill_testkit::files::{corpus, fixture};

use crate::support::Dir;

#[test]
fn a_scan_that_was_cut_short_is_one_line_and_nothing_else() {
    for name in [
        "las/format3.las",
        "las/format7.laz",
        "e57/scans.e57",
        "rows/all_ascii.ply",
        "rows/all_little.ply",
        "rows/open3d_f8_binary.pcd",
        "rows/open3d_f8_compressed.pcd",
        "rows/two_counts.pts",
        "rows/two_scans.ptx",
        "rows/open3d.off",
    ] {
        let bytes = fs::read(fixture(name)).unwrap();
        let short = Path::new(name).file_name().unwrap().to_str().unwrap();
        // a few bytes, half of the header or so, half of the file
        for cut in [0, 2, bytes.len().min(300) / 2, bytes.len() / 2] {
            let dir = Dir::new();
            dir.write(short, &bytes[..cut]);
            let ended = dir.run(["convert", short, "-o", "out", "-q"]);
            ended.failed_with(3, &[short, "(byte "]);
            assert_eq!(ended.stderr().lines().count(), 1, "{}", ended.stderr());
            assert_eq!(dir.names(), [short], "{name} cut to {cut}");
        }
    }
}

/// Found by fuzzing: a layered chunk whose GPS times switch sequences for ever, and runs of 0xFF. Either made a decoder
/// call itself until the stack was full. The rest of a city is converted without them.
#[test]
fn laz_chunks_that_no_encoder_wrote_are_a_broken_input() {
    let dir = Dir::new();
    fs::create_dir(dir.path("city")).unwrap();
    let times = fs::read(fixture("broken/gps_time_recursion.laz")).unwrap();
    let mut runs = fs::read(fixture("las/format1.laz")).unwrap();
    let len = runs.len();
    runs[len - 2000..len - 200].fill(0xff);
    for (name, bytes) in [("city/times.laz", &times), ("city/runs.laz", &runs)] {
        dir.write(name, bytes);
        for command in [&["info", "--deep", name][..], &["convert", name, "-o", "out", "-q"]] {
            let ended = dir.run(command);
            ended.failed_with(3, &[name, "gives 0 of its 150 points: the compressed bytes make no sense (byte "]);
            assert_eq!(ended.stderr().lines().count(), 1, "{}", ended.stderr());
        }
        assert_eq!(dir.names(), ["city"]);
    }
    fs::copy(fixture("las/format1.laz"), dir.path("city/sound.laz")).unwrap();
    dir.succeed(["convert", "city", "-o", "out", "-q", "--unreadable", "skip"]);
    let report = dir.report("out");
    assert_eq!((&report["outputs"][0]["points"], &report["points"]["unreadable"]), (&150.into(), &300.into()));
}

/// Broken files of others: refused with file and byte, or read whole because what is broken in them concerns no point.
#[test]
fn broken_scans_of_others_are_refused_or_read_whole() {
    let Some(folder) = corpus("broken") else { return };
    // in docs/inputs.md, with what is broken in them
    let read_whole = [
        ("bad-geotiff-keys.las", 10),
        ("bad_vlr_count.las", 10),
        ("read_error.e57", 2651),
        ("simple-laszip-compressor-version-1.2r0.laz", 1065),
        ("spurious.las", 1065),
    ];
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let (dir, name) = (Dir::new(), path.file_name().unwrap().to_str().unwrap().to_owned());
        let ended = dir.run(["convert", path.to_str().unwrap(), "-o", "out", "-q"]);
        match read_whole.iter().find(|(n, _)| *n == name) {
            Some((_, points)) => {
                assert_eq!(ended.code(), 0, "{}", ended.stderr());
                assert_eq!(dir.report("out")["outputs"][0]["points"], *points, "{name}");
                dir.validate("out", &[path.to_str().unwrap()]);
            }
            None => {
                ended.failed_with(3, &[&name, "(byte "]);
                assert_eq!(ended.stderr().lines().count(), 1, "{}", ended.stderr());
                assert!(dir.names().is_empty(), "{name}: {:?}", dir.names());
            }
        }
    }
}
