//! Datasets as inputs: what a dataset holds comes back, whichever format it went through.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use pointmill_format::potree2::Dataset;
use pointmill_format::{Column, NodePoints, with_column};
use pointmill_testkit::files::{assert_same_dataset, dataset, fixture_bytes};
use pointmill_testkit::las::Las;

use crate::support::Dir;

/// Scans of all kinds of values: colours, times, scaled extra bytes, a WKT.
fn with_scans() -> Dir {
    let dir = Dir::new();
    dir.write("terrain.las", &Las::terrain(30_000, 1).bytes());
    dir.write("format7.laz", &fixture_bytes("las/format7.laz"));
    dir.write("pages.copc.laz", &fixture_bytes("copc/pages.copc.laz"));
    dir
}

fn convert(dir: &Dir, input: &str, output: &str, options: &[&str]) {
    let args = ["convert", input, "-o", output, "-q", "--name", "same", "--leaf-capacity", "500"];
    dir.succeed(args.iter().chain(options));
}

/// All points of a Potree 2.0 dataset, sorted: world coordinates in steps, then all columns by name.
fn records(dataset: &Path) -> BTreeMap<Vec<u64>, u64> {
    records_of(dataset, |_, value| value)
}

/// [`records`], of which the values of columns are changed.
#[allow(clippy::unnecessary_cast)] // one of the ten types is the target
fn records_of(dataset: &Path, change: impl Fn(&str, f64) -> f64) -> BTreeMap<Vec<u64>, u64> {
    let dataset = Dataset::open(dataset).unwrap();
    let (mut points, mut records) = (NodePoints::default(), BTreeMap::new());
    for node in dataset.read_hierarchy().unwrap() {
        dataset.read_points(&node, &mut points).unwrap();
        let scale = dataset.metadata().lattice.scale;
        let mut columns: Vec<(&str, &Column)> = points.names().zip(points.columns()).collect();
        columns.sort_by_key(|(name, _)| *name);
        for i in 0..points.len() {
            let world = points.world(i).unwrap();
            let mut record: Vec<u64> = (0..3).map(|a| (world[a] / scale[a]).round().to_bits()).collect();
            for (name, column) in &columns {
                with_column!(column, values => {
                    let elements = values.len() / points.len();
                    let values = &values[i * elements..(i + 1) * elements];
                    record.extend(values.iter().map(|v| change(name, *v as f64).to_bits()));
                });
            }
            *records.entry(record).or_insert(0) += 1;
        }
    }
    records
}

/// Colours as formats with 8 bits have them.
fn eight_bit(name: &str, value: f64) -> f64 {
    if name == "rgb" { ((value as u64 * 255 + 32_767) / 65_535 * 257) as f64 } else { value }
}

#[test]
fn an_octree_converted_again_is_the_same_byte_for_byte() {
    let dir = with_scans();
    for scan in ["terrain.las", "format7.laz", "pages.copc.laz"] {
        convert(&dir, scan, "direct", &["--overwrite"]);
        for encoding in ["default", "brotli"] {
            convert(&dir, scan, "first", &["--overwrite", "--encoding", encoding]);
            convert(&dir, "first", "second", &["--overwrite"]);
            let what = format!("{scan}, {encoding}");
            assert_same_dataset(&dataset(&dir.path("second")), &dataset(&dir.path("direct")), &what);
            dir.validate("second", &["first"]);
            // its report is about the dataset that it was made from
            fs::remove_file(dir.path("second/report.json")).unwrap();
            dir.validate("second", &[scan]);
        }
        assert!(records(&dir.path("second")) == records(&dir.path("direct")), "{scan}");
    }
}

#[test]
fn potree_1_gives_all_points_back() {
    let dir = with_scans();
    for scan in ["terrain.las", "format7.laz", "pages.copc.laz"] {
        convert(&dir, scan, "direct", &["--overwrite", "--attributes", "intensity,classification,gps-time"]);
        let options = ["--overwrite", "--to", "potree1", "--potree1-version", "1.8"];
        let attributes = ["--attributes", "intensity,classification,gps-time"];
        convert(&dir, scan, "first", &[&options[..], &attributes].concat());
        convert(&dir, "first", "second", &[&["--overwrite"][..], &attributes].concat());
        assert!(records(&dir.path("second")) == records(&dir.path("direct")), "{scan}");
        // the marker file stands for the folder
        dir.validate("second", &["first/cloud.js"]);
        dir.validate("second", &["first"]);
    }
}

#[test]
fn every_attribute_of_version_1_8_comes_back_under_its_name() {
    let dir = with_scans();
    convert(&dir, "format7.laz", "first", &["--to", "potree1", "--potree1-version", "1.8", "--attributes", "all"]);
    convert(&dir, "first", "second", &[]);
    // colours have 8 bits there
    let ended = dir.run(["validate", "second", "--against", "format7.laz", "--json"]);
    let report: serde_json::Value = serde_json::from_str(&ended.stdout()).unwrap();
    let names = |name: &str| {
        let dataset = Dataset::open(dir.path(name)).unwrap();
        let mut names: Vec<_> = dataset.metadata().attributes.iter().map(|a| a.attribute.clone()).collect();
        names.sort_by(|a, b| a.name.cmp(&b.name));
        names.into_iter().map(|a| (a.name, a.scale, a.offset)).collect::<Vec<_>>()
    };
    convert(&dir, "format7.laz", "direct", &[]);
    assert_eq!(names("second"), names("direct"), "{report}");
}

#[test]
fn a_projection_without_more_is_kept() {
    let dir = with_scans();
    let system = "+proj=tmerc +lat_0=1 +lon_0=9 +k=0.9 +x_0=5 +y_0=6 +ellps=GRS80 +units=m +no_defs";
    for format in ["potree2", "potree1"] {
        convert(&dir, "terrain.las", "first", &["--overwrite", "--to", format, "--crs", system]);
        convert(&dir, "first", "second", &["--overwrite"]);
        assert_eq!(Dataset::open(dir.path("second")).unwrap().metadata().projection, system, "{format}");
    }
    // the points are where they were said to be
    let args = ["convert", "first", "-o", "moved", "-q", "--reproject", "EPSG:25832"];
    let ended = dir.run(args);
    assert!(!ended.stderr().contains("no coordinate reference system"), "{}", ended.stderr());
}

#[test]
fn binary_trees_give_all_values_back() {
    let dir = with_scans();
    for scan in ["terrain.las", "pages.copc.laz"] {
        convert(&dir, scan, "direct", &["--overwrite"]);
        for layout in ["files", "packed"] {
            dir.succeed([
                "convert",
                scan,
                "-o",
                "first",
                "-q",
                "--overwrite",
                "--to",
                "bintree",
                "--layout",
                layout,
                "--capacity",
                "100",
                "--attributes",
                "all",
            ]);
            convert(&dir, "first", "second", &["--overwrite"]);
            assert!(records(&dir.path("second")) == records(&dir.path("direct")), "{scan}, {layout}");
            dir.validate("second", &["first"]);
        }
    }
    // leaves of 4,000 km with steps of 2 mm
    dir.succeed(["convert", "format7.laz", "-o", "first", "-q", "--overwrite", "--to", "bintree", "--capacity", "100"]);
    let said = dir.succeed(["convert", "first", "-o", "second", "--overwrite"]).stderr();
    assert!(said.contains("more than half a step of the points' own lattice"), "{said}");
}

#[test]
fn batches_give_colours_back_as_they_were_before_averaging() {
    let dir = with_scans();
    for scan in ["terrain.las", "pages.copc.laz"] {
        convert(&dir, scan, "direct", &["--overwrite"]);
        for options in [&[][..], &["--compress", "zstd:3"]] {
            let args = ["convert", scan, "-o", "first", "-q", "--overwrite", "--to", "batches", "--attributes", "all"];
            dir.succeed(args.iter().chain(options));
            convert(&dir, "first", "second", &["--overwrite"]);
            let direct = records_of(&dir.path("direct"), eight_bit);
            assert!(records_of(&dir.path("second"), eight_bit) == direct, "{scan}, {options:?}");
            dir.validate("second", &["first"]);
        }
    }
    let args = ["convert", "terrain.las", "-o", "first", "-q", "--overwrite", "--to", "batches", "--no-originals"];
    dir.succeed(args);
    let said = dir.succeed(["convert", "first", "-o", "second", "--overwrite"]).stderr();
    assert!(said.contains("means of their cells"), "{said}");
}

#[test]
fn datasets_are_read_within_little_memory() {
    let dir = Dir::new();
    dir.write("a.las", &Las::terrain(1_350_000, 1).bytes());
    for format in ["potree2", "batches"] {
        dir.succeed(["convert", "a.las", "-o", "first", "-q", "--overwrite", "--to", format, "--attributes", "all"]);
        let args = ["convert", "first", "-o", "second", "-q", "--overwrite", "--name", "same"];
        dir.succeed(args);
        let ample = dataset(&dir.path("second"));
        dir.succeed(args.iter().chain(&["--memory", "112MiB", "--threads", "1"]));
        let report = dir.report("second");
        assert!(dataset(&dir.path("second")) == ample, "{format}: the datasets differ");
        if let Some(peak) = report["peak_memory_bytes"].as_u64() {
            assert!(peak <= 112 << 20, "{format}: the resident set rose to {} MiB", peak >> 20);
        }
    }
}
