//! The edges of boxes, over a picture.

use pointmill_format::Aabb;

use crate::projection::Projection;
use crate::sources::Unit;
use crate::{Picture, colours};

/// An edge shows if it is at most this much farther than the points there.
const BEHIND: f32 = 1.002;

/// An edge is drawn in at most that many steps.
const MOST_STEPS: f64 = 40_000.0;

/// Draws the boxes of units into the picture, in the colours of their levels.
pub(crate) fn overlay(picture: &mut Picture, projection: &Projection, units: &[Unit]) {
    for unit in units {
        if let Some(bounds) = &unit.bounds {
            overlay_box(picture, projection, bounds, colours::of_level(unit.level));
        }
    }
}

fn overlay_box(picture: &mut Picture, projection: &Projection, bounds: &Aabb, rgb: [u8; 3]) {
    let frame = projection.world_frame();
    let corner = |i: usize| {
        let world = std::array::from_fn(|a| if i >> a & 1 == 0 { bounds.min[a] } else { bounds.max[a] });
        projection.view(&frame, world)
    };
    for from in 0..8usize {
        for to in [1, 2, 4].map(|bit| from | bit).into_iter().filter(|to| *to != from) {
            overlay_edge(picture, projection, [corner(from), corner(to)], rgb);
        }
    }
}

/// Edges are right, up and depth of their ends.
fn overlay_edge(picture: &mut Picture, projection: &Projection, [from, to]: [[f64; 3]; 2], rgb: [u8; 3]) {
    // the part in front of the eye, by a little
    let near = from[2].max(to[2]) * 1e-4;
    if near.is_nan() || near <= 0.0 {
        return;
    }
    let cut = |inner: [f64; 3], outer: [f64; 3]| {
        if outer[2] >= near {
            return outer;
        }
        let part = (inner[2] - near) / (inner[2] - outer[2]);
        std::array::from_fn(|a| inner[a] + (outer[a] - inner[a]) * part)
    };
    let (from, to) = (cut(to, from), cut(from, to));
    let [width, height] = [picture.width, picture.height].map(f64::from);
    let pixel = |[x, y, depth]: [f64; 3]| {
        let scale = projection.focal / depth;
        [width / 2.0 + x * scale, height / 2.0 - y * scale]
    };
    let (a, b) = (pixel(from), pixel(to));
    let steps = (b[0] - a[0]).abs().max((b[1] - a[1]).abs()).clamp(1.0, MOST_STEPS) as u32;
    for step in 0..=steps {
        let t = f64::from(step) / f64::from(steps);
        let [x, y] = [0, 1].map(|i| a[i] + (b[i] - a[i]) * t);
        // the inverse of the depth is what changes evenly in the picture
        let depth = (1.0 / ((1.0 - t) / from[2] + t / to[2])) as f32;
        if (0.0..width).contains(&x) && (0.0..height).contains(&y) {
            let at = y as usize * picture.width as usize + x as usize;
            if let (Some(pixel), Some(there)) = (picture.rgb.get_mut(at), picture.depth.get(at))
                && depth <= there * BEHIND
            {
                *pixel = rgb;
            }
        }
    }
}
