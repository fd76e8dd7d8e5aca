//! The bytes are those of the plain writer of the format crate, however the work was cut up.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use pointmill_format::batches::{
    AlignedBytes, Batches, Cloud, ColourSource, Description, Header, WriteOptions, Written, colour_word, compress,
    eight_bit, write,
};
use pointmill_format::{Attribute, AttributeType, DatasetKind, Lattice};
use pointmill_testkit::Random;
use pointmill_testkit::files::assert_same_bytes;
use pointmill_testkit::las::{self, Las};

use super::BatchesSettings;
use crate::plan::{AttributeChoice, Plan, Setting};
use crate::report::Report;
use crate::runtime::Silent;
use crate::warning::{ColourNote, Warning};
use crate::{ConvertError, convert};

fn colours(note: ColourNote) -> Warning {
    Warning::Colours { format: DatasetKind::Batches, note }
}

/// A scan in memory.
#[derive(Clone)]
struct Scan {
    scale: [f64; 3],
    offset: [f64; 3],
    positions: Vec<[i32; 3]>,
    /// r, g, b, intensity, class.
    values: Vec<[u16; 5]>,
}

impl Scan {
    /// Points on a wavy surface of that extent in steps.
    fn surface(points: usize, extent: u64, scale: f64) -> Self {
        let mut n = Random::new(points as u64);
        let mut scan = Self { scale: [scale; 3], offset: [0.0; 3], positions: vec![], values: vec![] };
        for _ in 0..points {
            let (x, y) = (n.below(extent) as i32, n.below(extent) as i32);
            let z = (f64::from(x / 3 + y / 5).sin() * extent as f64 / 50.0) as i32 + n.below(3) as i32;
            scan.push([x, y, z], &mut n);
        }
        scan
    }

    fn push(&mut self, position: [i32; 3], n: &mut Random) {
        self.positions.push(position);
        self.values.push(std::array::from_fn(|i| n.below(if i == 4 { 7 } else { 65_536 }) as u16));
    }

    fn map(mut self, f: impl Fn([i32; 3]) -> [i32; 3]) -> Self {
        self.positions.iter_mut().for_each(|p| *p = f(*p));
        self
    }

    fn lattice(&self) -> Lattice {
        Lattice { scale: self.scale, offset: self.offset }
    }

    /// LAS, point format 2.
    fn write(&self, path: &Path) {
        let point = |(xyz, [red, green, blue, intensity, class]): (&[i32; 3], &[u16; 5])| las::Point {
            intensity: *intensity,
            class: *class as u8,
            rgb: [*red, *green, *blue],
            ..las::Point::at(*xyz)
        };
        let points = self.positions.iter().zip(&self.values).map(point).collect();
        let las = Las { point_format: 2, scale: self.scale, offset: self.offset, ..Las::new(points) };
        fs::write(path, las.bytes()).unwrap();
    }

    /// What the plain writer makes of it; `like` gives cell, planes and description.
    fn reference(&self, like: &[u8], with_extras: bool) -> (Vec<u8>, Written) {
        let header = Header::parse(like, Path::new("ours")).unwrap();
        let at = header.sections.description as usize;
        let text = &like[at..at + header.description_bytes as usize];
        let description = Description::from_json(text, Path::new("ours"), 0).unwrap();
        assert_eq!(Lattice::from(description.lattice), self.lattice());
        let options = WriteOptions::new(self.lattice()).cell(header.grid.cell).precision(header.precision());
        let options = options.description(description);
        let axis = |a: usize| -> Vec<i64> { self.positions.iter().map(|p| i64::from(p[a])).collect() };
        let (x, y, z) = (axis(0), axis(1), axis(2));
        let is_eight_bit = self.values.iter().all(|v| v[..3].iter().all(|c| *c < 256));
        let narrow = |c: u16| if is_eight_bit { c as u8 } else { eight_bit(c) };
        let colour = |v: &[u16; 5]| colour_word([v[0], v[1], v[2]].map(narrow), 0);
        let colours: Vec<u32> = self.values.iter().map(colour).collect();
        let intensity: Vec<u8> = self.values.iter().flat_map(|v| v[3].to_le_bytes()).collect();
        let class: Vec<u8> = self.values.iter().map(|v| v[4] as u8).collect();
        let extras = [
            (Attribute::new("intensity", AttributeType::UInt16, 1), &intensity[..]),
            (Attribute::new("classification", AttributeType::UInt8, 1), &class[..]),
        ];
        let attributes = if with_extras { &extras[..] } else { &[] };
        let mut cloud = Cloud::new(self.lattice(), [&x, &y, &z], &colours);
        cloud.attributes = attributes;
        let mut file = Cursor::new(Vec::new());
        let written = write(&mut file, &cloud, &options).unwrap();
        (file.into_inner(), written)
    }
}

/// A folder with the scan, and what is made of it.
struct Bench {
    dir: tempfile::TempDir,
    inputs: Vec<PathBuf>,
}

impl Bench {
    fn new(scans: &[&Scan]) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let inputs: Vec<PathBuf> = (0..scans.len()).map(|i| dir.path().join(format!("{i}.las"))).collect();
        scans.iter().zip(&inputs).for_each(|(scan, path)| scan.write(path));
        Self { dir, inputs }
    }

    fn plan(&self) -> Plan {
        let mut plan = Plan::new(self.inputs.clone(), self.dir.path().join("out"));
        plan.name = "cloud".into();
        plan.memory_bytes = 1 << 30;
        plan.threads = 2;
        plan.overwrite = true;
        plan
    }

    fn convert(&self, plan: &Plan, settings: BatchesSettings) -> Result<(Vec<u8>, Report), ConvertError> {
        let report = convert(plan, &[settings.into()], &Silent)?;
        Ok((fs::read(plan.output.join("points.qbatch")).unwrap(), report))
    }
}

fn cell(side: f64) -> BatchesSettings {
    BatchesSettings { lod_cell: Some(side), ..BatchesSettings::default() }
}

/// Converts with several numbers of threads and sizes of tasks, and compares with the plain writer.
fn check(what: &str, scan: &Scan, settings: BatchesSettings) {
    let bench = Bench::new(&[scan]);
    let points = scan.positions.len() as u64;
    for (threads, task_points, extras) in [(1, points, false), (2, points / 3, true), (3, 1_000, true), (4, 130, true)]
    {
        let mut plan = bench.plan();
        plan.threads = threads;
        plan.task_points = Some(task_points);
        if extras {
            plan.attributes = AttributeChoice::List(vec!["intensity".into(), "rgb".into(), "classification".into()]);
        }
        let (ours, report) = bench.convert(&plan, settings).unwrap();
        let (expected, written) = scan.reference(&ours, extras);
        assert_same_bytes(&ours, &expected, &format!("{what}, {threads} threads, tasks of {task_points} points"));
        let details = &report.outputs[0].details;
        assert_eq!(details["lod_points"], serde_json::json!(written.lod_points), "{what}");
        assert_eq!((report.outputs[0].points, report.outputs[0].bytes), (points, written.bytes));
        assert_eq!(report.checksum_in, report.outputs[0].checksum);
    }
}

#[test]
fn surfaces_give_the_bytes_of_the_plain_writer_with_cells_of_any_size() {
    let scan = Scan::surface(60_000, 3_000, 0.01);
    for side in [1.0, 0.3, 64.0, 7.0, 1e-3] {
        check(&format!("cell {side}"), &scan, cell(side));
    }
    check("auto", &scan, BatchesSettings { lod_cell: None, ..cell(1.0) });
}

#[test]
fn positions_that_repeat_are_ordered_by_all_they_have() {
    let mut n = Random::new(5);
    let places = Scan::surface(200, 1_000, 0.01);
    let mut scan = Scan { positions: vec![], values: vec![], ..places };
    for _ in 0..25_000 {
        scan.push(places.positions[n.below(200) as usize], &mut n);
    }
    scan.values.iter_mut().for_each(|v| *v = v.map(|c| c % 3));
    check("duplicates", &scan, cell(1.0));
    check("one place", &scan.map(|_| [5, -7, 123]), cell(1.0));
}

#[test]
fn every_lattice_and_extent_is_the_plain_writers() {
    let scan = Scan::surface(30_000, 2_000, 0.01);
    let unequal = Scan { scale: [0.01, 0.001, 0.1], offset: [-7.3, 1e5, 0.0], ..scan.clone() };
    check("unequal scales", &unequal, cell(0.5));
    let negative = scan.clone().map(|p| p.map(|v| v - 1_500));
    check("negative", &negative, cell(1.0));
    let far = Scan { scale: [0.001; 3], offset: [4_000_000.0, -600_000.3, 5_000_000.0], ..scan.clone() };
    check("far from the origin", &far, cell(0.25));
    let tiny = Scan { scale: [5e-7; 3], ..scan.clone() };
    check("a millimetre", &tiny, cell(1.0));
    check("a millimetre, fitting cells", &tiny, BatchesSettings { lod_cell: None, ..cell(1.0) });
    let wide = scan.clone().map(|p| [p[0] * 50_000, p[1] * 50_000 + 7, p[2]]);
    check("a million metres", &wide, cell(1.0));
    check("a million metres, coarse cells", &wide, cell(1000.0));
    let flat = scan.map(|p| [p[0], 4, 4]);
    check("a line", &flat, cell(1.0));
}

#[test]
fn batches_may_be_full_partial_or_a_single_point() {
    for points in [1, 2, 10_239, 10_240, 10_241, 20_480, 51_200] {
        check(&format!("{points} points"), &Scan::surface(points, 700, 0.01), cell(1.0));
    }
}

#[test]
fn planes_are_left_out_when_asked_or_not_needed() {
    let scan = Scan::surface(21_000, 900, 0.01);
    for planes in [Some(1), Some(2), Some(3), None] {
        let settings = BatchesSettings { planes, ..cell(1.0) };
        check(&format!("{planes:?}"), &scan, settings);
        let bench = Bench::new(&[&scan]);
        let (bytes, report) = bench.convert(&bench.plan(), settings).unwrap();
        let bits = Header::parse(&bytes, Path::new("")).unwrap().precision().bits();
        assert_eq!(bits, planes.map_or(10, |p| 10 * u32::from(p)), "9 m in steps of 1 cm");
        assert_eq!(report.outputs[0].details["planes"], bits);
    }
    // most batches are small, some are not: detected at the end
    let mut clusters = scan.map(|p| p.map(|v| v / 4));
    clusters.positions.iter_mut().step_by(2).for_each(|p| p[0] += 100_000);
    check("clusters", &clusters, cell(1.0));
}

#[test]
fn neither_memory_nor_the_order_of_inputs_shows() {
    let scan = Scan::surface(240_000, 12_000, 0.01);
    let bench = Bench::new(&[&scan]);
    let mut plan = bench.plan();
    plan.threads = 1;
    let (expected, _) = bench.convert(&plan, cell(1.0)).unwrap();
    plan.memory_bytes = 1 << 20;
    let Err(ConvertError::Memory { needed, .. }) = bench.convert(&plan, cell(1.0)) else { panic!("1 MiB cannot do") };
    (plan.memory_bytes, plan.waiting_bytes) = (needed, Some(1 << 20));
    let (spilled, report) = bench.convert(&plan, cell(1.0)).unwrap();
    assert!(report.temp_bytes > 0);
    assert_same_bytes(&spilled, &expected, "spilled");

    let mut parts = [scan.clone(), scan.clone(), scan.clone()];
    for (k, part) in parts.iter_mut().enumerate() {
        part.positions = scan.positions.iter().skip(k).step_by(3).rev().copied().collect();
        part.values = scan.values.iter().skip(k).step_by(3).rev().copied().collect();
    }
    let bench = Bench::new(&[&parts[2], &parts[0], &parts[1]]);
    let mut plan = bench.plan();
    plan.task_points = Some(9_999);
    let (joined, _) = bench.convert(&plan, cell(1.0)).unwrap();
    assert_same_bytes(&joined, &expected, "three files");
}

#[test]
fn colours_of_eight_bits_keep_their_values_also_beside_others() {
    let mut eight = Scan::surface(5_000, 700, 0.01);
    eight.values.iter_mut().for_each(|v| *v = v.map(|c| c % 256));
    check("8 bits", &eight, cell(1.0));
    let mut wide = eight.clone();
    wide.values.iter_mut().for_each(|v| *v = v.map(|c| c * 257));
    let ours = |scan| {
        let bench = Bench::new(&[scan]);
        bench.convert(&bench.plan(), cell(1.0)).unwrap()
    };
    let (narrow, report) = ours(&eight);
    assert!(!report.warnings.contains(&colours(ColourNote::Narrowed)), "{:?}", report.warnings);
    let (widened, report) = ours(&wide);
    assert!(report.warnings.contains(&colours(ColourNote::Narrowed)), "{:?}", report.warnings);
    assert_same_bytes(&narrow, &widened, "the same colours");
}

#[test]
fn without_colour_grey_shows_the_intensity_and_its_range_is_reported() {
    let bench = Bench::new(&[]);
    let points: Vec<String> = (0..300).map(|i| format!("{} {} 0 {}", i % 20, i / 20, 1000 + i)).collect();
    let (path, head) = (bench.dir.path().join("a.xyz"), "x y z intensity");
    fs::write(&path, format!("{head}\n{}\n", points.join("\n"))).unwrap();
    let mut plan = bench.plan();
    plan.inputs = vec![path.clone()];
    let (ours, report) = bench.convert(&plan, cell(100.0)).unwrap();
    let ours = Batches::from_bytes(AlignedBytes::from(ours.as_slice()), Path::new("")).unwrap();
    let description = ours.description();
    assert_eq!(description.colour, ColourSource::Intensity);
    assert_eq!(description.extra["intensityRange"], serde_json::json!([1000, 1299]));
    assert!(report.warnings.contains(&colours(ColourNote::Grey { least: 1000.0, greatest: 1299.0 })));
    assert_eq!(report.outputs[0].attributes, ["position"]);
    let words = ours.colour().unwrap();
    let of_lod_3: Vec<u32> = words.iter().filter(|w| **w >> 24 == 3).map(|w| w & 0xff).collect();
    assert!(words.iter().all(|w| w & 0xff == w >> 8 & 0xff));
    assert!(of_lod_3.len() > 250 && of_lod_3.iter().max() >= Some(&254), "{of_lod_3:?}");

    fs::write(&path, "0 0 0\n1 1 1\n").unwrap();
    let (ours, _) = bench.convert(&plan, cell(100.0)).unwrap();
    let ours = Batches::from_bytes(AlignedBytes::from(ours.as_slice()), Path::new("")).unwrap();
    assert!(ours.colour().unwrap().iter().all(|w| w & 0xff_ffff == 0xff_ffff));
}

#[test]
fn originals_can_be_left_out() {
    let scan = Scan::surface(30_000, 2_000, 0.01);
    let bench = Bench::new(&[&scan]);
    let (with, _) = bench.convert(&bench.plan(), cell(1.0)).unwrap();
    let (without, report) = bench.convert(&bench.plan(), BatchesSettings { originals: false, ..cell(1.0) }).unwrap();
    let [a, b] = [&with, &without].map(|f| Header::parse(f, Path::new("")).unwrap());
    assert_eq!((b.sections.originals, b.flags.0), (None, a.flags.0 & !8));
    let points = a.sections.originals.unwrap() as usize;
    assert_eq!(with[256..points], without[256..points]);
    assert_eq!(b.sections.description as usize, points);
    assert_eq!(without.len() as u64, report.outputs[0].bytes);
    let text = |f: &[u8], h: &Header| f[h.sections.description as usize..].to_vec();
    assert_eq!(text(&with, &a), text(&without, &b));
}

#[test]
fn compressed_sections_are_those_of_the_plain_compressor() {
    let scan = Scan::surface(400_000, 9_000, 0.01);
    let bench = Bench::new(&[&scan]);
    for originals in [true, false] {
        let settings = BatchesSettings { originals, ..cell(1.0) };
        let mut plan = bench.plan();
        plan.attributes = AttributeChoice::All;
        let (plain, _) = bench.convert(&plan, settings).unwrap();
        let plain = Batches::from_bytes(AlignedBytes::from(plain.as_slice()), Path::new("")).unwrap();
        let mut expected = Cursor::new(Vec::new());
        compress(&plain, &mut expected, 3, 16).unwrap();
        for threads in [1, 3] {
            plan.threads = threads;
            let zstd = BatchesSettings { zstd_level: Some(3), ..settings };
            let (ours, report) = bench.convert(&plan, zstd).unwrap();
            assert_same_bytes(&ours, expected.get_ref(), "compressed");
            assert_eq!(report.output_bytes, ours.len() as u64);
        }
    }
}

#[test]
fn cells_that_are_too_small_are_refused_with_advice() {
    let bench = Bench::new(&[&Scan::surface(10, 100_000, 1.0)]);
    let Err(error) = bench.convert(&bench.plan(), cell(1e-6)) else { panic!("2^37 cells") };
    assert!(matches!(&error, ConvertError::Plan(e) if e.setting == Setting::LodCell), "{error}");
}
