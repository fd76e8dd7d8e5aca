//! Scans that are added to an octree: what they do not touch is taken over, and the bytes are those of all scans at once.

use std::fs;
use std::path::{Path, PathBuf};

use pointmill_converter::{
    Checkpoint, Encoding, OutputReport, Plan, Potree2Settings, Report, Sampling, Silent, Target, convert,
};
use pointmill_testkit::Random;
use pointmill_testkit::files::{assert_same_dataset, dataset};
use pointmill_testkit::las::{Las, Point};

/// Steps along the side of the square.
const SIDE: u64 = 100_000;

/// Where new points are.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Where {
    Corner,
    Everywhere,
    /// Beyond the others, so that the root is another one.
    Outside,
    /// At places of the others, with all their values.
    Repeated,
    OnePoint,
}

#[derive(Debug, Clone)]
struct Case {
    seed: u64,
    points: usize,
    at: Where,
    target: Potree2Settings,
    subtree_points: u64,
    point_format: u8,
    threads: usize,
    is_spilled: bool,
    checkpoint: Checkpoint,
}

impl Case {
    fn random(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let sampling =
            random.pick(&[Sampling::Poisson, Sampling::Poisson, Sampling::Grid, Sampling::Random { seed: 7 }]);
        let encoding = random.pick(&[Encoding::Default, Encoding::Default, Encoding::Brotli { quality: 5 }]);
        // steps of a centimetre
        let spacing = Some(SIDE as f64 / 100.0 / random.between(17.0, 45.0));
        let leaf_capacity = random.pick(&[40, 100, 300]);
        let at = [Where::Corner, Where::Everywhere, Where::Outside, Where::Repeated, Where::OnePoint];
        Self {
            seed,
            points: random.pick(&[6_000, 15_000, 25_000]),
            at: random.pick(&at),
            target: Potree2Settings { sampling, encoding, spacing, leaf_capacity, ..Potree2Settings::default() },
            subtree_points: random.pick(&[300, 700, 2_000]),
            point_format: random.pick(&[2, 3, 7]),
            threads: random.pick(&[1, 3]),
            is_spilled: random.below(4) == 0,
            checkpoint: random.pick(&[Checkpoint::Never, Checkpoint::Never, Checkpoint::Always]),
        }
    }

    fn las(&self, points: Vec<Point>) -> Vec<u8> {
        Las { point_format: self.point_format, ..Las::new(points) }.bytes()
    }
}

/// Hills with dense spots, and two points that make the root cube.
fn first_scan(random: &mut Random, count: usize) -> Vec<Point> {
    let spots: Vec<[u64; 3]> =
        (0..6).map(|_| [random.below(SIDE), random.below(SIDE), 200 + random.below(3000)]).collect();
    let mut points: Vec<Point> = (0..count)
        .map(|i| {
            let mut xy = [random.below(SIDE), random.below(SIDE)];
            if i % 3 == 0 {
                let [x, y, width] = spots[random.index(spots.len())];
                xy = [x + random.below(width), y + random.below(width)].map(|v| v.min(SIDE - 1));
            }
            Point::numbered(i, hill(xy, random.below(40)))
        })
        .collect();
    points.extend([[0; 3], [SIDE as i32; 3]].map(|xyz| Point::numbered(3, xyz)));
    points
}

fn hill([x, y]: [u64; 2], noise: u64) -> [i32; 3] {
    let height = 3000.0 * ((x as f64 / 9000.0).sin() + (y as f64 / 14_000.0).cos() + 2.0);
    [x as i32, y as i32, height as i32 + noise as i32]
}

fn more_points(random: &mut Random, at: Where, before: &[Point]) -> Vec<Point> {
    let count = 20 + random.index(800);
    let corner = [random.below(SIDE * 9 / 10), random.below(SIDE * 9 / 10)];
    let (width, shift) = (SIDE / random.pick(&[10, 30, 200]), i32::from(at == Where::Outside) * SIDE as i32);
    let new = |random: &mut Random, i: usize| match at {
        Where::Repeated => random.pick(before),
        Where::Everywhere => Point::numbered(i * 7, hill([random.below(SIDE), random.below(SIDE)], random.below(40))),
        _ => {
            let [x, y, z] = hill(corner.map(|v| v + random.below(width)), random.below(40));
            Point::numbered(i * 7, [x + shift, y, z])
        }
    };
    (0..if at == Where::OnePoint { 1 } else { count }).map(|i| new(random, i)).collect()
}

struct Bench {
    dir: tempfile::TempDir,
    case: Case,
}

impl Bench {
    fn scan(&self, name: &str, points: Vec<Point>) -> PathBuf {
        let path = self.dir.path().join(name);
        fs::write(&path, self.case.las(points)).unwrap();
        path
    }

    fn convert(&self, inputs: Vec<PathBuf>, output: &Path, append: bool) -> Report {
        let case = &self.case;
        let mut plan = Plan::new(inputs, output.to_path_buf());
        plan.name = "cloud".into();
        (plan.subtree_points, plan.threads, plan.append) = (Some(case.subtree_points), case.threads, append);
        (plan.overwrite, plan.checkpoint) = (true, case.checkpoint);
        plan.waiting_bytes = case.is_spilled.then_some(0);
        let target: Target = case.target.into();
        convert(&plan, &[target], &Silent).unwrap_or_else(|error| panic!("{case:?}: {error}"))
    }
}

/// Adds twice to a dataset; returns what was reported of each time.
fn add_twice(case: Case) -> [OutputReport; 2] {
    let mut random = Random::new(case.seed ^ 0xA99E);
    let bench = Bench { dir: tempfile::tempdir().unwrap(), case };
    let case = &bench.case;
    let (grown, whole) = (bench.dir.path().join("grown"), bench.dir.path().join("whole"));
    let mut points = first_scan(&mut random, case.points);
    let mut scans = vec![bench.scan("0.las", points.clone())];
    bench.convert(scans.clone(), &grown, false);
    [1, 2].map(|i| {
        let at = if i == 1 { case.at } else { Where::Corner };
        let more = more_points(&mut random, at, &points);
        points.extend_from_slice(&more);
        scans.push(bench.scan(&format!("{i}.las"), more));
        let mut report = bench.convert(vec![scans[i].clone(), grown.clone()], &grown, true);
        bench.convert(scans.clone(), &whole, false);
        assert_same_dataset(&dataset(&grown), &dataset(&whole), &format!("{i}, {case:?}"));
        report.outputs.pop().unwrap()
    })
}

fn check(seeds: std::ops::Range<u64>) {
    let mut taken = [0; 2];
    for seed in seeds {
        let case = Case::random(seed);
        let at = case.at;
        let reports = add_twice(case);
        for (i, report) in reports.iter().enumerate() {
            let kept = report.taken_over.unwrap();
            println!("{seed} {at:?}: {} of {} nodes, {:?}", kept.nodes, report.tree.nodes, kept.why_not);
            taken[i] += kept.nodes;
            assert_eq!(kept.nodes == 0, kept.why_not.is_some());
        }
    }
    assert!(taken.iter().all(|nodes| *nodes > 0));
}

#[test]
fn what_is_added_to_an_octree_gives_the_bytes_of_all_scans() {
    check(0..12);
}

#[test]
#[ignore = "minutes"]
fn what_is_added_to_many_octrees_gives_the_bytes_of_all_scans() {
    let from = std::env::var("SEEDS_FROM").map_or(12, |from| from.parse().unwrap());
    let count = std::env::var("SEEDS").map_or(300, |count| count.parse().unwrap());
    check(from..from + count);
}
