//! A folder of depth images with a trajectory: which files are its frames.
//!
//! | file | what it is |
//! |---|---|
//! | `groundtruth.txt`, `trajectory.txt`, `*.freiburg` | `timestamp tx ty tz qx qy qz qw`, a line for each pose (TUM RGB-D) |
//! | `trajectory.log` | three numbers and a 4 × 4 matrix for each frame (Redwood, Open3D) |
//! | `NAME.pose.txt`, `pose/NAME.txt`, `poses/NAME.txt` | a 4 × 4 matrix for each frame (7-Scenes, ScanNet) |
//! | `depth.txt`, `rgb.txt` | `timestamp file`, a line for each picture (TUM RGB-D) |
//! | `depth/*.png`, else `*.depth.png` and PNG pictures of 16-bit grey | the frames where there is no `depth.txt` |
//! | `rgb/`, `color/`, `colour/` or `image/` `NAME.png`, `.jpg`; `NAME.color.png`, `.jpg` | colours of a frame that has none in `rgb.txt` |
//! | `camera.json`, `intrinsics.json` | the camera of all frames |

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use super::camera::Sidecar;
use super::picture::{Header, first_bytes, is_cut};
use super::trajectory::{MAX_SECONDS, Trajectory, lines, nearest, text};
use crate::{Advice, ReadError};

/// Files of times and poses, by name.
const TIMED: [&str; 2] = ["groundtruth.txt", "trajectory.txt"];
const TIMED_ENDING: &str = "freiburg";
const COUNTED: &str = "trajectory.log";
const POSE_FOLDERS: [&str; 2] = ["pose", "poses"];
const POSE_ENDING: &str = ".pose.txt";
const DEPTH_LIST: &str = "depth.txt";
const COLOUR_LIST: &str = "rgb.txt";
const DEPTH_FOLDER: &str = "depth";
const DEPTH_ENDING: &str = ".depth.png";
const COLOUR_ENDING: &str = ".color.png";
const COLOUR_FOLDERS: [&str; 4] = ["rgb", "color", "colour", "image"];
const COLOUR_ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];
const CAMERAS: [&str; 2] = ["camera.json", "intrinsics.json"];

/// Frames of a folder, each of which is described in memory.
const MAX_FRAMES: usize = 200_000;

/// A frame, as its folder has it.
#[derive(Debug)]
pub(super) struct Listed {
    /// The depth picture's name without extension.
    pub(super) name: String,
    /// Seconds, where the name of the picture or a list says them.
    pub(super) time: Option<f64>,
    pub(super) depth: PathBuf,
    pub(super) colour: Option<PathBuf>,
}

/// A folder of frames.
#[derive(Debug)]
pub(super) struct Sequence {
    pub(super) folder: PathBuf,
    pub(super) trajectory: Trajectory,
    pub(super) frames: Vec<Listed>,
    /// True if a list names colour pictures and their times.
    pub(super) lists_colours: bool,
    /// That of all frames.
    pub(super) camera: Option<Sidecar>,
}

/// True for a folder of depth images with a trajectory.
pub(super) fn is_sequence(folder: &Path) -> bool {
    folder.is_dir() && (trajectory_file(folder).is_some() || has_poses(folder)) && has_depths(folder)
}

/// The file of all poses, and whether it has times.
fn trajectory_file(folder: &Path) -> Option<(PathBuf, bool)> {
    let named = TIMED.iter().map(|name| (folder.join(name), true)).find(|(path, _)| path.is_file());
    let freiburg = || {
        let mut found: Vec<PathBuf> = files(folder).filter(|path| has_ending(path, &[TIMED_ENDING])).collect();
        found.sort();
        found.into_iter().next().map(|path| (path, true))
    };
    let counted = || Some((folder.join(COUNTED), false)).filter(|(path, _)| path.is_file());
    named.or_else(freiburg).or_else(counted)
}

fn has_poses(folder: &Path) -> bool {
    POSE_FOLDERS.iter().any(|name| folder.join(name).is_dir())
        || files(folder).any(|path| file_name(&path).ends_with(POSE_ENDING))
}

fn has_depths(folder: &Path) -> bool {
    folder.join(DEPTH_LIST).is_file()
        || files(&folder.join(DEPTH_FOLDER)).any(|path| is_png(&path))
        || files(folder).any(|path| is_depth_file(&path))
}

/// A depth picture outside of a folder of depths: by name, or by what it is. One that was cut within its header may be a frame,
/// and is not passed over.
fn is_depth_file(path: &Path) -> bool {
    let is_depth = |first: Vec<u8>| match Header::of(&first) {
        Some(header) => header.is_depth(),
        None => first.is_empty() || is_cut(&first),
    };
    let name = file_name(path);
    name.ends_with(DEPTH_ENDING)
        || is_png(path) && !name.ends_with(COLOUR_ENDING) && first_bytes(path).is_ok_and(is_depth)
}

impl Sequence {
    /// Reads what the folder says of its frames; the pictures are not opened.
    pub(super) fn read(folder: &Path) -> Result<Self, ReadError> {
        let trajectory = match trajectory_file(folder) {
            Some((path, true)) => Trajectory::timed(&path)?,
            Some((path, false)) => Trajectory::counted(&path)?,
            None => Trajectory::Each,
        };
        let mut frames = if folder.join(DEPTH_LIST).is_file() { listed(folder)? } else { found(folder) };
        if frames.len() > MAX_FRAMES {
            let what = format!("there are more than {MAX_FRAMES} frames in it");
            return Err(ReadError::unsupported(folder, what).advise("divide it into several folders"));
        }
        let list = folder.join(COLOUR_LIST);
        let mut colours = if list.is_file() { list_of(folder, &list)? } else { Vec::new() };
        colours.sort_by(|a, b| a.0.total_cmp(&b.0));
        for frame in &mut frames {
            let found = frame.time.and_then(|time| nearest(&colours, time));
            let near = found.filter(|(_, seconds)| *seconds <= MAX_SECONDS).map(|(path, _)| path.clone());
            frame.colour = near.or_else(|| colour_of(folder, frame));
        }
        let files = CAMERAS.iter().map(|name| Sidecar::read(&folder.join(name)));
        let camera = files.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().next();
        Ok(Self { folder: folder.to_path_buf(), trajectory, frames, lists_colours: !colours.is_empty(), camera })
    }
}

/// The file with the pose of that frame, where each has one; if there is none, where it should be.
pub(super) fn pose_file(folder: &Path, frame: &Listed) -> PathBuf {
    let mut places = POSE_FOLDERS.iter().map(|name| folder.join(name).join(format!("{}.txt", frame.name)));
    let beside = frame.depth.with_file_name(format!("{}{POSE_ENDING}", frame.name));
    if beside.is_file() { beside } else { places.find(|path| path.is_file()).unwrap_or(beside) }
}

fn listed(folder: &Path) -> Result<Vec<Listed>, ReadError> {
    let frames = list_of(folder, &folder.join(DEPTH_LIST))?;
    Ok(frames
        .into_iter()
        .map(|(time, depth)| Listed { name: name_of(&depth), time: Some(time), depth, colour: None })
        .collect())
}

/// Times and files.
fn list_of(folder: &Path, list: &Path) -> Result<Vec<(f64, PathBuf)>, ReadError> {
    let text = text(list)?;
    let entry = |line: super::trajectory::Line<'_>| {
        let found = line.text.split_once(char::is_whitespace);
        let entry = found.and_then(|(time, file)| {
            Some((time.parse().ok().filter(|time: &f64| time.is_finite())?, folder.join(file.trim())))
        });
        entry.ok_or_else(|| {
            ReadError::broken(list, line.at, "expected a timestamp and a file name").advise(Advice::ExportAgain)
        })
    };
    lines(&text).map(entry).collect()
}

/// The depth pictures that are there, by time if all have one, else by name.
fn found(folder: &Path) -> Vec<Listed> {
    let inner = folder.join(DEPTH_FOLDER);
    let mut depths: Vec<PathBuf> = files(&inner).filter(|path| is_png(path)).collect();
    if depths.is_empty() {
        depths = files(folder).filter(|path| is_depth_file(path)).collect();
    }
    depths.sort();
    let frame = |depth: PathBuf| {
        let name = name_of(&depth);
        Listed { time: name.parse().ok().filter(|time: &f64| time.is_finite()), name, depth, colour: None }
    };
    let mut frames: Vec<Listed> = depths.into_iter().map(frame).collect();
    if frames.iter().all(|frame| frame.time.is_some()) {
        frames.sort_by(|a, b| a.time.unwrap_or_default().total_cmp(&b.time.unwrap_or_default()));
    }
    frames
}

/// The colour picture that has the name of a frame.
fn colour_of(folder: &Path, frame: &Listed) -> Option<PathBuf> {
    let inner = COLOUR_FOLDERS.iter().map(|name| folder.join(name).join(&frame.name));
    let beside = [frame.depth.with_file_name(format!("{}.color", frame.name))];
    let endings = |place: PathBuf| {
        COLOUR_ENDINGS.iter().map(move |ending| {
            let mut path = place.clone().into_os_string();
            path.push(".");
            path.push(ending);
            PathBuf::from(path)
        })
    };
    inner.chain(beside).flat_map(endings).find(|path| path.is_file())
}

/// Without extension, and without the word that marks a depth picture.
pub(super) fn name_of(depth: &Path) -> String {
    let name = file_name(depth);
    let bare = name.strip_suffix(DEPTH_ENDING).map(str::to_owned);
    bare.unwrap_or_else(|| depth.file_stem().map_or(name, |stem| stem.to_string_lossy().into_owned()))
}

fn files(folder: &Path) -> impl Iterator<Item = PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    // what a Finder leaves beside a file has its name
    entries.map(|entry| entry.path()).filter(|path| !file_name(path).starts_with("._"))
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

fn is_png(path: &Path) -> bool {
    has_ending(path, &["png"])
}

fn has_ending(path: &Path, endings: &[&str]) -> bool {
    let ending = path.extension().and_then(OsStr::to_str);
    ending.is_some_and(|ending| endings.iter().any(|e| ending.eq_ignore_ascii_case(e)))
}
