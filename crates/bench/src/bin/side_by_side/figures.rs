//! The figures that count, each with its target.

use crate::cases::{CEILING, SMALL_CEILING};
use crate::job::Job;
use crate::outcome::Outcome;

/// What is aimed at.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Target {
    AtMost(f64),
    AtLeast(f64),
    /// Nothing: the figure is told.
    None,
}

impl Target {
    pub(crate) fn is_reached(self, measured: f64) -> bool {
        match self {
            Self::AtMost(most) => measured <= most,
            Self::AtLeast(least) => measured >= least,
            Self::None => true,
        }
    }
}

/// A figure of a job.
pub(crate) struct Figure {
    pub(crate) job: Job,
    /// Unique: the table is kept by it.
    pub(crate) what: &'static str,
    pub(crate) target: Target,
    measure: fn(&Outcomes<'_>) -> Option<f64>,
}

impl Figure {
    const fn new(job: Job, what: &'static str, target: Target, measure: fn(&Outcomes<'_>) -> Option<f64>) -> Self {
        Self { job, what, target, measure }
    }

    /// `None` if a side of it was not measured.
    pub(crate) fn measured(&self, outcomes: &[Outcome]) -> Option<f64> {
        (self.measure)(&Outcomes(outcomes))
    }
}

/// What was measured of a job.
pub(crate) struct Outcomes<'a>(&'a [Outcome]);

type Quantity = fn(&Outcome) -> f64;

impl Outcomes<'_> {
    fn get(&self, label: &str, of: Quantity) -> Option<f64> {
        let outcome = self.0.iter().find(|o| o.case.label == label && !o.costs.is_empty())?;
        Some(of(outcome))
    }

    fn ratio(&self, label: &str, by: &str, of: Quantity) -> Option<f64> {
        Some(self.get(label, of)? / self.get(by, of)?)
    }

    /// One run over the sum of others; names of outputs.
    fn together(&self, label: &str, alone: &[&str], of: Quantity) -> Option<f64> {
        let sum: Option<f64> = alone.iter().map(|label| self.get(&format!("pointmill, {label}"), of)).sum();
        Some(self.get(&format!("pointmill, {label}"), of)? / sum?)
    }

    /// How pointmill decodes a format, by how `laz` does.
    fn decoder(&self, format: &str) -> Option<f64> {
        self.ratio(&format!("pointmill's reader, format {format}"), &format!("laz, format {format}"), CPU)
    }
}

const CPU: Quantity = Outcome::cpu;
const WALL: Quantity = Outcome::wall;
const BYTES: Quantity = |outcome| outcome.output_bytes as f64;

/// What the single runs of several outputs are called; all attributes in each.
const OCTREE: &str = "potree2";
const BINTREE: &str = "bintree, all attributes";
const BATCHES: &str = "batches, all attributes";

/// Every figure, in the order of the table.
pub(crate) const FIGURES: &[Figure] = {
    use Target::{AtLeast, AtMost, None as Told};
    &[
        Figure::new(Job::Aerial, "aerial LAS: potree2 / PotreeConverter, CPU", AtMost(0.14), |o| {
            o.ratio("pointmill", "PotreeConverter", CPU)
        }),
        Figure::new(Job::Aerial, "aerial LAS: potree2 / PotreeConverter, wall", AtMost(0.14), |o| {
            o.ratio("pointmill", "PotreeConverter", WALL)
        }),
        Figure::new(Job::Aerial, "aerial LAS: potree2 / floor, CPU", AtMost(1.5), |o| {
            o.ratio("pointmill", "floor", CPU)
        }),
        Figure::new(Job::Aerial, "aerial LAS: potree2 / floor, user time alone", Told, |o| {
            o.ratio("pointmill", "floor", Outcome::user)
        }),
        Figure::new(Job::Aerial, "aerial LAS: one thread / two, wall", AtLeast(1.85), |o| {
            o.ratio("pointmill, 1 thread", "pointmill, 2 threads", WALL)
        }),
        Figure::new(Job::Terrestrial, "terrestrial LAZ: potree2 / PotreeConverter, CPU", AtMost(0.2), |o| {
            o.ratio("pointmill", "PotreeConverter", CPU)
        }),
        Figure::new(Job::Terrestrial, "terrestrial LAZ: potree2 / floor, CPU", Told, |o| {
            o.ratio("pointmill", "floor", CPU)
        }),
        Figure::new(Job::Terrestrial, "terrestrial LAZ: potree2 / one decode by `laz`, CPU", AtMost(1.2), |o| {
            o.ratio("pointmill", "laz", CPU)
        }),
        Figure::new(Job::Terrestrial, "terrestrial LAZ: one thread / two, wall", Told, |o| {
            o.ratio("pointmill, 1 thread", "pointmill, 2 threads", WALL)
        }),
        Figure::new(Job::Decoder, "LAZ reader / `laz`, format 3, CPU", AtMost(0.6), |o| o.decoder("3")),
        Figure::new(Job::Decoder, "LAZ reader / `laz`, format 3 with extra bytes, CPU", AtMost(0.6), |o| {
            o.decoder("3 with extra bytes")
        }),
        Figure::new(Job::Decoder, "LAZ reader / `laz`, format 6, CPU", AtMost(0.6), |o| o.decoder("6")),
        Figure::new(Job::Decoder, "LAZ reader / `laz`, format 7, CPU", AtMost(0.6), |o| o.decoder("7")),
        Figure::new(Job::RandomOrder, "random order: potree2 / PotreeConverter, CPU", AtMost(0.2), |o| {
            o.ratio("pointmill", "PotreeConverter", CPU)
        }),
        Figure::new(Job::RandomOrder, "random order: potree2 / floor, CPU", Told, |o| {
            o.ratio("pointmill", "floor", CPU)
        }),
        Figure::new(Job::Volume, "a volume in random order: potree2 / floor, CPU", Told, |o| {
            o.ratio("pointmill", "floor", CPU)
        }),
        Figure::new(Job::Large, "100 million points: 256 MiB / in memory, CPU", AtMost(1.1), |o| {
            o.ratio("pointmill, 256 MiB", "pointmill", CPU)
        }),
        Figure::new(Job::Large, "100 million points, 256 MiB: peak / ceiling", AtMost(1.0), |o| {
            Some(o.get("pointmill, 256 MiB", Outcome::peak_bytes)? / SMALL_CEILING as f64)
        }),
        Figure::new(Job::Large, "100 million points, in memory: the kernel's CPU, s", AtMost(5.0), |o| {
            o.get("pointmill", Outcome::system)
        }),
        Figure::new(Job::Brotli, "BROTLI: potree2 / PotreeConverter, CPU", AtMost(0.4), |o| {
            o.ratio("pointmill, BROTLI", "PotreeConverter, BROTLI", CPU)
        }),
        Figure::new(Job::Brotli, "BROTLI: potree2 / PotreeConverter, bytes", AtMost(1.0), |o| {
            o.ratio("pointmill, BROTLI", "PotreeConverter, BROTLI", BYTES)
        }),
        Figure::new(Job::Outputs, "batches / potree2, CPU", AtMost(0.72), |o| {
            o.ratio("pointmill, batches", "pointmill, potree2", CPU)
        }),
        Figure::new(Job::Outputs, "bintree / potree2, CPU", AtMost(0.42), |o| {
            o.ratio("pointmill, bintree", "pointmill, potree2", CPU)
        }),
        Figure::new(Job::Outputs, "potree2 and bintree / sum of single runs, CPU", AtMost(0.8), |o| {
            o.together("potree2 and bintree", &[OCTREE, BINTREE], CPU)
        }),
        Figure::new(Job::Outputs, "potree2 and batches / sum of single runs, CPU", AtMost(0.8), |o| {
            o.together("potree2 and batches", &[OCTREE, BATCHES], CPU)
        }),
        Figure::new(Job::Outputs, "bintree and batches / sum of single runs, CPU", AtMost(0.8), |o| {
            o.together("bintree and batches", &[BINTREE, BATCHES], CPU)
        }),
        Figure::new(Job::Outputs, "all three / sum of single runs, CPU", AtMost(0.7), |o| {
            o.together("all three", &[OCTREE, BINTREE, BATCHES], CPU)
        }),
        Figure::new(Job::Outputs, "all three / sum of single runs, wall", Told, |o| {
            o.together("all three", &[OCTREE, BINTREE, BATCHES], WALL)
        }),
        Figure::new(Job::Octrees, "aerial LAS: copc / copc_converter, CPU", AtMost(1.0), |o| {
            o.ratio("pointmill, copc", "copc_converter", CPU)
        }),
        Figure::new(Job::Octrees, "aerial LAS: copc / copc_converter, bytes", Told, |o| {
            o.ratio("pointmill, copc", "copc_converter", BYTES)
        }),
        Figure::new(Job::Octrees, "aerial LAS: potree1 / potree2, CPU", AtMost(1.3), |o| {
            o.ratio("pointmill, potree1", "pointmill, potree2", CPU)
        }),
        Figure::new(Job::Octrees, "aerial LAS: three octrees / sum of single runs, CPU", AtMost(0.75), |o| {
            o.together("three octrees", &[OCTREE, "potree1", "copc"], CPU)
        }),
        Figure::new(Job::OctreesLaz, "terrestrial LAZ: copc / copc_converter, CPU", AtMost(1.0), |o| {
            o.ratio("pointmill, copc", "copc_converter", CPU)
        }),
        Figure::new(Job::OctreesLaz, "terrestrial LAZ: copc / copc_converter, bytes", Told, |o| {
            o.ratio("pointmill, copc", "copc_converter", BYTES)
        }),
        Figure::new(Job::OctreesLaz, "terrestrial LAZ: potree1 / potree2, CPU", AtMost(1.3), |o| {
            o.ratio("pointmill, potree1", "pointmill, potree2", CPU)
        }),
        Figure::new(Job::OctreesLaz, "terrestrial LAZ: three octrees / sum of single runs, CPU", AtMost(0.75), |o| {
            o.together("three octrees", &[OCTREE, "potree1", "copc"], CPU)
        }),
        Figure::new(Job::HalfBillion, "500 million points, 2 GiB: CPU a point / with 20 million", Told, |o| {
            o.ratio("pointmill, all points", "pointmill, 20,000,000 points", Outcome::cpu_per_point)
        }),
        Figure::new(Job::HalfBillion, "500 million points, 2 GiB: peak / ceiling", AtMost(1.0), |o| {
            Some(o.get("pointmill, all points", Outcome::peak_bytes)? / CEILING as f64)
        }),
        Figure::new(Job::HalfBillion, "500 million points, 2 GiB: wall, s", Told, |o| {
            o.get("pointmill, all points", WALL)
        }),
        Figure::new(Job::HalfBillion, "500 million points, 2 GiB: temporary bytes a point", Told, |o| {
            o.get("pointmill, all points", |outcome| outcome.temp_bytes as f64 / outcome.case.scene.points as f64)
        }),
        Figure::new(Job::HalfBillion, "500 million points, 2 GiB: validations that failed", AtMost(0.0), |o| {
            let outcome = o.0.iter().find(|outcome| outcome.case.is_validated)?;
            Some(if outcome.validation?.exit_code == 0 { 0.0 } else { 1.0 })
        }),
    ]
};

#[cfg(test)]
mod tests {
    use pointmill_bench::process::Cost;

    use super::*;
    use crate::cases;

    fn outcomes(job: Job) -> Vec<Outcome> {
        let cost = |i: usize| Cost {
            wall_secs: (i + 1) as f64,
            user_secs: (i + 1) as f64,
            system_secs: 1.0,
            peak_bytes: 1 << 20,
            exit_code: 0,
        };
        let cases = cases::list(job, job.points(), "").into_iter().enumerate();
        cases
            .map(|(i, case)| {
                let validation = case.is_validated.then(|| cost(0));
                Outcome { costs: vec![cost(i)], output_bytes: 1, validation, ..Outcome::new(case) }
            })
            .collect()
    }

    #[test]
    fn every_figure_finds_its_cases_and_has_a_name_of_its_own() {
        for (i, figure) in FIGURES.iter().enumerate() {
            assert!(figure.measured(&outcomes(figure.job)).is_some_and(f64::is_finite), "{}", figure.what);
            assert!(FIGURES[..i].iter().all(|other| other.what != figure.what), "{}", figure.what);
            assert_eq!(figure.measured(&[]), None, "{}", figure.what);
        }
    }

    #[test]
    fn ratios_are_those_of_medians() {
        // pointmill 1 + 1 s, floor 2 + 1, PotreeConverter 3 + 1
        let measured = |what: &str| {
            let figure = FIGURES.iter().find(|figure| figure.what == what).unwrap();
            figure.measured(&outcomes(figure.job)).unwrap()
        };
        assert_eq!(measured("aerial LAS: potree2 / PotreeConverter, CPU"), 0.5);
        assert_eq!(measured("aerial LAS: potree2 / PotreeConverter, wall"), 1.0 / 3.0);
        assert_eq!(measured("aerial LAS: potree2 / floor, user time alone"), 0.5);
        // potree2 is the first case, bintree with all attributes the third, both together the sixth
        assert_eq!(measured("potree2 and bintree / sum of single runs, CPU"), 7.0 / (2.0 + 4.0));
        assert_eq!(measured("100 million points, 256 MiB: peak / ceiling"), 1.0 / 256.0);
        let a_point = measured("500 million points, 2 GiB: CPU a point / with 20 million");
        assert!((a_point - 2.0 / 3.0 / 25.0).abs() < 1e-12);
    }

    #[test]
    fn a_missed_target_is_told() {
        let reached = [Target::AtMost(1.5), Target::AtLeast(1.5), Target::None];
        assert_eq!(reached.map(|target| target.is_reached(1.4)), [true, false, true]);
        assert_eq!(reached.map(|target| target.is_reached(1.6)), [false, true, true]);
    }
}
