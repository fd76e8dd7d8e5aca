//! A conversion in units, each done for itself and in any order that their needs allow, has the bytes of one run.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use pointmill_converter::{
    BatchesSettings, BintreeSettings, ConvertError, CopcSettings, JobFault, JobUnit, JobUnits, Plan, Potree1Settings,
    Potree2Settings, Report, Sampling, Silent, Target, UnitName, convert, finish_job, job_units, plan_job, run_units,
};
use pointmill_testkit::Random;
use pointmill_testkit::files::{assert_same_dataset, dataset};
use pointmill_testkit::las::Las;

/// Of a scan.
const POINTS: usize = 200_000;

/// Tells whether bytes that several processes have made are those of one.
struct Bench {
    dir: tempfile::TempDir,
    plan: Plan,
    targets: Vec<Target>,
}

impl Bench {
    fn new(scans: &[Las], targets: Vec<Target>) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let scan = |(i, las): (usize, &Las)| {
            let path = dir.path().join(format!("{i}.las"));
            fs::write(&path, las.bytes()).unwrap();
            path
        };
        let scans = scans.iter().enumerate().map(scan).collect();
        let mut plan = Plan::new(scans, dir.path().join("out"));
        (plan.threads, plan.checkpoint_points, plan.name) = (2, 100_000, "cloud".into());
        Self { dir, plan, targets }
    }

    fn job(&self) -> PathBuf {
        self.dir.path().join("job")
    }

    fn begin(&self) -> JobUnits {
        plan_job(&self.plan, &self.targets, &self.job(), &Silent).unwrap()
    }

    fn look(&self) -> JobUnits {
        job_units(&self.plan, &self.targets, &self.job(), &Silent).unwrap()
    }

    fn run(&self, units: &[UnitName]) -> Result<JobUnits, ConvertError> {
        run_units(&self.plan, &self.targets, &self.job(), units, None, &Silent)
    }

    fn finish(&self) -> Result<Report, ConvertError> {
        finish_job(&self.plan, &self.targets, &self.job(), &Silent, &|_| Ok(()))
    }

    /// The bytes of one run.
    fn plain(&self) -> BTreeMap<String, Vec<u8>> {
        let plan = Plan { output: self.dir.path().join("plain"), ..self.plan.clone() };
        convert(&plan, &self.targets, &Silent).unwrap();
        dataset(&plan.output)
    }

    /// Does all units, a few of those that are ready at a time; how many there were of each kind.
    fn do_all(&self, seed: u64) -> BTreeMap<&'static str, usize> {
        let (mut random, mut kinds) = (Random::new(seed), BTreeMap::new());
        let mut known = self.begin();
        while !known.complete {
            let mut ready: Vec<&JobUnit> = known.ready().collect();
            assert!(!ready.is_empty(), "{known:?}");
            let some = 1 + random.below(4);
            let chosen = (0..some.min(ready.len() as u64)).map(|_| {
                let unit = ready.swap_remove(random.below(ready.len() as u64) as usize);
                *kinds.entry(unit.kind).or_default() += 1;
                unit.name
            });
            known = self.run(&chosen.collect::<Vec<_>>()).unwrap();
            known = if known.units.iter().all(|unit| unit.done) { self.look() } else { known };
        }
        kinds
    }

    fn fault(&self, ended: Result<impl std::fmt::Debug, ConvertError>) -> JobFault {
        match ended {
            Err(ConvertError::Job(fault)) => fault,
            other => panic!("{other:?}"),
        }
    }
}

fn targets() -> [Target; 4] {
    let potree2: Target = Potree2Settings::default().into();
    [potree2, CopcSettings::default().into(), BintreeSettings::default().into(), BatchesSettings::default().into()]
}

/// Three scans side by side, each in an order of its own: more points than one unit of any output takes.
fn scans() -> Vec<Las> {
    let scan = |seed: u64| {
        let mut las = Las::terrain(POINTS, seed);
        las.points.iter_mut().for_each(|point| point.xyz[0] += 7000 * seed as i32);
        if seed == 2 {
            las.points.sort_by_key(|point| (point.xyz[0] / 500, point.xyz[1] / 500));
        }
        las
    };
    (1..=3).map(scan).collect()
}

#[test]
fn units_in_any_order_end_in_the_bytes_of_one_run() {
    let bench = Bench::new(&scans(), targets().into());
    let kinds = bench.do_all(1);
    let report = bench.finish().unwrap();
    assert_eq!((report.points.read, report.outputs.len()), (3 * POINTS as u64, 4));
    assert_same_dataset(&dataset(&bench.plan.output), &bench.plain(), "a job");
    assert!(kinds["read"] >= 3 && kinds["settle"] == 1 && kinds["build"] > 6, "{kinds:?}");
    assert!(!bench.job().join("identity").exists() && !bench.job().join("units").exists());
}

#[test]
fn a_second_pass_and_other_samplings_are_done_in_units_too() {
    let mut liars = scans();
    for las in &mut liars {
        las.scale = [1e-6; 3];
        las.bounds_declared = Some([[0.0; 3], [1.0; 3]]); // farther from the points than 31 bits of steps
    }
    let potree1 = Potree1Settings { sampling: Sampling::Grid, ..Potree1Settings::default() };
    let bench = Bench::new(&liars, vec![potree1.into()]);
    let kinds = bench.do_all(2);
    let report = bench.finish().unwrap();
    assert!(report.warnings.iter().any(|w| w.kind() == "read_again"), "{:?}", report.warnings);
    assert!(kinds["read"] >= 6, "{kinds:?}");
    assert_same_dataset(&dataset(&bench.plan.output), &bench.plain(), "a job");
}

#[test]
fn points_that_are_dropped_after_a_whole_pass_cost_a_second_one() {
    let mut scans = scans();
    scans[0].points[7].xyz = [2_000_000_000, 0, 0]; // 20,000 km away
    let mut bench = Bench::new(&scans, targets().into());
    bench.plan.outliers = pointmill_converter::Outliers::Drop;
    bench.do_all(4);
    let report = bench.finish().unwrap();
    assert_eq!((report.points.read, report.points.outliers), (3 * POINTS as u64, 1));
    assert_same_dataset(&dataset(&bench.plan.output), &bench.plain(), "a job");
}

#[test]
fn files_that_were_exchanged_are_no_units_and_records_that_changed_are_found() {
    let bench = Bench::new(&scans(), targets().into());
    bench.do_all(5);
    let units = bench.job().join("units");
    let [a, b] = ["build-0-0", "build-0-1"].map(|name| units.join(name));
    let (first, second) = (fs::read(&a).unwrap(), fs::read(&b).unwrap());
    fs::write(&a, &second).unwrap();
    fs::write(&b, &first).unwrap();
    assert!(matches!(bench.fault(bench.finish()), JobFault::Unfinished { .. }));
    fs::write(&a, &first).unwrap();
    fs::write(&b, &second).unwrap();
    // of a unit that is built once more
    let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
    let records = fs::read_dir(&units).unwrap().map(|e| e.unwrap().path());
    for path in records.filter(|path| name(path).starts_with("read-") && name(path).ends_with(".records")) {
        let mut bytes = fs::read(&path).unwrap();
        let at = bytes.len() / 2;
        bytes[at] ^= 1;
        fs::write(path, bytes).unwrap();
    }
    for build in
        fs::read_dir(&units).unwrap().map(|e| e.unwrap().path()).filter(|path| name(path).starts_with("build-"))
    {
        fs::remove_file(build).unwrap();
    }
    let mut known = Ok(bench.look());
    while let Ok(JobUnits { complete: false, .. }) = &known {
        let ready: Vec<UnitName> = known.iter().flat_map(JobUnits::ready).map(|unit| unit.name).collect();
        known = bench.run(&ready);
    }
    let found = known.and_then(|_| bench.finish());
    assert!(matches!(bench.fault(found), JobFault::Mixed { .. }));
    assert!(!bench.plan.output.exists());
}

#[test]
fn a_unit_that_is_done_twice_is_the_same_and_a_broken_one_is_done_again() {
    let bench = Bench::new(&scans(), vec![Potree2Settings::default().into()]);
    bench.do_all(3);
    let known = bench.look();
    assert!(known.complete && known.units.iter().all(|unit| unit.done && unit.kind == "build"));
    let file = |unit: &JobUnit| bench.job().join("units").join(unit.name.to_string());
    for unit in [&known.units[0], &known.units[known.units.len() - 1]] {
        let before = fs::read(file(unit)).unwrap();
        fs::remove_file(file(unit)).unwrap();
        bench.run(&[unit.name]).unwrap();
        assert_eq!(fs::read(file(unit)).unwrap(), before, "{}", unit.name);
        let mut changed = before.clone();
        changed[before.len() / 2] ^= 8;
        fs::write(file(unit), &changed).unwrap();
        let JobFault::Unfinished { units } = bench.fault(bench.finish()) else { panic!() };
        let open: Vec<UnitName> = units.iter().filter(|unit| !unit.done).map(|unit| unit.name).collect();
        assert_eq!(open, [unit.name]);
        assert!(!file(unit).exists(), "it is not done any more");
        assert!(!bench.plan.output.exists());
        bench.run(&open).unwrap();
        assert_eq!(fs::read(file(unit)).unwrap(), before, "{}", unit.name);
    }
    bench.finish().unwrap();
    assert_same_dataset(&dataset(&bench.plan.output), &bench.plain(), "a job");
}

#[test]
fn what_does_not_go_is_refused_and_the_job_stays() {
    let bench = Bench::new(&scans(), vec![BintreeSettings::default().into()]);
    let (nowhere, job) = (bench.dir.path().join("nowhere"), bench.job());
    let look = |folder: &Path| job_units(&bench.plan, &bench.targets, folder, &Silent);
    assert!(matches!(bench.fault(look(&nowhere)), JobFault::NotThere { .. }));
    let first = bench.begin();
    assert!(matches!(
        bench.fault(plan_job(&bench.plan, &bench.targets, &job, &Silent)),
        JobFault::NotEmpty { folder } if folder == job
    ));
    // all of its stage come first
    for later in ["settle-1-0", "build-0-0", "read-2-0", "read-1-99"] {
        let later: UnitName = later.parse().unwrap();
        assert!(matches!(bench.fault(bench.run(&[later])), JobFault::NoUnit { .. }), "{later}");
    }
    assert!(matches!(bench.fault(bench.finish()), JobFault::Unfinished { units } if units == first.units));
    let other = Plan { scale: pointmill_converter::ScaleChoice::Fixed(0.1), ..bench.plan.clone() };
    let name = first.units[0].name;
    assert!(matches!(
        bench.fault(run_units(&other, &bench.targets, &job, &[name], None, &Silent)),
        JobFault::Setting { .. }
    ));
    bench.run(&[name]).unwrap();
    fs::write(bench.dir.path().join("1.las"), Las::terrain(150_000, 9).bytes()).unwrap();
    assert!(matches!(bench.fault(look(&job)), JobFault::ChangedInput { path } if path.ends_with("1.las")));
    assert!(job.join("units").join(name.to_string()).is_file());
}
