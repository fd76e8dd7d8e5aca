//! The settings that are measured: a grid of values, an axis for each option.

use std::fmt;

/// Something that a conversion can be told, as `measure --axes` calls it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Axis {
    /// The output format.
    Output,
    /// How inner nodes of octrees choose their points.
    Sampling,
    /// How payloads are packed.
    Encoding,
    /// Bits per coordinate of batches.
    Planes,
    /// The coordinate step.
    Scale,
    /// How exact positions have to be.
    Precision,
    /// What is kept of each point.
    Attributes,
    /// Whether batches keep the colours that averages replace.
    Averaging,
    /// Maximum points per leaf.
    LeafCapacity,
}

use Axis::{Attributes, Averaging, Encoding, LeafCapacity, Output, Planes, Precision, Sampling, Scale};

impl Axis {
    /// All of them, in the order of the columns of a table.
    pub const ALL: [Self; 9] =
        [Output, Sampling, Encoding, Planes, Scale, Precision, Attributes, Averaging, LeafCapacity];

    /// Those that vary unless others are chosen.
    pub const DEFAULT: [Self; 5] = [Output, Sampling, Encoding, Planes, Averaging];

    /// Its name in options and tables.
    pub const fn name(self) -> &'static str {
        match self {
            Output => "output",
            Sampling => "sampling",
            Encoding => "encoding",
            Planes => "planes",
            Scale => "scale",
            Precision => "precision",
            Attributes => "attributes",
            Averaging => "averaging",
            LeafCapacity => "leaf-capacity",
        }
    }

    /// The values that it takes if none are named.
    pub const fn usual_values(self) -> &'static [&'static str] {
        match self {
            Output => &["potree2", "copc", "bintree", "batches"],
            Sampling => &["poisson", "grid", "random"],
            Encoding => &["default", "compressed"],
            Planes => &["auto", "10"],
            Scale => &["auto", "0.01", "0.05"],
            Precision => &["scan", "1mm", "1cm"],
            Attributes => &["all", "scene", "rgb"],
            Averaging => &["keep", "discard"],
            LeafCapacity => &["10000", "20000", "65000"],
        }
    }

    /// The value that stands for "the option is not given", where there is one.
    const fn default_value(self) -> &'static str {
        match self {
            Encoding => "default",
            Averaging => "keep",
            Precision => "scan",
            _ => "",
        }
    }

    /// True if the option changes how the same points are packed, not which points or values are there.
    pub const fn is_lossless(self) -> bool {
        matches!(self, Encoding)
    }

    /// True if outputs of the format `output` have this setting.
    pub fn concerns(self, output: &str) -> bool {
        let is_octree = matches!(output, "potree2" | "potree1" | "copc");
        match self {
            Output | Scale | Precision | Attributes => true,
            Sampling => is_octree,
            LeafCapacity => is_octree || output == "bintree",
            Encoding => matches!(output, "potree2" | "batches"),
            Planes | Averaging => output == "batches",
        }
    }

    /// The arguments of `pointmill convert` for a value, or what is wrong with it.
    fn arguments(self, output: &str, value: &str) -> Result<Vec<String>, String> {
        let pair = |option: &str| Ok(vec![option.to_owned(), value.to_owned()]);
        let refuse = || Err(format!("{}: {value} is no value of it", self.name()));
        match self {
            Output => match value {
                "potree2" | "potree1" | "copc" | "bintree" | "batches" => pair("--to"),
                _ => refuse(),
            },
            Sampling => pair("--sampling"),
            Planes => pair("--planes"),
            Scale => pair("--scale"),
            Precision if value == "scan" => Ok(Vec::new()),
            Precision => pair("--precision"),
            Attributes => pair("--attributes"),
            LeafCapacity if output == "bintree" => pair("--capacity"),
            LeafCapacity => pair("--leaf-capacity"),
            Averaging => match value {
                "keep" => Ok(Vec::new()),
                "discard" => Ok(vec!["--no-originals".to_owned()]),
                _ => refuse(),
            },
            Encoding => {
                let (name, level) = value.split_once(':').map_or((value, None), |(name, level)| (name, Some(level)));
                let options: &[&str] = match (name, output) {
                    ("default", _) if level.is_none() => &[],
                    ("compressed" | "brotli", "potree2") => &["--encoding", "brotli"],
                    ("compressed" | "zstd", "batches") => &["--compress"],
                    _ => return refuse(),
                };
                let mut arguments: Vec<String> = options.iter().map(|s| (*s).to_owned()).collect();
                match (output, level) {
                    ("batches", level) if !options.is_empty() => {
                        arguments.push(level.map_or("zstd".to_owned(), |level| format!("zstd:{level}")));
                    }
                    (_, Some(level)) => arguments.extend(["--brotli-quality".to_owned(), level.to_owned()]),
                    (_, None) => {}
                }
                Ok(arguments)
            }
        }
    }
}

impl fmt::Display for Axis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Which axes vary, with the values of each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Axes(Vec<(Axis, Vec<String>)>);

impl Default for Axes {
    fn default() -> Self {
        Self(Axis::DEFAULT.iter().map(|axis| (*axis, usual(*axis))).collect())
    }
}

fn usual(axis: Axis) -> Vec<String> {
    axis.usual_values().iter().map(|value| (*value).to_owned()).collect()
}

impl Axes {
    /// Parses `output=potree2+batches,sampling,planes=10+20`: names of axes, with values where the usual ones will not do.
    ///
    /// # Errors
    /// A name that is none, an axis named twice, no value, or no setting at all.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut axes: Vec<(Axis, Vec<String>)> = Vec::new();
        for part in text.split(',').map(str::trim) {
            let (name, values) = part.split_once('=').map_or((part, None), |(name, values)| (name, Some(values)));
            let known = || Axis::ALL.map(Axis::name).join(", ");
            let axis = Axis::ALL.into_iter().find(|axis| axis.name() == name);
            let axis = axis.ok_or_else(|| format!("no axis is called '{name}'; there are {}", known()))?;
            if axes.iter().any(|(other, _)| *other == axis) {
                return Err(format!("{axis} is named twice"));
            }
            let mut values = values.map_or_else(|| usual(axis), |v| v.split('+').map(str::to_owned).collect());
            if values.iter().any(String::is_empty) {
                return Err(format!("{axis}: a value is missing"));
            }
            let mut seen = std::collections::HashSet::new();
            values.retain(|value| seen.insert(value.clone()));
            axes.push((axis, values));
        }
        if !axes.iter().any(|(axis, _)| *axis == Output) {
            axes.push((Output, vec!["potree2".to_owned()]));
        }
        axes.sort_by_key(|(axis, _)| *axis);
        let axes = Self(axes);
        axes.settings()?;
        Ok(axes)
    }

    /// The axes in the order of their values in [`Setting::values`].
    pub fn names(&self) -> impl Iterator<Item = Axis> + '_ {
        self.0.iter().map(|(axis, _)| *axis)
    }

    /// Every combination, each once: an axis that does not concern an output does not multiply its settings.
    ///
    /// # Errors
    /// A value that its axis does not have.
    pub fn settings(&self) -> Result<Vec<Setting>, String> {
        let mut settings = vec![Setting::default()];
        for (axis, values) in &self.0 {
            let mut next = Vec::new();
            for setting in settings {
                if !axis.concerns(&setting.output) && *axis != Output {
                    next.push(setting);
                    continue;
                }
                // a value of another output's alone is left out, as long as one is left
                let fits = values.iter().filter(|v| axis.arguments(&setting.output, v).is_ok());
                let mut fits: Vec<&String> = fits.collect();
                if fits.is_empty() {
                    fits = values.iter().collect();
                }
                for value in fits {
                    next.push(setting.with(*axis, value)?);
                }
            }
            settings = next;
        }
        for (axis, values) in &self.0 {
            let is_used = |value: &String| settings.iter().any(|s| s.value(*axis) == Some(value));
            if let Some(value) = values.iter().find(|value| !is_used(value)) {
                return Err(format!("{axis}: {value} is a value of none of the outputs"));
            }
        }
        Ok(settings)
    }
}

/// One combination of values: a conversion.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Setting {
    /// Name of the format, as `--to` has it.
    pub output: String,
    /// The values of the axes that concern it.
    pub values: Vec<(Axis, String)>,
    /// What `pointmill convert` is told, besides inputs and output.
    pub arguments: Vec<String>,
}

impl Setting {
    fn with(&self, axis: Axis, value: &str) -> Result<Self, String> {
        let mut setting = self.clone();
        setting.arguments.extend(axis.arguments(&self.output, value)?);
        if axis == Output {
            value.clone_into(&mut setting.output);
        }
        setting.values.push((axis, value.to_owned()));
        Ok(setting)
    }

    /// The value of an axis, if it varies and concerns this output.
    pub fn value(&self, axis: Axis) -> Option<&str> {
        self.values.iter().find(|(a, _)| *a == axis).map(|(_, value)| value.as_str())
    }

    /// A short name: `potree2 poisson brotli`; values that change nothing are left out.
    pub fn name(&self) -> String {
        let shown = self.values.iter().filter(|(axis, value)| value != axis.default_value());
        let word = |(axis, value): &(Axis, String)| match axis {
            Planes => format!("{value} bits"),
            Scale => format!("step {value}"),
            Precision => format!("within {value}"),
            LeafCapacity => format!("leaves of {value}"),
            Attributes => format!("attributes {value}"),
            Averaging => "originals discarded".to_owned(),
            _ => value.clone(),
        };
        shown.map(word).collect::<Vec<_>>().join(", ")
    }

    /// Two settings of one key have the same points with the same values.
    pub fn lossless_key(&self) -> String {
        let rest = self.values.iter().filter(|(axis, _)| !axis.is_lossless());
        rest.map(|(axis, value)| format!("{axis}={value}")).collect::<Vec<_>>().join(" ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_grid_has_each_combination_once_and_only_what_concerns_an_output() {
        let settings = Axes::default().settings().unwrap();
        let of = |output: &str| settings.iter().filter(|s| s.output == output).count();
        // sampling × encoding; sampling; one; encoding × planes × averaging
        assert_eq!((of("potree2"), of("copc"), of("bintree"), of("batches")), (6, 3, 1, 8));
        let mut arguments: Vec<_> = settings.iter().map(|s| &s.arguments).collect();
        arguments.sort();
        arguments.dedup();
        assert_eq!(arguments.len(), settings.len());
    }

    #[test]
    fn values_become_options() {
        let axes = Axes::parse("output=potree2+batches,encoding=default+brotli:9+zstd:3,planes=20").unwrap();
        let settings = axes.settings().unwrap();
        let lines: Vec<String> = settings.iter().map(|s| s.arguments.join(" ")).collect();
        assert_eq!(
            lines,
            [
                "--to potree2",
                "--to potree2 --encoding brotli --brotli-quality 9",
                "--to batches --planes 20",
                "--to batches --compress zstd:3 --planes 20",
            ]
        );
        assert_eq!(settings[1].name(), "potree2, brotli:9");
        assert_eq!(settings[3].name(), "batches, zstd:3, 20 bits");
        assert_eq!(settings[0].lossless_key(), settings[1].lossless_key());
        assert_ne!(settings[0].lossless_key(), settings[2].lossless_key());
    }

    #[test]
    fn axes_that_are_none_are_refused() {
        for (text, words) in [
            ("", "no axis is called ''"),
            ("colour", "there are output, sampling"),
            ("sampling,sampling", "named twice"),
            ("sampling=", "a value is missing"),
            ("output=las", "las is no value"),
            ("output=copc,planes=20", "planes: 20 is a value of none"),
            ("output=potree2,encoding=zstd", "encoding: zstd"),
        ] {
            let error = Axes::parse(text).unwrap_err();
            assert!(error.contains(words), "{text}: {error}");
        }
    }
}
