//! Options of depth maps: whether any input is one, and whether it can have the pose that was given.

use std::path::PathBuf;

use pointmill_format::{DepthOptions, OpenOptions, ScanKind};

use crate::exit::Failure;

/// True if there is an option of depth maps.
pub(crate) fn is_given(options: &OpenOptions) -> bool {
    options.depth != DepthOptions::default()
}

/// Refuses options that no input can follow; without one nothing is opened.
pub(crate) fn check(files: &[PathBuf], options: &OpenOptions) -> Result<(), Failure> {
    if !is_given(options) {
        return Ok(());
    }
    // what is of no kind, or cannot be read, is reported by its reader
    let may_be_depth = |file: &&PathBuf| matches!(ScanKind::of_file(file), Ok(None | Some(ScanKind::Depth)) | Err(_));
    let depths: Vec<&PathBuf> = files.iter().filter(may_be_depth).collect();
    if depths.is_empty() {
        let option = first(&options.depth);
        return Err(Failure::Usage(format!(
            "{option}: no input is a depth map, to which alone it applies; leave it out"
        )));
    }
    let folder = depths.iter().find(|path| path.is_dir()).map(|folder| folder.display());
    match (&options.depth, &folder) {
        (DepthOptions { pose: Some(_), .. }, Some(folder)) => Err(Failure::Usage(format!(
            "--pose: {folder} has its poses in its trajectory; --transform moves its points"
        ))),
        (DepthOptions { colours: Some(_), .. }, _) if depths.len() > 1 || folder.is_some() => Err(Failure::Usage(
            "--depth-colours: a picture has the colours of one depth map; name that one alone".into(),
        )),
        _ => Ok(()),
    }
}

/// The first option that was given.
fn first(depth: &DepthOptions) -> &'static str {
    match depth {
        DepthOptions { intrinsics: Some(_), .. } => "--intrinsics",
        DepthOptions { units_per_metre: Some(_), .. } => "--depth-scale",
        DepthOptions { pose: Some(_), .. } => "--pose",
        DepthOptions { colours: Some(_), .. } => "--depth-colours",
        DepthOptions { range: Some(_), .. } => "--depth-range",
        DepthOptions { normals: true, .. } => "--depth-normals",
        _ => "--depth-filter",
    }
}
