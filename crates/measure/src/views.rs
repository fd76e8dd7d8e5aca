//! The cameras of a measurement, and pictures by them.

use std::path::Path;

use pointmill_format::batches::Batches;
use pointmill_format::bintree::Bintree;
use pointmill_format::{Aabb, DatasetKind, locate, open_octree};
use pointmill_render::{
    Camera, Canvas, Picture, PointSize, RenderError, Shape, Size, Style, View, render_batches, render_bintree,
    render_octree,
};
use rayon::prelude::*;

use crate::cloud::Cloud;
use crate::image::Image;

/// Points that are handed to a canvas at once.
const BLOCK: usize = 8192;

/// What is left out at each end of an axis when looking for the middle of a scene, as a share of the points: far outliers must
/// not make a picture of nothing.
const TAIL: f64 = 0.005;

/// Diameter of discs that close a surface, in multiples of the mean distance between points.
const OVERLAP: f32 = 2.0;

/// A camera with a name.
#[derive(Debug, Clone)]
pub(crate) struct NamedView {
    pub(crate) name: &'static str,
    pub(crate) camera: Camera,
}

/// Four views of a scene: the whole from the side that [`View::Fit`] looks from, and from above; a tenth of it from near by; and
/// what is closest, as if one stood in it.
pub(crate) fn views(cloud: &Cloud, size: Size) -> Vec<NamedView> {
    let bounds = body(cloud);
    let whole = Camera::fit(&bounds, View::Fit, size);
    let top = Camera::fit(&bounds, View::Top, size);
    let middle = bounds.center();
    let target = nearest(cloud, middle);
    let towards = |share: f64| {
        let from = [0, 1, 2].map(|a| whole.eye[a] - whole.target[a]);
        Camera { eye: [0, 1, 2].map(|a| target[a] + from[a] * share), target, ..whole }
    };
    vec![
        NamedView { name: "whole", camera: whole },
        NamedView { name: "above", camera: top },
        NamedView { name: "near", camera: towards(0.1) },
        NamedView { name: "close", camera: towards(0.02) },
    ]
}

/// A flight of `frames` pictures from the first camera towards the second, which covers a twentieth of the way: as slow as a
/// viewer's.
pub(crate) fn flight(from: &Camera, to: &Camera, frames: usize) -> Vec<Camera> {
    let step = |i: usize| 0.05 * i as f64 / frames.saturating_sub(1).max(1) as f64;
    let mix = |a: [f64; 3], b: [f64; 3], t: f64| [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * t);
    let camera = |t: f64| Camera { eye: mix(from.eye, to.eye, t), target: mix(from.target, to.target, t), ..*from };
    (0..frames).map(|i| camera(step(i))).collect()
}

/// The bounds without the outermost points.
fn body(cloud: &Cloud) -> Aabb {
    // an even sample: the order of points says where they are
    let step = (cloud.len() / 200_000).max(1);
    let range = |axis: &Vec<f64>| {
        let mut sample: Vec<f64> = axis.iter().step_by(step).copied().collect();
        sample.sort_unstable_by(f64::total_cmp);
        let last = sample.len().saturating_sub(1);
        let tail = (last as f64 * TAIL) as usize;
        (sample.get(tail).copied().unwrap_or(0.0), sample.get(last - tail).copied().unwrap_or(0.0))
    };
    let ranges = cloud.xyz.each_ref().map(range);
    Aabb { min: ranges.map(|r| r.0), max: ranges.map(|r| r.1) }
}

/// The point that is nearest to a place.
fn nearest(cloud: &Cloud, place: [f64; 3]) -> [f64; 3] {
    let at = |i: usize| cloud.xyz.each_ref().map(|axis| axis[i]);
    let distance = |p: [f64; 3]| -> f64 { p.iter().zip(place).map(|(a, b)| (a - b) * (a - b)).sum() };
    let key = |i: usize| (distance(at(i)), i);
    let first = (0..cloud.len()).into_par_iter().map(key).min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    first.map_or(place, |(_, i)| at(i))
}

/// The picture of all points, the best that there is: discs as large as the distance between points, colours averaged, gaps
/// filled. `spacing`: that distance, world units.
pub(crate) fn draw_cloud(cloud: &Cloud, camera: &Camera, size: Size, spacing: f64) -> Result<Picture, RenderError> {
    let disc = PointSize::World(OVERLAP * spacing as f32);
    let style = Style { is_filled: true, shape: Shape::Paraboloid, size: disc, ..Style::averaged() };
    let mut canvas = Canvas::new(size, camera, &style)?;
    let grey = [[160; 3]; BLOCK];
    loop {
        (0..cloud.len().div_ceil(BLOCK)).into_par_iter().for_each(|block| {
            let range = block * BLOCK..((block + 1) * BLOCK).min(cloud.len());
            let positions: Vec<[f64; 3]> = range.clone().map(|i| cloud.xyz.each_ref().map(|axis| axis[i])).collect();
            let colours = if cloud.rgb.is_empty() { &grey[..range.len()] } else { &cloud.rgb[range] };
            canvas.add(&positions, colours);
        });
        if !canvas.next_pass() {
            let mut picture = canvas.finish();
            if cloud.rgb.is_empty() {
                let range = depth_range(&picture);
                shade_by_depth(&mut picture, range);
            }
            return Ok(picture);
        }
    }
}

/// The least and the greatest depth of a picture that shows something.
pub(crate) fn depth_range(picture: &Picture) -> (f32, f32) {
    let shown = picture.depth.iter().filter(|depth| depth.is_finite());
    shown.fold((f32::INFINITY, 0.0), |(least, most), depth| (least.min(*depth), most.max(*depth)))
}

/// Colours of scenes that have none: from white at the least depth to dark grey at the greatest, whatever a renderer would
/// take instead (intensity, height), so that pictures of all datasets compare.
pub(crate) fn shade_by_depth(picture: &mut Picture, (least, most): (f32, f32)) {
    for (rgb, depth) in picture.rgb.iter_mut().zip(&picture.depth).filter(|(_, depth)| depth.is_finite()) {
        let share = if most > least { (depth - least) / (most - least) } else { 0.0 };
        *rgb = [(255.0 - 200.0 * share.clamp(0.0, 1.0)) as u8; 3];
    }
}

/// A dataset that stays open for several pictures.
pub(crate) enum Drawable {
    Octree(Box<dyn pointmill_format::octree::Octree>),
    Bintree(Box<Bintree>),
    Batches(Box<Batches<pointmill_format::batches::MappedFile>>),
}

impl Drawable {
    pub(crate) fn open(path: &Path) -> Result<Self, RenderError> {
        let located = locate(path)?;
        Ok(match located.kind {
            DatasetKind::Bintree => Self::Bintree(Box::new(Bintree::open(path)?)),
            DatasetKind::Batches => Self::Batches(Box::new(Batches::map(located.marker_path())?)),
            _ => Self::Octree(open_octree(path)?),
        })
    }

    /// The picture as the dataset's renderers draw it.
    pub(crate) fn draw(&self, camera: &Camera, size: Size, style: &Style, budget: u64) -> Result<Picture, RenderError> {
        let threads = rayon::current_num_threads();
        match self {
            Self::Octree(octree) => render_octree(&**octree, camera, size, style, budget, threads),
            Self::Bintree(tree) => render_bintree(tree, camera, size, style, budget, threads),
            Self::Batches(batches) => render_batches(&**batches, camera, size, style, budget, threads),
        }
    }
}

/// As the comparison takes it.
pub(crate) fn image(picture: &Picture) -> Image<'_> {
    Image { width: picture.width as usize, rgb: &picture.rgb, depth: &picture.depth }
}
