//! A scan of frames: which of their pixels are points, and what is known of it.

use std::path::Path;
use std::sync::Arc;

use super::camera::Camera;
use super::frame::Frame;
use super::picture::Rule;
use super::scan::DepthScan;
use crate::scan::chosen::chosen;
use crate::scan::quantities::NORMALS;
use crate::{
    Advice, Attribute, AttributeType, DepthFilter, DepthOptions, Piece, ReadError, Resolution, ScanInfo, ScanPart,
    ScanWarning,
};

/// Looks at the pictures of the frames that are chosen. `title`: for people.
pub(super) fn assemble(
    path: &Path,
    mut frames: Vec<Frame>,
    (options, scans): (&DepthOptions, Option<&[String]>),
    title: String,
    is_sequence: bool,
) -> Result<DepthScan, ReadError> {
    if !options.filters.iter().copied().all(DepthFilter::is_sound) {
        let (least, most) = (DepthFilter::WINDOWS.start(), DepthFilter::WINDOWS.end());
        let what = format!("a filter has no odd window of {least} to {most} pixels, or no sigma above 0");
        return Err(ReadError::unsupported(path, what).advise("choose another filter"));
    }
    let all = frames.len();
    let names: Vec<&str> = frames.iter().map(|frame| frame.name.as_str()).collect();
    let mut is_chosen = chosen(scans, &names).into_iter();
    frames.retain(|_| is_chosen.next().unwrap_or(false));
    let mut info = ScanInfo::new(path, title, 0);
    if frames.is_empty() && all > 0 {
        info.warnings.push(ScanWarning::NoneChosen { scans: all });
    }
    let mut found = Found::default();
    for (i, frame) in frames.iter_mut().enumerate() {
        found.add(i, frame, &frame.rule(options), is_sequence)?;
    }
    if let Some(error) = found.first_error.take_if(|_| found.broken == frames.len()) {
        return Err(error);
    }
    if found.points == 0 && !frames.is_empty() {
        return Err(nothing(path, options));
    }
    let has_colours = frames.iter().any(|frame| frame.colour.is_some());
    found.warn(&frames, has_colours, &mut info.warnings);
    if all > usize::from(u16::MAX) + 1 {
        info.warnings.push(ScanWarning::SourceIdsShared { scans: all });
    }
    info.format = describe(&info.format, &frames, options);
    info.resolution = [resolution(&frames); 3];
    info.points_declared = found.points;
    info.file_bytes = found.bytes;
    info.parts = found.parts;
    info.rgb_is_16_bit = has_colours;
    info.attributes = attributes(has_colours, options.normals, is_sequence);
    Ok(DepthScan { info, frames, pieces: found.pieces, piece_frames: found.piece_frames, options: options.clone() })
}

/// A part of a unit of depth below which coordinates carry nothing: they are products of whole units, but no camera measures
/// its pixels' directions as finely as that.
const UNIT_PARTS: f64 = 10.0;

fn resolution(frames: &[Frame]) -> Resolution {
    let finest = frames.iter().map(|frame| frame.camera.units_per_metre).fold(0.0, f64::max);
    if finest > 0.0 { Resolution::Step(1.0 / (finest * UNIT_PARTS)) } else { Resolution::Double }
}

/// What the frames hold.
#[derive(Default)]
struct Found {
    points: u64,
    bytes: u64,
    pieces: Vec<Piece>,
    piece_frames: Vec<usize>,
    parts: Vec<ScanPart>,
    broken: usize,
    empty: usize,
    first_error: Option<ReadError>,
}

impl Found {
    /// Looks at a frame. One of a sequence that cannot be read becomes a piece that is an error, of as many points as it may
    /// have.
    fn add(&mut self, i: usize, frame: &mut Frame, rule: &Rule, is_sequence: bool) -> Result<(), ReadError> {
        let (points, bytes) = match frame.look(rule) {
            Ok(seen) => {
                frame.size = seen.size;
                self.empty += usize::from(seen.points == 0);
                (seen.points, seen.bytes)
            }
            Err(error) if !is_sequence || error.is_io() => return Err(error),
            Err(error) => {
                self.broken += 1;
                self.first_error.get_or_insert(error);
                (u64::from(frame.size[0]) * u64::from(frame.size[1]), 0)
            }
        };
        let range = self.points..self.points + points;
        if points > 0 {
            self.pieces.push(Piece::new(range.clone(), self.bytes..self.bytes + bytes));
            self.piece_frames.push(i);
        }
        self.parts.push(ScanPart {
            number: frame.index + 1,
            name: frame.name.clone(),
            points,
            range,
            bounds: None,
            rotation: *frame.pose.linear(),
            translation: frame.pose.translation(),
        });
        self.points += points;
        self.bytes += bytes;
        Ok(())
    }

    fn warn(&mut self, frames: &[Frame], has_colours: bool, warnings: &mut Vec<ScanWarning>) {
        let of = frames.len();
        if let Some(error) = self.first_error.take() {
            warnings.push(ScanWarning::FramesUnreadable { frames: self.broken, of, first: error.what_and_where() });
        }
        if self.empty > 0 {
            warnings.push(ScanWarning::FramesEmpty { frames: self.empty, of });
        }
        let colourless = frames.iter().filter(|frame| frame.colour.is_none()).count();
        if has_colours && colourless > 0 {
            warnings.push(ScanWarning::FramesColourless { frames: colourless, of });
        }
    }
}

/// No pixel is a point.
fn nothing(path: &Path, options: &DepthOptions) -> ReadError {
    let what = match &options.range {
        None => "no pixel has a depth: all are 0".to_owned(),
        Some(range) => format!("no pixel has a depth of {} to {} m", range.start(), range.end()),
    };
    ReadError::broken(path, 0, what).advise(Advice::WrongFile)
}

fn attributes(has_colours: bool, has_normals: bool, is_sequence: bool) -> Arc<[Attribute]> {
    let colour = has_colours.then(|| Attribute::new("rgb", AttributeType::UInt16, 3));
    let normals = NORMALS.iter().filter(|_| has_normals).map(|name| Attribute::new(*name, AttributeType::Float32, 1));
    let source = is_sequence.then(|| Attribute::new("point source id", AttributeType::UInt16, 1));
    colour.into_iter().chain(normals).chain(source).collect()
}

/// "depth map, 640 × 480 pixels, fx 525 fy 525 cx 319.5 cy 239.5, 5000 units a metre, 1 filter".
fn describe(title: &str, frames: &[Frame], options: &DepthOptions) -> String {
    let Some(first) = frames.first() else { return title.to_owned() };
    let ([width, height], Camera { intrinsics, units_per_metre }) = (first.size, first.camera);
    let ([fx, fy], [cx, cy]) = (intrinsics.focal, intrinsics.centre);
    let differ = frames.iter().any(|frame| frame.camera != first.camera || frame.size != first.size);
    let others = if differ { " (of the first; others differ)" } else { "" };
    let filters = match options.filters.len() {
        0 => String::new(),
        n => format!(", {n} filter{}", if n == 1 { "" } else { "s" }),
    };
    format!(
        "{title}, {width} × {height} pixels, fx {fx} fy {fy} cx {cx} cy {cy}, {units_per_metre} units a metre{others}{filters}"
    )
}
