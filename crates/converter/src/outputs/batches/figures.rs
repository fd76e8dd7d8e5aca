//! The figures of the batches in the report.

use pointmill_format::batches::{BatchRecord, Precision, focal_pixels};
use serde_json::{Map, Value, json};

use super::finish::Finished;
use super::frame::Frame;
use super::settings::BatchesSettings;

/// The picture for which bits are counted: a full-HD display.
const PICTURE_HEIGHT: f64 = 1080.0;
const FOV_DEGREES: f64 = 60.0;

/// Distances at which bits are counted, in longest sides of the scene.
const DISTANCES: [f64; 6] = [0.001, 0.003, 0.01, 0.03, 0.1, 1.0];

pub(super) fn details(frame: &Frame, finished: &Finished, settings: &BatchesSettings) -> Map<String, Value> {
    let points = finished.layout.points.max(1) as f64;
    let longest = finished.records.iter().map(longest_side).fold(0.0, f64::max);
    let figures = finished.errors.figures();
    let present = Precision::ALL.into_iter().filter(|p| *p <= finished.precision);
    let errors = present.map(|p| (p.bits().to_string(), json!(figures.get(p))));
    let mut details = Map::new();
    details.insert("batches".into(), finished.layout.batches.into());
    details.insert("cell".into(), frame.grid.cell.into());
    details.insert("exponent".into(), frame.grid.exponent.into());
    details.insert("morton_bits".into(), frame.grid.morton_bits.into());
    details.insert("lod_points".into(), json!(finished.lod_points));
    details.insert("planes".into(), finished.precision.bits().into());
    if let Some(why) = planes_dropped(finished, settings) {
        details.insert("planes_dropped".into(), why.into());
    }
    details.insert("errors".into(), Map::from_iter(errors).into());
    details.insert("largest_box".into(), longest.into());
    details.insert("bytes_per_point".into(), (finished.bytes as f64 / points).into());
    details.insert("drawn".into(), drawn(frame, &finished.records));
    details
}

/// The longest side of a batch's box, world units.
fn longest_side(record: &BatchRecord) -> f64 {
    record.sides().into_iter().fold(0.0, f64::max)
}

fn planes_dropped(finished: &Finished, settings: &BatchesSettings) -> Option<String> {
    let plane = match finished.precision {
        Precision::Thirty => return None,
        Precision::Twenty => "lo10",
        Precision::Ten => "mid10 and lo10",
    };
    let bits = finished.precision.bits();
    Some(match settings.planes {
        Some(_) => format!("{plane}: {bits} bits as requested"),
        None if finished.spared > 0 => format!("{plane}: {bits} bits keep the requested precision"),
        None => format!("{plane}: in every batch the coordinate step is coarser than a cell of {bits} bits"),
    })
}

/// Batches that a renderer would draw with each number of bits, were all of them at that distance.
fn drawn(frame: &Frame, records: &[BatchRecord]) -> Value {
    let scene = frame.tight.extent().into_iter().fold(0.0, f64::max);
    let focal = focal_pixels(PICTURE_HEIGHT, FOV_DEGREES.to_radians());
    let at = |distance: f64| {
        let mut counts = [0u64; 3];
        for record in records {
            let precision = Precision::for_error(longest_side(record), distance, f64::MIN_POSITIVE, focal);
            counts[precision.planes() as usize - 1] += 1;
        }
        let [ten, twenty, thirty] = counts;
        json!({ "distance": distance, "10": ten, "20": twenty, "30": thirty })
    };
    DISTANCES.iter().map(|d| at(d * scene)).collect()
}
