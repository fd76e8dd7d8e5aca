//! A case, and the judgement of what the outputs make of it.

use pointmill_format::serde_json::Value;

use crate::bounds::Axis;
use crate::input::{Coordinate, Input};
use crate::output::{Decoded, OUTPUTS, Output, RUNS};
use crate::support::Dir;

/// What the lattice does to the coordinates of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Kept {
    /// They are on it.
    Same,
    /// They are decimals, and it is that of their last digit: as doubles, both are rounded.
    Decimals,
    /// They become the nearest of it.
    Rounded,
}

/// A scan, and what is expected of its conversion.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) input: Input,
    /// Steps of the lattice of the run; `None`: any that keep the coordinates.
    pub(crate) step: Option<[f64; 3]>,
    pub(crate) kept: [Kept; 3],
    /// A format that cannot hold it; see `refused`.
    pub(crate) without: Option<&'static str>,
    /// More options of `convert`.
    pub(crate) options: Vec<&'static str>,
}

impl Case {
    pub(crate) fn new(name: impl Into<String>, input: Input, step: [f64; 3], kept: Kept) -> Self {
        Self { name: name.into(), input, step: Some(step), kept: [kept; 3], without: None, options: Vec::new() }
    }

    /// LAS on its own lattice.
    pub(crate) fn las(name: impl Into<String>, scale: [f64; 3], offset: [f64; 3], points: Vec<[i32; 3]>) -> Self {
        Self::new(name, Input::Las { scale, offset, points }, scale, Kept::Same)
    }

    pub(crate) fn kept(self, kept: [Kept; 3]) -> Self {
        Self { kept, ..self }
    }

    pub(crate) fn without(self, format: &'static str) -> Self {
        Self { without: Some(format), ..self }
    }

    pub(crate) fn with(mut self, options: &[&'static str]) -> Self {
        self.options = options.to_vec();
        self
    }

    /// Converts to all outputs; panics where a point is farther off than its bound, or the validator finds a fault.
    pub(crate) fn judge(&self) {
        let dir = Dir::new();
        let scan = self.input.file_name();
        dir.write(scan, &self.input.bytes());
        let meant: Vec<Option<[Coordinate; 3]>> = (0..self.input.len()).map(|i| self.input.point(i)).collect();
        let invalid = meant.iter().filter(|point| point.is_none()).count();
        for (run, formats) in RUNS.iter().enumerate() {
            let out = format!("run{run}");
            let arguments = ["convert", scan, "-o", &out, "--attributes", "intensity", "-q"];
            let formats = formats.iter().filter(|format| self.without != Some(format[0]));
            let formats = formats.flat_map(|format| ["--to"].iter().chain(*format));
            let ended = dir.run(arguments.iter().chain(formats).chain(&self.options));
            assert_eq!(ended.code(), 0, "{}, run {run}: {}", self.name, ended.stderr());
            let report = dir.report(&out);
            assert_eq!(report["points"]["invalid"], invalid, "{}: points without a position", self.name);
            let axes = self.axes(&meant, &report["grid"]);
            for output in OUTPUTS.iter().filter(|output| output.run == run && self.without != Some(output.folder)) {
                let dataset = [&out, output.folder].join("/");
                let ended = dir.run(["validate", &dataset, "-q", "--against", scan]);
                assert_eq!(ended.code(), 0, "{}, {}: {}{}", self.name, output.name, ended.stdout(), ended.stderr());
                self.compare(output, &meant, &axes, &output.decode(&dir.path(&dataset)));
            }
        }
    }

    /// The lattice has the steps that are expected, and the cube is no larger than the points ask for.
    fn axes(&self, meant: &[Option<[Coordinate; 3]>], grid: &Value) -> [Axis; 3] {
        let number = |value: &Value| value.as_f64().unwrap();
        let scale = [0, 1, 2].map(|a| number(&grid["scale"][a]));
        assert!(self.step.is_none_or(|step| step == scale), "{}: steps {scale:?}; {}", self.name, grid["why"]);
        let side = number(&grid["cube_side"]);
        let ends = [0, 1, 2].map(|a| {
            let all = || meant.iter().flatten().map(|p| p[a].value());
            (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max))
        });
        let extent = ends.iter().map(|(min, max)| max - min).fold(0.0, f64::max);
        let [finest, coarsest] =
            [scale.into_iter().fold(f64::INFINITY, f64::min), scale.into_iter().fold(0.0, f64::max)];
        assert!(side <= extent + 130.0 * coarsest + 1e-15 * extent, "{}: a cube of {side}", self.name);
        let are_equal = scale.iter().all(|s| (s / finest).log2().fract() == 0.0);
        std::array::from_fn(|a| {
            let ((min, max), step, offset) = (ends[a], scale[a], self.input.offset()[a]);
            Axis { min, max, step, offset, finest, side, are_equal }
        })
    }

    fn compare(&self, output: &Output, meant: &[Option<[Coordinate; 3]>], axes: &[Axis; 3], decoded: &[Decoded]) {
        let valid = meant.iter().flatten().count();
        assert_eq!(decoded.len(), valid, "{}, {}: points", self.name, output.name);
        let mut missing: Vec<Option<&[Coordinate; 3]>> = meant.iter().map(Option::as_ref).collect();
        for point in decoded {
            let i = usize::from(point.number);
            let Some(meant) = missing[i].take() else {
                panic!("{}, {}: point {i} is there twice, or has no position", self.name, output.name);
            };
            for (a, axis) in axes.iter().enumerate() {
                let error = meant[a].error_of(point.world[a]);
                let lattice = axis.of_lattice(self, i, a);
                let format = axis.of_format(output.rule, point.level);
                // the sums of the bounds are rounded themselves
                assert!(
                    error.abs() <= (lattice + format) * (1.0 + 16.0 * f64::EPSILON),
                    "{}, {}: axis {a} of point {i} decodes to {}, which is {error:e} off {}; bounds: lattice {lattice:e}, \
                     format {format:e}",
                    self.name,
                    output.name,
                    point.world[a],
                    meant[a].value(),
                );
            }
        }
    }
}
