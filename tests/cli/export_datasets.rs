//! From datasets back to files: what the scans had comes back, as far as the dataset kept it.

use std::fs;

use pointmill_testkit::las_records::random_las;
use serde_json::Value;

use crate::export::{OFFSET, SCALE, records};
use crate::support::Dir;

fn export(dir: &Dir, dataset: &str, output: &str, options: &[&str]) -> Value {
    let args = ["export", dataset, "-o", output, "--json", "-q", "--overwrite"];
    serde_json::from_str(&dir.succeed(args.iter().chain(options)).stdout()).unwrap()
}

#[test]
fn records_come_back_from_datasets_that_kept_all_attributes() {
    let dir = Dir::new();
    for format in 0..=10u8 {
        let las = random_las(format, 2500, SCALE, OFFSET, 100_000);
        dir.write("in.las", &las);
        let small = ["--leaf-capacity", "300"];
        for (to, small) in [
            (&["potree2"][..], &small[..]),
            (&["potree2", "--encoding", "brotli"], &small),
            (&["potree1", "--potree1-version", "1.8"], &small),
            (&["bintree"], &[]),
            (&["batches"], &[]),
        ] {
            let options = [&["--attributes", "all", "--rgb-depth", "16", "--overwrite", "-q"], small].concat();
            let convert = ["convert", "in.las", "-o", "dataset", "--to"];
            dir.succeed(convert.iter().chain(to).chain(&options));
            let report = export(&dir, "dataset", "out.las", &[]);
            assert_eq!(report["points"]["written"], 2500, "{report}");
            let out = fs::read(dir.path("out.las")).unwrap();
            let (mut found, mut expected) = (records(&out), records(&las));
            if to[0] != "potree2" {
                // which have 8 bits for a colour
                without_colours(&mut found, format);
                without_colours(&mut expected, format);
            }
            let first = found.iter().zip(&expected).find(|(a, b)| a != b);
            assert!(found == expected, "{format} {to:?}: {first:?}");
        }
    }
}

/// Zeros for colours.
fn without_colours(records: &mut [(Vec<i64>, Vec<u8>)], format: u8) {
    let at = match format {
        2 => 8,
        3 | 5 => 16,
        7 | 8 | 10 => 18,
        _ => return,
    };
    records.iter_mut().for_each(|(_, fields)| fields[at..at + 6].fill(0));
    records.sort_unstable();
}

#[test]
fn levels_and_spacings_thin_an_octree() {
    let dir = Dir::new();
    dir.write("in.las", &random_las(3, 20_000, SCALE, OFFSET, 10_000));
    dir.succeed(["convert", "in.las", "-o", "tree", "-q", "--leaf-capacity", "500", "--rgb-depth", "16"]);
    let written = |options: &[&str]| export(&dir, "tree", "out.laz", options)["points"]["written"].as_u64().unwrap();
    let levels: Vec<u64> = (0..4).map(|level| written(&["--level", &level.to_string()])).collect();
    assert!(levels.windows(2).all(|pair| pair[0] <= pair[1]) && levels[0] > 0 && levels[0] < 20_000, "{levels:?}");
    let tree = dir.report("tree");
    let per_level: Vec<u64> = tree["outputs"][0]["tree"]["points_per_level"]
        .as_array()
        .unwrap()
        .iter()
        .map(|n| n.as_u64().unwrap())
        .collect();
    for (level, points) in levels.iter().enumerate() {
        assert_eq!(*points, per_level.iter().take(level + 1).sum::<u64>(), "{level}");
    }
    assert_eq!(written(&[]), 20_000);
    assert_eq!(written(&["--spacing", "1e-9"]), 20_000);
    assert_eq!(written(&["--spacing", "1e9"]), per_level[0]);
    dir.run(["export", "tree", "-o", "x.las", "--spacing", "0"]).failed_with(2, &["--spacing"]);
    dir.run(["export", "tree", "-o", "tree/x.las"]).failed_with(2, &["tree"]);
}

#[test]
fn bounds_and_classes_cut_datasets_as_they_cut_scans() {
    let dir = Dir::new();
    let las = random_las(6, 5000, SCALE, OFFSET, 10_000);
    dir.write("in.las", &las);
    dir.succeed(["convert", "in.las", "-o", "tree", "-q", "--leaf-capacity", "500"]);
    let cut = ["--bounds", "500010,5400010,100..500070,5400080,190", "--class", "1,2,3,4,5,6,7,8,9,10,200"];
    let from_tree = export(&dir, "tree", "tree.las", &cut);
    let from_scan = export(&dir, "in.las", "scan.las", &cut);
    for name in ["read", "written", "outsideBounds", "otherClass"] {
        assert_eq!(from_tree["points"][name], from_scan["points"][name], "{name}");
    }
    let [tree, scan] = ["tree.las", "scan.las"].map(|name| fs::read(dir.path(name)).unwrap());
    assert!(records(&tree) == records(&scan));
    assert!(!records(&tree).is_empty());
}
