//! What can be measured: a scene, and what is done with it.

use clap::ValueEnum;
use pointmill_bench::las_layout::LasLayout;
use pointmill_bench::scene::Scene;

/// A comparison that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Job {
    /// Aerial LAS, Poisson-disk sampling, with all other programs; one thread and two
    Aerial,
    /// Terrestrial LAZ, likewise, with one decode by the laz crate
    Terrestrial,
    /// Aerial LAS with its points in random order, with PotreeConverter
    RandomOrder,
    /// A volume in random order, with the floor (PotreeConverter does not come to an end)
    Volume,
    /// 100 million points in memory and under a ceiling of 256 MiB
    Large,
    /// BROTLI payloads, with PotreeConverter's
    Brotli,
    /// Binary tree and batches, alone and with others from one read
    Outputs,
    /// Octrees of three formats, alone and built together, with copc_converter; aerial LAS
    Octrees,
    /// The same of terrestrial LAZ
    OctreesLaz,
    /// LAZ decoders in one thread, by point format
    Decoder,
    /// 500 million points under 2 GiB, with validation (takes 35 GB of disk)
    HalfBillion,
    /// Poisson-disk, grid and random sampling, with PotreeConverter's
    Sampling,
    /// Binary trees by mean, median and midpoint
    Splits,
}

impl Job {
    /// As it is typed.
    pub(crate) fn name(self) -> String {
        self.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default()
    }

    /// Heading of its section, without the marks.
    pub(crate) fn title(self, points: u64) -> String {
        let points = grouped(points);
        match self {
            Self::Aerial => format!("Aerial LAS, {points} points"),
            Self::Terrestrial => format!("Terrestrial LAZ, {points} points"),
            Self::RandomOrder => format!("Aerial LAS in random order, {points} points"),
            Self::Volume => format!("A volume in random order, LAS, {points} points"),
            Self::Large => format!("A ceiling of memory: aerial LAS, {points} points"),
            Self::Brotli => format!("BROTLI: aerial LAS, {points} points"),
            Self::Outputs => format!("Binary trees, batches and several outputs: aerial LAS, {points} points"),
            Self::Octrees => format!("Octrees of three formats: aerial LAS, {points} points"),
            Self::OctreesLaz => format!("Octrees of three formats: terrestrial LAZ, {points} points"),
            Self::Decoder => format!("LAZ decoders: aerial LAZ, {points} points, one thread"),
            Self::HalfBillion => format!("Out of core: aerial LAS, {points} points of format 0"),
            Self::Sampling => format!("Rules of sampling: aerial LAS, {points} points"),
            Self::Splits => format!("Rules of splitting: aerial LAS, {points} points"),
        }
    }

    /// Points of its scene, unless others are asked for.
    pub(crate) const fn points(self) -> u64 {
        match self {
            Self::Brotli | Self::Decoder => 5_000_000,
            Self::Large => 100_000_000,
            Self::HalfBillion => 500_000_000,
            _ => 20_000_000,
        }
    }

    /// Runs of each case, unless others are asked for.
    pub(crate) const fn runs(self) -> u32 {
        if matches!(self, Self::HalfBillion) { 1 } else { 5 }
    }

    /// Bytes of memory that are made ready before each run, unless others are asked for.
    pub(crate) const fn lend(self) -> u64 {
        if matches!(self, Self::Large) { 8 << 30 } else { 4 << 30 }
    }

    /// Its scene, of so many points.
    pub(crate) const fn scene(self, points: u64) -> SceneFile {
        let scene = match self {
            Self::Terrestrial | Self::OctreesLaz => Scene::Terrestrial,
            Self::RandomOrder => Scene::Shuffled,
            Self::Volume => Scene::Volume,
            _ => Scene::Aerial,
        };
        let layout = if matches!(self, Self::HalfBillion) { LasLayout::PLAIN } else { LasLayout::COLOUR };
        SceneFile {
            scene,
            layout,
            is_laz: matches!(self, Self::Terrestrial | Self::OctreesLaz | Self::Decoder),
            points,
        }
    }
}

/// A scene as a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SceneFile {
    pub(crate) scene: Scene,
    pub(crate) layout: LasLayout,
    pub(crate) is_laz: bool,
    pub(crate) points: u64,
}

impl SceneFile {
    /// Its name in the folder of scenes.
    pub(crate) fn file_name(&self) -> String {
        let layout = if self.layout == LasLayout::COLOUR { String::new() } else { format!("-{}", self.layout.name()) };
        let ending = if self.is_laz { "laz" } else { "las" };
        format!("{}-{}{}.{ending}", self.scene.name(), self.points, layout.replace(' ', "-"))
    }
}

/// "20,000,000".
pub(crate) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(',');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_grouped_by_thousands() {
        assert_eq!([7, 100, 1000, 20_000_000].map(grouped), ["7", "100", "1,000", "20,000,000"]);
    }

    #[test]
    fn scenes_that_differ_have_names_that_do() {
        let decoder = |layout| SceneFile { layout, ..Job::Decoder.scene(5) }.file_name();
        let names = [
            Job::Aerial.scene(5).file_name(),
            Job::Terrestrial.scene(5).file_name(),
            Job::HalfBillion.scene(5).file_name(),
            decoder(LasLayout::COLOUR),
            decoder(LasLayout::EXTRA),
        ];
        let expected =
            ["aerial-5.las", "terrestrial-5.laz", "aerial-5-0.las", "aerial-5.laz", "aerial-5-3-with-extra-bytes.laz"];
        assert_eq!(names, expected);
    }
}
