//! Pictures of datasets.

use pointmill_format::batches::Batches;
use pointmill_format::bintree::Bintree;
use pointmill_format::octree::Octree;

use crate::draw::draw;
use crate::projection::Projection;
use crate::sources::{BatchesSource, BintreeSource, OctreeSource};
use crate::{Camera, Picture, RenderError, Size, Style};

/// The picture of an octree, as viewers draw it: its nodes from the most important one on, until `budget` points are drawn.
/// The root is drawn whatever the budget is. `threads`: 0 is one per core.
///
/// # Errors
/// A camera that cannot be used, an attribute that is not there, a dataset that cannot be read.
pub fn render_octree(
    octree: &dyn Octree,
    camera: &Camera,
    size: Size,
    style: &Style,
    budget: u64,
    threads: usize,
) -> Result<Picture, RenderError> {
    let projection = Projection::new(camera, size)?;
    let source = OctreeSource::new(octree, &projection, style, budget)?;
    draw(&source, camera, size, style, threads)
}

/// The picture of a binary tree: leaves in sight, each with the material for its distance: single pixels far away, splats near
/// by. If they have more points than `budget`, every nth point of each. `threads`: 0 is one per core.
///
/// # Errors
/// As [`render_octree`].
pub fn render_bintree(
    tree: &Bintree,
    camera: &Camera,
    size: Size,
    style: &Style,
    budget: u64,
    threads: usize,
) -> Result<Picture, RenderError> {
    let projection = Projection::new(camera, size)?;
    let source = BintreeSource::new(tree, &projection, style, budget);
    draw(&source, camera, size, style, threads)
}

/// The picture of quantised batches: those in sight, with as many bits as [`Style::bits`] says, and the points that
/// [`Style::clod`] keeps; without it all points or, if these are more than `budget`, the levels that fit it, by a sample.
/// `threads`: 0 is one per core.
///
/// # Errors
/// As [`render_octree`].
pub fn render_batches<B: AsRef<[u8]> + Sync>(
    batches: &Batches<B>,
    camera: &Camera,
    size: Size,
    style: &Style,
    budget: u64,
    threads: usize,
) -> Result<Picture, RenderError> {
    let projection = Projection::new(camera, size)?;
    let source = BatchesSource::new(batches, &projection, style, budget)?;
    draw(&source, camera, size, style, threads)
}
