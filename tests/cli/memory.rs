//! The memory ceiling on scenes that are hard to hold: the least ceiling that the program names is enough, it is kept, and
//! it changes no byte of the dataset.

use pointmill_testkit::Random;
use pointmill_testkit::files::dataset;
use pointmill_testkit::las::{Las, Point};
use pointmill_testkit::las_records::with_extra;

use crate::support::Dir;

const FORMATS: [&str; 3] = ["potree2", "bintree", "batches"];

/// The least ceiling with which a run can begin, MiB, as the program says when it is refused.
fn least(dir: &Dir, options: &[&str]) -> u64 {
    let args = ["convert", "scan.las", "-o", "refused", "--memory", "1MiB"];
    let refused = dir.run(args.iter().chain(options));
    refused.failed_with(6, &["--memory"]);
    let text = refused.stderr();
    let number = text.rsplit("--memory ").next().and_then(|rest| rest.split("MiB").next());
    number.and_then(|n| n.parse().ok()).unwrap_or_else(|| panic!("no ceiling in {text}"))
}

/// Converts `scan` to each format with the least ceiling and with plenty.
fn check(scan: &[u8], options: &[&str]) {
    let dir = Dir::new();
    dir.write("scan.las", scan);
    for format in FORMATS {
        let options = [&["--to", format, "--threads", "2"], options].concat();
        let least = least(&dir, &options);
        let convert = |out: &str, memory: &str| {
            let args = ["convert", "scan.las", "-o", out, "-q", "--name", "same", "--memory", memory];
            dir.succeed(args.iter().chain(&options));
        };
        convert(&format!("least-{format}"), &format!("{least}MiB"));
        convert(&format!("plenty-{format}"), "8GiB");
        let report = dir.report(&format!("least-{format}"));
        if let Some(peak) = report["peak_memory_bytes"].as_u64() {
            assert!(peak <= least << 20, "{format}: {} MiB of {least}", peak >> 20);
        }
        let warnings = report["warnings"].as_array().unwrap();
        assert!(warnings.iter().all(|w| w["kind"] != "above_ceiling"), "{warnings:?}");
        let [scarce, ample] = ["least", "plenty"].map(|name| dataset(&dir.path(&format!("{name}-{format}"))));
        assert!(scarce == ample, "{format}: the datasets differ");
    }
}

fn scattered(points: usize, side: u64) -> impl Iterator<Item = [i32; 3]> {
    let mut random = Random::new(9);
    (0..points).map(move |_| std::array::from_fn(|_| random.below(side) as i32))
}

#[test]
fn a_volume_in_random_order() {
    check(&Las::numbered(scattered(1_600_000, 500_000)).bytes(), &[]);
}

#[test]
fn records_of_more_than_two_hundred_bytes() {
    let las = Las::numbered(scattered(250_000, 500_000)).bytes();
    let doubles = |i: usize| (0..25).flat_map(|k| ((i * k) as f64).to_le_bytes()).collect();
    check(&with_extra(&las, doubles), &["--attributes", "all"]);
}

#[test]
fn most_points_in_one_place() {
    let mut random = Random::new(4);
    let point = |i| Point { intensity: random.next_u32() as u16, ..Point::numbered(i, [7_000, -3_000, 12]) };
    let mut las = Las::numbered([[0; 3]]);
    las.points = (0..1_500_000).map(point).collect();
    las.points.extend(scattered(1000, 9_000).enumerate().map(|(i, xyz)| Point::numbered(i, xyz)));
    check(&las.bytes(), &[]);
}

#[test]
fn a_leaf_of_more_points_than_fit() {
    let dir = Dir::new();
    dir.write("scan.las", &Las::numbered(scattered(1_500_000, 100)).bytes());
    let options = ["--to", "bintree", "--capacity", "2000000", "--threads", "1", "-q", "--name", "same"];
    let least = least(&dir, &options[..6]);
    for (out, memory) in [("least", format!("{least}MiB")), ("plenty", "8GiB".into())] {
        dir.succeed(["convert", "scan.las", "-o", out, "--memory", &memory].iter().chain(&options));
    }
    assert!(dataset(&dir.path("least")) == dataset(&dir.path("plenty")));
    assert!(dir.report("least")["peak_memory_bytes"].as_u64().is_none_or(|peak| peak <= least << 20));
}

#[test]
fn two_dense_clusters_far_apart() {
    let mut las = Las::numbered(scattered(1_500_000, 1 << 10));
    las.points.iter_mut().step_by(2).for_each(|p| p.xyz = p.xyz.map(|v| v + 1_000_000_000));
    check(&las.bytes(), &["--outliers", "keep"]);
}

#[test]
fn outliers_at_every_power_of_ten() {
    let mut las = Las::numbered(scattered(1_500_000, 1 << 10));
    for (power, at) in (3..10).zip(las.points.iter_mut().step_by(1000)) {
        at.xyz = [10i32.pow(power), -(10i32.pow(power)), 0];
    }
    check(&las.bytes(), &["--outliers", "keep"]);
}
