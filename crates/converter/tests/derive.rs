//! Normals, curvature and radii, held against plain sums over plainly found neighbours.

use std::fs;
use std::path::Path;

use pointmill_converter::{
    AttributeChoice, BatchesSettings, BintreeSettings, Checkpoint, ConvertError, CopcSettings, Derive, DeriveNormals,
    Neighbourhood, Orient, Outliers, Plan, Potree1Settings, Potree2Settings, Report, Silent, Target, convert,
};
use pointmill_format::{OpenOptions, Wanted, open_scan};
use pointmill_testkit::Random;
use pointmill_testkit::files::{assert_same_dataset, dataset, fixture};
use pointmill_testkit::las::Las;
use pointmill_testkit::reader::{Cloud, read};

const SURFELS: Derive = Derive {
    normals: Some(DeriveNormals::Keep),
    radius: true,
    neighbourhood: Neighbourhood::Nearest(16),
    orient: Orient::Up,
};

fn plan_of(folder: &Path, name: &str, bytes: &[u8], derive: Derive) -> Plan {
    let scan = folder.join(name);
    fs::write(&scan, bytes).unwrap();
    let mut plan = Plan::new(vec![scan], folder.join("out"));
    (plan.overwrite, plan.threads, plan.outliers, plan.derive) = (true, 2, Outliers::Keep, derive);
    plan
}

fn plan(folder: &Path, las: &Las, derive: Derive) -> Plan {
    plan_of(folder, "a.las", &las.bytes(), derive)
}

fn small() -> Target {
    Potree2Settings { leaf_capacity: 500, ..Potree2Settings::default() }.into()
}

fn run(plan: &Plan) -> (Report, Cloud) {
    let report = convert(plan, &[small()], &Silent).unwrap();
    (report, points(&plan.output))
}

fn points(dataset: &Path) -> Cloud {
    let scan = open_scan(dataset, &OpenOptions::default()).unwrap();
    read(&*scan, &Wanted::all(scan.info()))
}

/// Rows of the derived attributes.
fn derived(cloud: &Cloud) -> Vec<[f64; 5]> {
    let columns = ["NormalX", "NormalY", "NormalZ", "curvature", "radius"].map(|name| cloud.values(name));
    (0..cloud.len()).map(|i| columns.each_ref().map(|column| column[i])).collect()
}

/// Places in world units, but for the offset.
fn places(cloud: &Cloud) -> Vec<[f64; 3]> {
    let scale = cloud.info.lattice.as_ref().map_or([1.0; 3], |lattice| lattice.scale);
    (0..cloud.len()).map(|i| [0, 1, 2].map(|a| cloud.xyz[a][i] * scale[a])).collect()
}

/// The neighbourhood of a point: plainly all distances, sorted.
fn neighbours(all: &[[f64; 3]], p: [f64; 3], neighbourhood: Neighbourhood) -> (Vec<[f64; 3]>, f64, bool) {
    let distance = |q: &[f64; 3]| (0..3).map(|a| (q[a] - p[a]).powi(2)).sum::<f64>().sqrt();
    let mut sorted: Vec<(f64, [f64; 3])> = all.iter().map(|q| (distance(q), *q)).collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let is_same = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b;
    match neighbourhood {
        Neighbourhood::Nearest(count) => {
            let count = (count as usize).min(sorted.len());
            let reach = sorted[count - 1].0;
            // others as far away may have been taken as well
            let is_doubtful = sorted.get(count).is_some_and(|next| is_same(reach, next.0));
            (sorted[..count].iter().map(|(_, q)| *q).collect(), reach, is_doubtful)
        }
        Neighbourhood::Within(radius) => {
            let is_doubtful = sorted.iter().any(|(d, _)| is_same(*d, radius));
            (sorted.iter().take_while(|(d, _)| *d <= radius).map(|(_, q)| *q).collect(), radius, is_doubtful)
        }
    }
}

/// The covariance, and its smallest eigenvalue in closed form (Smith 1961).
fn plane(all: &[[f64; 3]]) -> ([[f64; 3]; 3], f64) {
    let n = all.len() as f64;
    let mean = [0, 1, 2].map(|a| all.iter().map(|q| q[a]).sum::<f64>() / n);
    let c =
        [0, 1, 2].map(|a| [0, 1, 2].map(|b| all.iter().map(|q| (q[a] - mean[a]) * (q[b] - mean[b])).sum::<f64>() / n));
    let q = (c[0][0] + c[1][1] + c[2][2]) / 3.0;
    let others = c[0][1].powi(2) + c[0][2].powi(2) + c[1][2].powi(2);
    let p = (((0..3).map(|a| (c[a][a] - q).powi(2)).sum::<f64>() + 2.0 * others) / 6.0).sqrt();
    let b = [0, 1, 2].map(|i| [0, 1, 2].map(|j| (c[i][j] - if i == j { q } else { 0.0 }) / p));
    let det = b[0][0] * (b[1][1] * b[2][2] - b[1][2] * b[2][1]) - b[0][1] * (b[1][0] * b[2][2] - b[1][2] * b[2][0])
        + b[0][2] * (b[1][0] * b[2][1] - b[1][1] * b[2][0]);
    let angle = (det / 2.0).clamp(-1.0, 1.0).acos() / 3.0;
    (c, q + 2.0 * p * (angle + 2.0 * std::f64::consts::PI / 3.0).cos())
}

/// Holds the derived attributes of a cloud against what its places say; returns how many points were judged.
fn judge(cloud: &Cloud, neighbourhood: Neighbourhood) -> usize {
    let (places, derived) = (places(cloud), derived(cloud));
    let mut judged = 0;
    for (p, [x, y, z, curvature, radius]) in places.iter().zip(&derived) {
        let (around, reach, is_doubtful) = neighbours(&places, *p, neighbourhood);
        if is_doubtful {
            continue;
        }
        if around.len() < 3 {
            assert_eq!([x, y, z, curvature].map(|v| *v), [0.0; 4]);
            continue;
        }
        let (c, least) = plane(&around);
        let trace = c[0][0] + c[1][1] + c[2][2];
        let n = [*x, *y, *z];
        assert!((n.iter().map(|v| v * v).sum::<f64>() - 1.0).abs() < 1e-6, "{n:?}");
        assert!(*z >= 0.0);
        // the variance along the normal is the least that there is
        let along: f64 = (0..3).map(|a| (0..3).map(|b| n[a] * c[a][b] * n[b]).sum::<f64>()).sum();
        assert!((along - least).abs() <= 1e-6 * trace, "{along} {least} of {trace}");
        assert!((curvature - least / trace).abs() <= 1e-6);
        let expected = reach * (4.0 / around.len() as f64).sqrt().min(1.0);
        assert!((radius - expected).abs() <= 1e-6 * expected, "{radius} {expected}");
        judged += 1;
    }
    judged
}

/// A bumpy surface that is ten times as dense at one end, and a few points far above it.
fn surface(points: usize, seed: u64) -> Las {
    let mut random = Random::new(seed);
    let place = |random: &mut Random, i: usize| {
        let x = (random.unit() * random.unit() * 90_000.0) as i32;
        let y = random.below(30_000) as i32;
        let z = (900.0 * (f64::from(x) / 5000.0).sin() + 400.0 * (f64::from(y) / 2500.0).cos()) as i32;
        [x, y, if i.is_multiple_of(200) { z + 20_000 + random.below(9000) as i32 } else { z + random.below(60) as i32 }]
    };
    Las::numbered((0..points).map(|i| place(&mut random, i)))
}

#[test]
fn surfaces_are_those_of_plainly_found_neighbours() {
    let dir = tempfile::tempdir().unwrap();
    for (i, neighbourhood) in
        [Neighbourhood::Nearest(16), Neighbourhood::Nearest(5), Neighbourhood::Nearest(40), Neighbourhood::Within(90.0)]
            .into_iter()
            .enumerate()
    {
        // a step that is not the same along the axes
        let mut las = surface(1500, 3 + i as u64);
        las.scale = [0.01, 0.02, 0.005];
        for task_points in [None, Some(90)] {
            let derive = Derive { neighbourhood, ..SURFELS };
            let plan = Plan { task_points, ..plan(dir.path(), &las, derive) };
            let (report, cloud) = run(&plan);
            assert!(judge(&cloud, neighbourhood) > 1300, "{neighbourhood:?}");
            let counts = report.derived.unwrap();
            assert_eq!((counts.points, counts.kept_normals), (1500, 0));
            assert!(counts.without_normal < 15 && counts.without_radius < 8, "those far above");
            assert!(report.warnings.iter().all(|w| !w.to_string().contains("Normal")), "nothing is missing");
        }
    }
}

#[test]
fn no_byte_depends_on_units_threads_memory_or_the_order_of_the_points() {
    let dir = tempfile::tempdir().unwrap();
    let las = surface(30_000, 8);
    for neighbourhood in [Neighbourhood::Nearest(16), Neighbourhood::Within(3.0)] {
        let first = plan(dir.path(), &las, Derive { neighbourhood, ..SURFELS });
        run(&first);
        let expected = dataset(&first.output);
        let mut turned = las.clone();
        turned.points.reverse();
        let turned = plan_of(dir.path(), "b.las", &turned.bytes(), first.derive.clone());
        let others = [
            ("units", Plan { task_points: Some(1000), ..first.clone() }),
            ("small units", Plan { task_points: Some(70), threads: 1, ..first.clone() }),
            ("threads", Plan { threads: 5, task_points: Some(5000), ..first.clone() }),
            ("on the disk", Plan { waiting_bytes: Some(100_000), task_points: Some(3000), ..first.clone() }),
            (
                "with a job",
                Plan {
                    waiting_bytes: Some(100_000),
                    task_points: Some(3000),
                    checkpoint: Checkpoint::Always,
                    checkpoint_points: 4000,
                    ..first.clone()
                },
            ),
            ("order", Plan { name: "out".into(), ..turned }),
        ];
        for (what, other) in others {
            run(&other);
            assert_same_dataset(&dataset(&other.output), &expected, what);
        }
    }
}

#[test]
fn every_output_has_them() {
    let dir = tempfile::tempdir().unwrap();
    let mut plan = plan(dir.path(), &surface(3000, 5), SURFELS);
    let targets: [Target; 5] = [
        Potree2Settings::default().into(),
        Potree1Settings::default().into(),
        CopcSettings::default().into(),
        BintreeSettings::default().into(),
        BatchesSettings::default().into(),
    ];
    let choices = [AttributeChoice::Usual, AttributeChoice::Scene, AttributeChoice::List(vec!["intensity".into()])];
    for attributes in choices {
        plan.attributes = attributes;
        convert(&plan, &targets, &Silent).unwrap();
        let mut expected: Option<Vec<[u32; 5]>> = None;
        for target in &targets {
            let name = target.kind().name();
            let mut file = plan.output.join(name);
            if name == "copc" {
                file = fs::read_dir(&file)
                    .unwrap()
                    .map(|e| e.unwrap().path())
                    .find(|p| p.to_string_lossy().ends_with(".laz"))
                    .unwrap();
            }
            let cloud = points(&file);
            if name == "potree1" {
                // two bytes hold a direction, and there is no place for the others
                let normals = ["NormalX", "NormalY", "NormalZ"].map(|name| cloud.values(name));
                assert!((0..cloud.len()).all(|i| normals[2][i] > -0.02 && normals.iter().any(|n| n[i].abs() > 0.5)));
                continue;
            }
            let mut rows: Vec<[u32; 5]> = derived(&cloud).iter().map(|row| row.map(|v| (v as f32).to_bits())).collect();
            rows.sort_unstable();
            assert_eq!(rows.len(), 3000, "{name}");
            assert!(*expected.get_or_insert_with(|| rows.clone()) == rows, "{name}");
        }
    }
}

#[test]
fn places_and_lines_have_no_normal_and_are_counted() {
    let dir = tempfile::tempdir().unwrap();
    let line: Vec<[i32; 3]> = (0..100).map(|i| [3 * i * i, 2 * i * i, -i * i]).collect();
    let scenes = [
        (vec![[5; 3]], 1, 1),
        (vec![[5; 3], [9; 3]], 2, 0),
        (vec![[5; 3]; 40], 40, 40),
        (line, 100, 0),
        // more points in one place than are worked on together, and a plane beside it
        ((0..900).map(|i| if i < 600 { [10_000; 3] } else { [i % 20 * 7, i / 20 * 9, 0] }).collect(), 600, 600),
    ];
    for (scene, without_normal, without_radius) in scenes {
        let count = scene.len();
        let plan = Plan { task_points: Some(100), ..plan(dir.path(), &Las::numbered(scene), SURFELS) };
        let (report, cloud) = run(&plan);
        let counts = report.derived.unwrap();
        assert_eq!((counts.without_normal, counts.without_radius), (without_normal, without_radius), "{count} points");
        let zeros = derived(&cloud).iter().filter(|row| row[..4] == [0.0; 4]).count();
        assert_eq!(zeros as u64, without_normal, "{count} points");
    }
    // all points of a place count
    let mut scene = vec![[0; 3]; 600];
    scene.extend([[300, 0, 0], [0, 300, 0], [-300, 0, 0], [0, -300, 0]]);
    let derive = Derive { neighbourhood: Neighbourhood::Within(7.0), ..SURFELS };
    let plan = Plan { task_points: Some(100), ..plan(dir.path(), &Las::numbered(scene), derive) };
    let (_, cloud) = run(&plan);
    assert!(derived(&cloud).iter().all(|row| row[..4] == [0.0, 0.0, 1.0, 0.0]), "a plane");
    let radii: Vec<f64> = derived(&cloud).iter().map(|row| row[4]).collect();
    assert!(radii.iter().any(|r| (r - 7.0 * (4.0f64 / 604.0).sqrt()).abs() < 1e-6), "{:?}", &radii[..3]);
}

#[test]
fn clouds_wider_than_single_precision_are_no_other() {
    let dir = tempfile::tempdir().unwrap();
    let mut las = surface(700, 21);
    las.scale = [1e-3; 3];
    // stretched: more steps than single precision has integers
    for point in &mut las.points {
        point.xyz = [(point.xyz[0] - 45_000) * 23_500, (point.xyz[1] - 15_000) * 70_000, point.xyz[2] * 60_000];
    }
    for task_points in [None, Some(60)] {
        let (_, cloud) = run(&Plan { task_points, ..plan(dir.path(), &las, SURFELS) });
        let ends = cloud.xyz[0].iter().fold((0.0f64, 0.0f64), |(min, max), v| (min.min(*v), max.max(*v)));
        assert!(ends.1 - ends.0 > 2e7, "{ends:?}");
        assert!(judge(&cloud, Neighbourhood::Nearest(16)) > 600);
    }
}

/// A PTX file of one grid: a wall at x = 5 as seen from (`sx`, 0, 0).
fn wall(sx: f64) -> String {
    let mut text = format!("8\n8\n{sx} 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n{sx} 0 0 1\n");
    for i in 0..64 {
        text += &format!("{} {} {} 0.5\n", 5.0 - sx, f64::from(i % 8) * 0.1, f64::from(i / 8) * 0.13);
    }
    text
}

#[test]
fn normals_point_to_the_scanner_up_to_a_place_or_nowhere() {
    let dir = tempfile::tempdir().unwrap();
    let x_of = |text: &str, orient: Orient| {
        let plan = plan_of(dir.path(), "a.ptx", text.as_bytes(), Derive { orient, ..SURFELS });
        let (_, cloud) = run(&plan);
        let values = cloud.values("NormalX");
        assert!(values.iter().all(|v| *v == values[0]) && values[0].abs() > 0.999);
        values[0].round()
    };
    assert_eq!(x_of(&wall(1.0), Orient::Scanner), -1.0);
    assert_eq!(x_of(&wall(9.0), Orient::Scanner), 1.0);
    assert_eq!(x_of(&wall(1.0), Orient::Up), 1.0);
    assert_eq!(x_of(&wall(1.0), Orient::None), 1.0);
    assert_eq!(x_of(&wall(9.0), Orient::Towards([-1e9, 3.0, 2.0])), -1.0);
    // two scans of one file, from either side
    let both = format!("{}{}", wall(1.0), wall(9.0).replace("0.5\n", "0.25\n"));
    let plan = plan_of(dir.path(), "a.ptx", both.as_bytes(), Derive { orient: Orient::Scanner, ..SURFELS });
    let (_, cloud) = run(&plan);
    let (x, scan) = (cloud.values("NormalX"), cloud.values("point source id"));
    assert!(x.iter().zip(&scan).all(|(x, scan)| x.round() == if *scan == 0.0 { -1.0 } else { 1.0 }));
}

#[test]
fn normals_of_scans_stay_unless_they_are_to_be_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let mut text =
        "ply\nformat ascii 1.0\nelement vertex 100\nproperty float x\nproperty float y\nproperty float z\n".to_owned();
    for name in ["nx", "ny", "nz", "curvature", "radius"] {
        text += &format!("property float {name}\n");
    }
    text += "end_header\n";
    for i in 0..100 {
        let own = if i % 4 == 0 { "0 0 0 0.25 0" } else { "0.6 0 -0.8 0.25 0.75" };
        text += &format!("{} {} 0 {own}\n", i % 10, i / 10);
    }
    let made = |normals| {
        let plan = plan_of(dir.path(), "a.ply", text.as_bytes(), Derive { normals: Some(normals), ..SURFELS });
        let (report, cloud) = run(&plan);
        (report.derived.unwrap(), derived(&cloud))
    };
    let (counts, rows) = made(DeriveNormals::Keep);
    assert_eq!((counts.kept_normals, counts.kept_radii), (75, 75));
    let own = [0.6f32, 0.0, -0.8].map(f64::from);
    assert_eq!(rows.iter().filter(|row| row[..3] == own && row[3] == 0.0 && row[4] == 0.75).count(), 75);
    assert_eq!(rows.iter().filter(|row| row[..4] == [0.0, 0.0, 1.0, 0.0] && row[4] > 0.0).count(), 25);
    // two components are no normal
    let part = text.replace("property float nz", "property float other");
    let plan = plan_of(dir.path(), "a.ply", part.as_bytes(), SURFELS);
    let (report, cloud) = run(&plan);
    assert_eq!(report.derived.unwrap().kept_normals, 0);
    assert!(
        derived(&cloud).iter().all(|row| row[..3] == [0.0, 0.0, 1.0])
            && cloud.values("other").contains(&f64::from(-0.8f32))
    );
    let (counts, rows) = made(DeriveNormals::Replace);
    assert_eq!((counts.kept_normals, counts.kept_radii), (0, 75));
    assert!(rows.iter().all(|row| row[..4] == [0.0, 0.0, 1.0, 0.0]));
}

#[test]
fn what_cannot_be_computed_is_refused() {
    let scans = vec![fixture("las/format3.las")];
    let dir = tempfile::tempdir().unwrap();
    let refused = |derive: Derive, append: bool| {
        let plan = Plan { derive, append, ..Plan::new(scans.clone(), dir.path().join("out")) };
        let error = convert(&plan, &[small()], &Silent).unwrap_err();
        assert!(matches!(error, ConvertError::Plan(_)), "{error}");
        assert!(!plan.output.exists());
    };
    refused(SURFELS, true);
    for neighbourhood in [
        Neighbourhood::Nearest(2),
        Neighbourhood::Nearest(1001),
        Neighbourhood::Within(0.0),
        Neighbourhood::Within(f64::NAN),
    ] {
        refused(Derive { neighbourhood, ..SURFELS }, false);
    }
    let plan = Plan { derive: SURFELS, ..Plan::new(scans.clone(), dir.path().join("out")) };
    let job = pointmill_converter::plan_job(&plan, &[small()], &dir.path().join("job"), &Silent);
    assert!(matches!(job, Err(ConvertError::Plan(_))));
    assert!(!dir.path().join("job").exists());
}
