//! Which frames there are, with their cameras, poses and colours.

use std::path::{Path, PathBuf};

use super::assemble::assemble;
use super::camera::{Camera, Sidecar};
use super::frame::{Flaw, Frame, header_of};
use super::picture::MAX_PIXELS;
use super::scan::DepthScan;
use super::sequence::{Sequence, name_of, pose_file};
use super::trajectory::{self, MAX_SECONDS, Trajectory, nearest};
use crate::{Affine, DepthOptions, ReadError, ScanWarning};

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
        colour: options.colours.clone().or_else(|| sidecar.as_ref().and_then(Sidecar::colour)),
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
    if options.pose.is_some() || options.colours.is_some() {
        let what = "a folder of depth maps has its own poses and colours";
        return Err(ReadError::unsupported(folder, what).advise("leave the pose and the colours out"));
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
    let is_colourless = frames.iter().all(|frame| frame.colour.is_none());
    let mut scan = assemble(folder, frames, (options, scans), title, true)?;
    if sequence.lists_colours && is_colourless {
        scan.info.warnings.push(ScanWarning::ColoursElsewhere { of: count });
    }
    Ok(scan)
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
    // what cannot be read may have as many pixels as its camera; sizes that no memory is meant for are none
    let is_sound = |size: &[u32; 2]| u64::from(size[0]) * u64::from(size[1]) <= MAX_PIXELS;
    let own = header_of(&listed.depth).ok().map(|header| header.size).filter(is_sound);
    let size = own.or(camera.intrinsics.size.filter(is_sound)).unwrap_or([1, 1]);
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
                Err(error) => flaw(&path, error.offset().unwrap_or(0), error.what()),
            }
        }
    }
}

/// The file that describes the camera of a depth map.
pub(super) fn sidecar_of(depth: &Path) -> PathBuf {
    depth.with_extension("json")
}
