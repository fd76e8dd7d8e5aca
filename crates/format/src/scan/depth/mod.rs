//! Depth maps: PNG pictures of 16-bit grey whose pixels are distances along the axis of a camera.
//!
//! A single one is described by a JSON file of its name beside it ([`crate::DepthOptions`] goes before it), with the keys
//! `fx`, `fy`, `cx`, `cy` (RealSense: `ppx`, `ppy`), `width`, `height`, `depth_scale` (units in a metre), `pose` (a 4 × 4
//! matrix row by row, camera to world) and `color` (a picture registered to it, PNG or JPEG). A folder of them with a
//! trajectory is one scan with a part for each frame (`sequence.rs` lists the files).
//!
//! * The pixel (u, v) of depth z is at ((u − cx) · z / fx, (v − cy) · z / fy, z): x right, y down, z forward. The pose is
//!   applied in double precision.
//! * A pixel of depth 0, or outside of [`crate::DepthOptions::range`], is no point: points are counted when the scan is
//!   opened. Filters change depths and make none, so that they change no count.
//! * `rgb` has 16 bits: values of 8 bits times 257. A frame without a colour picture has zeros.
//! * `NormalX`, `NormalY`, `NormalZ` come from neighbouring pixels, if they are asked for.
//! * `point source id` of a sequence is the index of the frame, from 0; beyond 65,535 it stays there.
//! * A frame of a sequence that cannot be read, or has no pose, is a piece whose decode is an error.
//!
//! Sources: J. Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM Systems", 2012 (TUM RGB-D, file formats); Intel
//! RealSense, "Projection in RealSense SDK 2.0"; Open3D, "Redwood .log"; B. Glocker et al., "7-Scenes", 2013; A. Dai et
//! al., "ScanNet", 2017; C. Tomasi, R. Manduchi, "Bilateral Filtering for Gray and Color Images", 1998.

mod assemble;
mod camera;
mod colour;
mod filter;
mod frame;
mod grid;
mod normals;
mod open;
mod picture;
mod reasons;
mod scan;
mod sequence;
mod tracked;
mod trajectory;

use std::path::Path;

use crate::{DepthOptions, ReadError, Scan};
use picture::Header;

/// True for a PNG picture of 16-bit grey, by the first bytes of its file; also for what is left of one that ends before it
/// says what it is.
pub fn is_depth(first_bytes: &[u8]) -> bool {
    Header::of(first_bytes).map_or_else(|| picture::is_cut(first_bytes), Header::is_depth)
}

/// True for a folder of depth maps with a trajectory.
pub fn is_sequence(folder: impl AsRef<Path>) -> bool {
    sequence::is_sequence(folder.as_ref())
}

/// True if a JSON file beside a depth map describes its camera.
pub fn is_described(depth_map: impl AsRef<Path>) -> bool {
    let sidecar = camera::Sidecar::read(&open::sidecar_of(depth_map.as_ref()));
    sidecar.is_ok_and(|sidecar| sidecar.is_some_and(|sidecar| sidecar.has_camera()))
}

/// Opens a depth map, or a folder of them with a trajectory: counts the pixels that have a depth. `scans`: the frames that are
/// read, each by name or number ([`crate::scans_named`]); `None`: all.
///
/// # Errors
/// A camera that is not described, or is one of pictures of another size; a picture that is none of 16-bit grey or is
/// damaged; colours of another size; no depth at all.
pub fn open(
    path: impl AsRef<Path>,
    options: &DepthOptions,
    scans: Option<&[String]>,
) -> Result<Box<dyn Scan>, ReadError> {
    let path = path.as_ref();
    let open = if path.is_dir() { open::sequence } else { open::single };
    Ok(Box::new(open(path, options, scans)?))
}

/// A PNG picture that was to be a depth map, and is none.
pub(super) fn not_depth(path: &Path, first_bytes: &[u8]) -> Option<ReadError> {
    let header = Header::of(first_bytes).filter(|header| !header.is_depth())?;
    Some(picture::not_depth(path, header))
}
