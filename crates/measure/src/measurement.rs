//! A measurement from its beginning to its end.

use std::borrow::Cow;
use std::ffi::OsString;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use pointmill_format::{Aabb, Scan};
use pointmill_render::{Picture, Size, Style};
use serde_json::Value;

use crate::cloud::{self, Cloud};
use crate::colour::Reference;
use crate::decoded::{self, Decoded};
use crate::image::{compare, popping};
use crate::position::Sorted;
use crate::program::{Program, Run, bytes_of};
use crate::result::{Cost, Measured, Phase, Row, Scene, ViewError};
use crate::trades::trades;
use crate::views::{Drawable, NamedView, depth_range, draw_cloud, flight, image, shade_by_depth, views};
use crate::{Axes, MeasureError, Setting, choice, sample};

/// Pictures of a flight.
const FRAMES: usize = 4;

/// A change of luma, 0 to 255, that is seen to pop.
const POP: f64 = 24.0;

/// Of the pictures in the report, of 100; the comparisons are made before.
const JPEG_QUALITY: u8 = 85;

/// Memory that a point takes while it is measured: twice its coordinates (as they are, and sorted), those of the dataset, codes and
/// colours.
const BYTES_PER_POINT: u64 = 150;

/// What is measured, and how.
#[derive(Debug, Clone)]
pub struct Measurement {
    /// The program pointmill: settings are measured as its users run them.
    pub program: PathBuf,
    /// Scans and datasets.
    pub inputs: Vec<PathBuf>,
    /// The settings.
    pub axes: Axes,
    /// Of larger scenes a part with about as many points is measured.
    pub sample: u64,
    /// Threads of each conversion; also of the comparisons.
    pub threads: usize,
    /// Points that renderers may draw at once.
    pub budget: u64,
    /// Of the pictures.
    pub size: Size,
    /// Where datasets are put until they are measured.
    pub temporary: PathBuf,
    /// Ceiling of the memory of conversions, as their option has it.
    pub memory: Option<u64>,
}

/// A picture of the result.
#[derive(Debug, Clone)]
pub struct Shown {
    /// Name of the view.
    pub view: &'static str,
    /// Name of the setting; empty for the whole cloud.
    pub setting: String,
    /// A JPEG file: a PNG of points is five times as large.
    pub jpeg: Vec<u8>,
}

/// What is told while a measurement goes on.
pub trait Watch: Sync {
    /// The request to stop.
    fn should_stop(&self) -> bool;
    /// Something begins: `done` of `of` settings are measured.
    fn begins(&self, what: &str, done: usize, of: usize);
    /// A row was added.
    fn measured(&self, so_far: &Measured, pictures: &[Shown]);
}

/// What all settings are compared with.
struct Truth {
    cloud: Cloud,
    sorted: Sorted,
    colours: Reference,
    views: Vec<(NamedView, Picture)>,
    flight: Vec<(pointmill_render::Camera, Picture)>,
}

impl Measurement {
    /// Measures every setting. `watch` gets the result after each; if it asks to stop, that is where the result ends.
    ///
    /// # Errors
    /// Inputs that cannot be read, a scene without points, the request to stop before the first setting.
    pub fn run(&self, watch: &dyn Watch) -> Result<(Measured, Vec<Shown>), MeasureError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(self.threads).build();
        match pool {
            Ok(pool) => pool.install(|| self.run_here(watch)),
            // no threads to be had: those that there are
            Err(_) => self.run_here(watch),
        }
    }

    fn run_here(&self, watch: &dyn Watch) -> Result<(Measured, Vec<Shown>), MeasureError> {
        let start = Instant::now();
        let should_stop = || watch.should_stop();
        let program = Program { path: &self.program, should_stop: &should_stop };
        let settings = self.axes.settings().map_err(MeasureError::Sample)?;
        watch.begins("reading the scene", 0, settings.len());
        let scans = cloud::open(&self.inputs)?;
        let mut work = Work { measurement: self, program, inputs: self.inputs.clone() };
        let mut result = self.empty_result(&scans);
        if result.scene.points_declared > self.sample {
            let points = result.scene.points_declared;
            let part = sample::choose(&scans, points, self.sample, &should_stop)?;
            if part.boxes.is_empty() {
                return Err(MeasureError::Empty(self.inputs.len()));
            }
            drop(scans);
            result.scene.chunks = [part.boxes.len(), part.occupied];
            work.write_sample(&part.boxes)?;
        }
        let truth = work.truth(&mut result.scene, &should_stop)?;
        let mut pictures = exact_pictures(&truth);
        for (done, setting) in settings.iter().enumerate() {
            watch.begins(&setting.name(), done, settings.len());
            match work.measure(setting, &truth, &result.rows, &mut pictures) {
                Ok(row) => result.rows.push(row),
                Err(MeasureError::Interrupted) => break,
                Err(other) => return Err(other),
            }
            result.is_complete = result.rows.len() == settings.len();
            result.seconds = start.elapsed().as_secs_f64();
            let rounding = rounding(&result.scene.bounds);
            choice::mark_front(&mut result.rows, rounding);
            result.profiles = choice::profiles(&result.rows, rounding);
            result.trades = trades(&result.rows);
            watch.measured(&result, &pictures);
        }
        if result.rows.is_empty() { Err(MeasureError::Interrupted) } else { Ok((result, pictures)) }
    }

    fn empty_result(&self, scans: &[Box<dyn Scan>]) -> Measured {
        let infos = || scans.iter().map(|scan| scan.info());
        Measured {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            scene: Scene {
                inputs: self.inputs.iter().map(|path| path.display().to_string()).collect(),
                points_declared: infos().map(|info| info.points_declared).sum(),
                bytes: infos().map(|info| info.file_bytes).sum(),
                ..Scene::default()
            },
            threads: self.threads,
            budget: self.budget,
            picture_size: [self.size.width(), self.size.height()],
            ..Measured::default()
        }
    }
}

fn exact_pictures(truth: &Truth) -> Vec<Shown> {
    let of = |(view, picture): &(NamedView, Picture)| shown(view.name, "", picture);
    truth.views.iter().filter_map(of).collect()
}

/// What a few operations of doubles are off by at the farthest coordinate.
fn rounding(bounds: &[f64; 6]) -> f64 {
    16.0 * f64::EPSILON * bounds.iter().fold(0.0, |most: f64, v| most.max(v.abs()))
}

/// Nothing if the picture is too large for a JPEG.
fn shown(view: &'static str, setting: &str, picture: &Picture) -> Option<Shown> {
    let [width, height] = [picture.width, picture.height].map(|side| u16::try_from(side).ok());
    let mut jpeg = Vec::new();
    let encoder = jpeg_encoder::Encoder::new(&mut jpeg, JPEG_QUALITY);
    encoder.encode(picture.rgb.as_flattened(), width?, height?, jpeg_encoder::ColorType::Rgb).ok()?;
    Some(Shown { view, setting: setting.to_owned(), jpeg })
}

/// A measurement that has begun.
struct Work<'a> {
    measurement: &'a Measurement,
    program: Program<'a>,
    /// Or the sample that was made of them.
    inputs: Vec<PathBuf>,
}

impl Work<'_> {
    fn folder(&self) -> &Path {
        &self.measurement.temporary
    }

    /// The arguments that name the inputs.
    fn input_arguments(&self) -> impl Iterator<Item = OsString> + '_ {
        std::iter::once("--".into()).chain(self.inputs.iter().map(|path| path.clone().into_os_string()))
    }

    /// Writes the points in `boxes` to a LAS file, which takes the place of the inputs.
    fn write_sample(&mut self, boxes: &[Aabb]) -> Result<(), MeasureError> {
        let file = self.folder().join("sample.las");
        let mut arguments: Vec<OsString> = ["export", "--json", "--quiet", "--overwrite", "-o"].map(Into::into).into();
        arguments.push(file.clone().into_os_string());
        for Aabb { min, max } in boxes {
            let corner = |c: &[f64; 3]| c.map(|v| v.to_string()).join(",");
            arguments.push(format!("--bounds={}..{}", corner(min), corner(max)).into());
        }
        arguments.extend(self.input_arguments());
        let run = self.program.run(arguments)?;
        if run.code != 0 {
            return Err(MeasureError::Sample(last_line(&run)));
        }
        self.inputs = vec![file];
        Ok(())
    }

    /// Reads the scene, and draws it.
    fn truth(&self, scene: &mut Scene, should_stop: &(dyn Fn() -> bool + Sync)) -> Result<Truth, MeasureError> {
        let scans = cloud::open(&self.inputs)?;
        let declared: u64 = scans.iter().map(|scan| scan.info().points_declared).sum();
        check_memory(declared, scene, self.measurement)?;
        let mut cloud = cloud::read(&scans, should_stop)?;
        if cloud.rgb.iter().all(|rgb| *rgb == [0; 3]) {
            cloud.rgb.clear(); // black is no colour to compare
        }
        if cloud.len() == 0 {
            return Err(MeasureError::Empty(self.inputs.len()));
        }
        let bounds = cloud.bounds();
        scene.points = cloud.len() as u64;
        scene.has_colours = !cloud.rgb.is_empty();
        scene.bounds = [bounds.min, bounds.max].concat().try_into().unwrap_or_default();
        let size = self.measurement.size;
        let colours = Reference::new(&cloud, &bounds);
        let spacing = colours.spacing();
        let drawn = |camera: &pointmill_render::Camera| {
            if should_stop() { Err(MeasureError::Interrupted) } else { Ok(draw_cloud(&cloud, camera, size, spacing)?) }
        };
        let mut pictures = Vec::new();
        for view in views(&cloud, size) {
            let picture = drawn(&view.camera)?;
            pictures.push((view, picture));
        }
        let mut frames = Vec::new();
        for camera in flight(&pictures[0].0.camera, &pictures[2].0.camera, FRAMES) {
            let picture = drawn(&camera)?;
            frames.push((camera, picture));
        }
        Ok(Truth { sorted: Sorted::new(&cloud.xyz), colours, views: pictures, flight: frames, cloud })
    }

    /// Measures a setting. A conversion that fails is a row without figures.
    fn measure(
        &self,
        setting: &Setting,
        truth: &Truth,
        earlier: &[Row],
        pictures: &mut Vec<Shown>,
    ) -> Result<Row, MeasureError> {
        let mut row = Row {
            name: setting.name(),
            output: setting.output.clone(),
            values: setting.values.iter().map(|(axis, value)| (axis.name(), value.clone())).collect(),
            arguments: setting.arguments.clone(),
            ..Row::default()
        };
        let dataset = self.folder().join("dataset");
        let run = self.convert(setting, &dataset)?;
        if run.code != 0 {
            row.failed = Some(last_line(&run));
            return Ok(row);
        }
        row.cost = Some(cost(&run, &dataset, truth.cloud.len()));
        let checksum = run.json.pointer("/outputs/0/checksum").and_then(Value::as_str);
        row.checksum = checksum.unwrap_or_default().to_owned();
        let twin = earlier.iter().find(|other| {
            other.failed.is_none()
                && other.output == row.output
                && !row.checksum.is_empty()
                && other.checksum == row.checksum
                && setting.lossless_key() == lossless_key(other)
        });
        if let Some(twin) = twin {
            copy_quality(&mut row, twin);
        } else {
            self.quality(&mut row, &dataset, truth, pictures)?;
        }
        let _ = std::fs::remove_dir_all(&dataset); // what is left is removed with the folder
        Ok(row)
    }

    fn convert(&self, setting: &Setting, dataset: &Path) -> Result<Run, MeasureError> {
        let mut arguments: Vec<OsString> =
            ["convert", "--json", "--quiet", "--overwrite", "--progress", "none", "-o"].map(Into::into).into();
        arguments.push(dataset.as_os_str().to_owned());
        arguments.push(format!("--threads={}", self.measurement.threads).into());
        if let Some(memory) = self.measurement.memory {
            arguments.push(format!("--memory={memory}").into());
        }
        arguments.extend(setting.arguments.iter().map(Into::into));
        arguments.extend(self.input_arguments());
        self.program.run(arguments)
    }

    /// Everything that is seen of the dataset itself.
    fn quality(
        &self,
        row: &mut Row,
        dataset: &Path,
        truth: &Truth,
        pictures: &mut Vec<Shown>,
    ) -> Result<(), MeasureError> {
        if matches!(row.output.as_str(), "potree2" | "potree1" | "copc") {
            let run =
                self.program.run([OsString::from("validate"), "--json".into(), dataset.as_os_str().to_owned()])?;
            row.sampling = run.json.get("quality").and_then(Value::as_array).cloned().unwrap_or_default();
        }
        match decoded::read(dataset, !truth.cloud.rgb.is_empty()) {
            Ok(Decoded { cloud, spacings }) => {
                row.is_shaded_by_depth = cloud.rgb.is_empty();
                row.position = truth.sorted.errors(&cloud.xyz);
                row.levels = truth.colours.levels(&cloud, &spacings);
            }
            Err(error) => {
                row.failed = Some(error.to_string());
                return Ok(());
            }
        }
        if let Err(error) = self.draw(row, dataset, truth, pictures) {
            row.failed = Some(error.to_string());
        }
        Ok(())
    }

    fn draw(
        &self,
        row: &mut Row,
        dataset: &Path,
        truth: &Truth,
        pictures: &mut Vec<Shown>,
    ) -> Result<(), pointmill_render::RenderError> {
        let Measurement { size, budget, .. } = self.measurement;
        let drawable = Drawable::open(dataset)?;
        let style = Style::default();
        let is_by_depth = row.is_shaded_by_depth;
        let draw = |camera: &pointmill_render::Camera, exact: &Picture| {
            let mut picture = drawable.draw(camera, *size, &style, *budget)?;
            if is_by_depth {
                shade_by_depth(&mut picture, depth_range(exact));
            }
            Ok::<_, pointmill_render::RenderError>(picture)
        };
        for (view, exact) in &truth.views {
            let picture = draw(&view.camera, exact)?;
            let error = compare(image(&picture), image(&comparable(exact, is_by_depth)));
            row.views.push(ViewError { view: view.name, error, points: picture.drawn.points });
            pictures.extend(shown(view.name, &row.name, &picture));
        }
        let mut pops = Vec::new();
        let mut before: Option<(Picture, Cow<'_, Picture>)> = None;
        for (camera, exact) in &truth.flight {
            let (picture, exact) = (draw(camera, exact)?, comparable(exact, is_by_depth));
            if let Some((last, last_exact)) = &before {
                pops.push(popping([image(last), image(last_exact)], [image(&picture), image(&exact)], POP));
            }
            before = Some((picture, exact));
        }
        row.popping = (!pops.is_empty()).then(|| pops.iter().sum::<f64>() / pops.len() as f64);
        Ok(())
    }
}

/// The picture of the whole cloud as a dataset without colours is compared with it: shaded by depth too.
fn comparable(exact: &Picture, is_by_depth: bool) -> Cow<'_, Picture> {
    if !is_by_depth {
        return Cow::Borrowed(exact);
    }
    let mut shaded = exact.clone();
    shade_by_depth(&mut shaded, depth_range(exact));
    Cow::Owned(shaded)
}

fn lossless_key(row: &Row) -> String {
    let is_lossless = |name: &str| crate::Axis::ALL.iter().any(|axis| axis.name() == name && axis.is_lossless());
    let axes = crate::Axis::ALL.iter().filter_map(|axis| Some((axis.name(), row.values.get(axis.name())?)));
    let rest = axes.filter(|(name, _)| !is_lossless(name));
    rest.map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join(" ")
}

fn copy_quality(row: &mut Row, twin: &Row) {
    row.position = twin.position;
    row.is_shaded_by_depth = twin.is_shaded_by_depth;
    row.levels.clone_from(&twin.levels);
    row.sampling.clone_from(&twin.sampling);
    row.views.clone_from(&twin.views);
    row.popping = twin.popping;
    row.same_points_as = Some(twin.same_points_as.clone().unwrap_or_else(|| twin.name.clone()));
}

fn last_line(run: &Run) -> String {
    let line = run.complaint.lines().last().unwrap_or("it said nothing");
    format!("exit code {}: {line}", run.code)
}

fn cost(run: &Run, dataset: &Path, points: usize) -> Cost {
    let number = |value: &Value, name: &str| value.get(name).and_then(Value::as_f64).unwrap_or(0.0);
    let phases = run.json.get("phases").and_then(Value::as_array).into_iter().flatten();
    let bytes = bytes_of(dataset).unwrap_or(0);
    Cost {
        wall_seconds: run.wall_seconds,
        cpu_seconds: run.cpu_seconds,
        points_per_second: points as f64 / run.wall_seconds.max(f64::MIN_POSITIVE),
        phases: phases
            .map(|phase| Phase {
                name: phase.get("name").and_then(Value::as_str).unwrap_or_default().to_owned(),
                seconds: number(phase, "seconds"),
                points_per_second: number(phase, "points_per_second"),
            })
            .collect(),
        peak_memory_bytes: number(&run.json, "peak_memory_bytes") as u64,
        output_bytes: bytes,
        bytes_per_point: bytes as f64 / points.max(1) as f64,
    }
}

/// Refuses what would not fit, before it is read.
fn check_memory(points: u64, scene: &Scene, measurement: &Measurement) -> Result<(), MeasureError> {
    let Some(available) = available_memory() else { return Ok(()) };
    let needed = points.saturating_mul(BYTES_PER_POINT);
    if needed <= available {
        return Ok(());
    }
    let gib = |bytes: u64| format!("{:.1} GiB", bytes as f64 / f64::from(1 << 30));
    Err(MeasureError::TooMany {
        points: scene.points_declared,
        sample: measurement.sample,
        needed: gib(needed),
        available: gib(available),
    })
}

/// What the system says is free, where it says it.
fn available_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    Some(kib * 1024)
}

/// Writes `bytes` at `path`: the whole file, or the old one stays.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), MeasureError> {
    let fail = |error| MeasureError::Write { path: path.to_owned(), error };
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    // as any file that the user makes: others may read it if the user's mask lets them
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(fail)?;
    file.write_all(bytes).map_err(fail)?;
    file.persist(path).map_err(|e| fail(e.error))?;
    Ok(())
}
