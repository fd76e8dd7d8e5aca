//! Which frames there are, and which of their pixels are points.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::camera::{Camera, Sidecar};
use super::frame::{Flaw, Frame, header_of};
use super::picture::Rule;
use super::scan::DepthScan;
use super::sequence::{Sequence, name_of, pose_file};
use super::trajectory::{self, MAX_SECONDS, Trajectory, nearest};
use crate::scan::chosen::chosen;
use crate::scan::quantities::NORMALS;
use crate::{
    Advice, Affine, Attribute, AttributeType, DepthOptions, Piece, ReadError, Resolution, ScanInfo, ScanPart,
    ScanWarning,
};

/// A single depth map.
pub(super) fn single(path: &Path, options: &DepthOptions, scans: Option<&[String]>) -> Result<DepthScan, ReadError> {
    // what is no depth map says so before anything about its camera
    let header = header_of(path)?;
    let sidecar = Sidecar::read(&sidecar_of(path))?;
    let files: Vec<&Sidecar> = sidecar.iter().collect();
    let camera = Camera::of(path, options, &files)?;
    let of_file = sidecar.as_ref().map(Sidecar::pose).transpose()?.flatten();
    let frame = Frame {
        name: name_of(path),
        index: 0,
        depth: path.to_path_buf(),
        colour: sidecar.as_ref().and_then(Sidecar::colour),
        camera,
        pose: options.pose.or(of_file).unwrap_or(Affine::IDENTITY),
        size: header.size,
        fault: None,
    };
    assemble(path, vec![frame], (options, scans), "depth map".to_owned(), false)
}

/// A folder of depth maps with a trajectory.
pub(super) fn sequence(
    folder: &Path,
    options: &DepthOptions,
    scans: Option<&[String]>,
) -> Result<DepthScan, ReadError> {
    if options.pose.is_some() {
        let what = "a folder of depth maps has its poses in its trajectory";
        return Err(ReadError::unsupported(folder, what).advise("leave the pose out, or move the points"));
    }
    let sequence = Sequence::read(folder)?;
    let count = sequence.frames.len();
    if let Trajectory::Counted { path, poses } = &sequence.trajectory
        && poses.len() != count
    {
        let what = format!("there are {} poses, and {count} depth maps in the folder", poses.len());
        return Err(ReadError::broken(path, None, what).advise("which belong together cannot be told; complete it"));
    }
    let frames = (0..count).map(|index| frame(&sequence, index, options)).collect::<Result<Vec<_>, _>>()?;
    let title = format!("{count} depth maps with a trajectory");
    assemble(folder, frames, (options, scans), title, true)
}

/// A frame of a sequence; what is wrong with it alone stays in it.
fn frame(sequence: &Sequence, index: usize, options: &DepthOptions) -> Result<Frame, ReadError> {
    let listed = &sequence.frames[index];
    let own = Sidecar::read(&sidecar_of(&listed.depth))?;
    let files: Vec<&Sidecar> = own.iter().chain(&sequence.camera).collect();
    let camera = Camera::of(&sequence.folder, options, &files)?;
    let (pose, fault) = match pose_of(sequence, index)? {
        Ok(pose) => (pose, None),
        Err(flaw) => (Affine::IDENTITY, Some(flaw)),
    };
    let size = header_of(&listed.depth).map_or_else(|_| camera.intrinsics.size.unwrap_or([1, 1]), |header| header.size);
    let (name, depth, colour) = (listed.name.clone(), listed.depth.clone(), listed.colour.clone());
    Ok(Frame { name, index, depth, colour, camera, pose, size, fault })
}

/// The pose of a frame, or why it has none.
fn pose_of(sequence: &Sequence, index: usize) -> Result<Result<Affine, Flaw>, ReadError> {
    let listed = &sequence.frames[index];
    let name = &listed.name;
    let flaw = |path: &Path, at, what| Ok(Err(Flaw { path: path.to_path_buf(), at, what }));
    match &sequence.trajectory {
        Trajectory::Counted { path, poses } => match poses.get(index) {
            Some(pose) => Ok(Ok(*pose)),
            None => flaw(path, 0, format!("no pose for {name}")),
        },
        Trajectory::Timed { path, poses } => {
            let Some(time) = listed.time else {
                return flaw(
                    path,
                    0,
                    format!("no pose for {name}: poses have times, and the name of the picture is none"),
                );
            };
            match nearest(poses, time) {
                None => flaw(path, 0, format!("no pose for {name}: there are none in it")),
                Some(((_, pose), seconds)) if seconds <= MAX_SECONDS => Ok(Ok(*pose)),
                Some(((at, _), seconds)) => flaw(
                    path,
                    *at,
                    format!("no pose for {name}: the nearest is {seconds:.3} s away, more than {MAX_SECONDS} s"),
                ),
            }
        }
        Trajectory::Each => {
            let path = pose_file(&sequence.folder, listed);
            if !path.is_file() {
                return flaw(&path, 0, format!("no pose for {name}: there is no such file"));
            }
            match trajectory::of_file(&path) {
                Ok(pose) => Ok(Ok(pose)),
                Err(error) if error.is_io() => Err(error),
                Err(error) => flaw(&path, 0, error.what()),
            }
        }
    }
}

/// The file that describes the camera of a depth map.
pub(super) fn sidecar_of(depth: &Path) -> PathBuf {
    depth.with_extension("json")
}

fn assemble(
    path: &Path,
    mut frames: Vec<Frame>,
    (options, scans): (&DepthOptions, Option<&[String]>),
    title: String,
    is_sequence: bool,
) -> Result<DepthScan, ReadError> {
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
