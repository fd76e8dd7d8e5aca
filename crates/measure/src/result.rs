//! What was measured: the contents of `measure.json`.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;

use crate::{AxisError, ImageError, LevelError};

/// The result of a measurement. Lengths are in units of the scene's coordinate system, times in seconds.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct Measured {
    /// Of pointmill.
    pub version: String,
    /// False if the measurement was interrupted: rows are missing then.
    pub is_complete: bool,
    /// What was measured.
    pub scene: Scene,
    /// Threads of each conversion.
    pub threads: usize,
    /// Points that renderers may draw at once.
    pub budget: u64,
    /// Width and height of the pictures.
    pub picture_size: [u32; 2],
    /// A row per setting, in the order of the grid.
    pub rows: Vec<Row>,
    /// The setting for each output and profile.
    pub profiles: Vec<Profile>,
    /// What each option buys and costs.
    pub trades: Vec<Trade>,
    /// From start to end, seconds.
    pub seconds: f64,
}

/// The scene, or the part of it that was measured.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct Scene {
    /// Paths as they were named.
    pub inputs: Vec<String>,
    /// Points that the headers of all inputs declare.
    pub points_declared: u64,
    /// Points that were measured.
    pub points: u64,
    /// Columns of ground that were taken, of those with points; equal if the scene was measured in whole.
    pub chunks: [usize; 2],
    /// Least corner, greatest corner.
    pub bounds: [f64; 6],
    /// Whether points have colours.
    pub has_colours: bool,
    /// Bytes of the inputs.
    pub bytes: u64,
}

/// A setting with its figures.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct Row {
    /// For people.
    pub name: String,
    /// The format.
    pub output: String,
    /// The values of the axes.
    pub values: BTreeMap<&'static str, String>,
    /// What `pointmill convert` was told, besides inputs and output.
    pub arguments: Vec<String>,
    /// Of all points and values of the dataset, in any order; empty if there is none.
    pub checksum: String,
    /// Why there are no figures.
    pub failed: Option<String>,
    /// What it cost.
    pub cost: Option<Cost>,
    /// Errors of positions by axis; `None` if the dataset does not have as many points as the scene.
    pub position: Option<[AxisError; 3]>,
    /// Errors of colours and holes by level.
    pub levels: Vec<LevelError>,
    /// What `pointmill validate` measures of each level of an octree.
    pub sampling: Vec<Value>,
    /// Pictures are shaded by depth, and so are those of the cloud that they are compared with: the dataset or the scene has no
    /// colours. Their errors are those of geometry alone, and do not compare with errors of colours.
    pub is_shaded_by_depth: bool,
    /// Errors of the pictures, by view.
    pub views: Vec<ViewError>,
    /// Share of pixels that pop from one picture of a slow flight to the next, mean over the flight.
    pub popping: Option<f64>,
    /// The setting whose points these are: it differs in how they are packed alone, and its checksum of points is the same.
    pub same_points_as: Option<String>,
    /// No other setting is better in one figure and as good in all others.
    pub is_on_front: bool,
}

/// What a conversion cost.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct Cost {
    /// From start to end, seconds, with starting the program.
    pub wall_seconds: f64,
    /// Processor time, seconds; `None` where the system does not say it.
    pub cpu_seconds: Option<f64>,
    /// Points over `wall_seconds`.
    pub points_per_second: f64,
    /// By phase.
    pub phases: Vec<Phase>,
    /// The highest resident set.
    pub peak_memory_bytes: u64,
    /// Of the dataset.
    pub output_bytes: u64,
    /// Of the dataset.
    pub bytes_per_point: f64,
}

/// A phase of a conversion.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct Phase {
    /// As the report calls it.
    pub name: String,
    /// How long it took.
    pub seconds: f64,
    /// 0 if it does not go by points.
    pub points_per_second: f64,
}

/// A picture against that of the whole cloud.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct ViewError {
    /// Name of the view.
    pub view: &'static str,
    /// The differences.
    pub error: ImageError,
    /// Points drawn.
    pub points: u64,
}

/// A setting by name, for those who do not want to choose.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct Profile {
    /// `fast`, `balanced` or `exact`.
    pub name: &'static str,
    /// The format.
    pub output: String,
    /// Name of the row.
    pub setting: String,
    /// What `pointmill convert` is told.
    pub arguments: Vec<String>,
    /// The figures that stand behind it, as a sentence.
    pub why: String,
}

/// An option of an output, two of its values, and what changes from one to the other.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Trade {
    /// The format.
    pub output: String,
    /// The axis.
    pub axis: &'static str,
    /// The value that is compared with.
    pub from: String,
    /// The other value.
    pub to: String,
    /// Processor time, bytes, error of pictures: `to` over `from`, geometric mean over all pairs of settings that differ in this
    /// alone.
    pub ratios: [Option<f64>; 3],
    /// The largest error of a coordinate with either.
    pub position: [Option<f64>; 2],
    /// For people.
    pub sentence: String,
}

impl Row {
    /// Processor seconds per million points; wall seconds where the system does not say them.
    pub fn seconds_per_million(&self) -> Option<f64> {
        let cost = self.cost.as_ref()?;
        let points = cost.points_per_second * cost.wall_seconds;
        Some(cost.cpu_seconds.unwrap_or(cost.wall_seconds) / points.max(1.0) * 1e6)
    }

    /// The largest error of a coordinate, of all axes.
    pub fn position_error(&self) -> Option<f64> {
        self.position.map(|axes| axes.iter().map(|axis| axis.max).fold(0.0, f64::max))
    }

    /// Root mean square difference of the pictures' channels, 0 to 255, mean over the views.
    pub fn picture_error(&self) -> Option<f64> {
        if self.views.is_empty() {
            return None;
        }
        let of = |psnr: Option<f64>| psnr.map_or(0.0, |psnr| 255.0 / 10_f64.powf(psnr / 20.0));
        Some(self.views.iter().map(|view| of(view.error.psnr)).sum::<f64>() / self.views.len() as f64)
    }

    /// Mean ΔE2000 over the levels.
    pub fn colour_error(&self) -> Option<f64> {
        let errors: Vec<f64> = self.levels.iter().filter_map(|level| level.delta_e).collect();
        (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
    }

    /// Bytes of the dataset per point.
    pub fn bytes_per_point(&self) -> Option<f64> {
        self.cost.as_ref().map(|cost| cost.bytes_per_point)
    }
}
