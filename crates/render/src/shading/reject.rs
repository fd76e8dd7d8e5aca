//! Pixels that show something through the gaps of a nearer surface.
//!
//! The visibility operator of Pintus, Gobbetti, Agus ("Real-time Rendering of Massive Unstructured Raw Point Clouds using
//! Screen-space Operators", 2011): a point is visible if a cone that is wide enough, with its tip at the point and open towards
//! the eye, is free of other points. In the neighbourhood of 7 × 7 pixels, each of eight sectors has the widest angle that its
//! neighbours leave free; the sum of these angles is the opening of the cone.

use super::pixels::{Pixels, for_rows};

/// Neighbours on each side.
const REACH: isize = 3;

const SECTORS: usize = 8;

/// A point whose eight free angles are less than this together, in units of a right angle each, is hidden. Eight free sectors
/// have eight right angles or more. A point on a surface that is seen at 60 degrees still has four and a half; one behind
/// a surface with gaps has next to none.
const LEAST_FREE: f32 = 2.6;

/// A neighbour counts as nearer from this part of the depth on: less is the noise of one surface.
const NEARER: f32 = 0.002;

/// True for pixels that are rejected. `focal`: pixels per unit at a depth of one unit.
pub(super) fn rejected(pixels: &Pixels<'_>, focal: f32, threads: usize) -> Vec<bool> {
    let offsets = offsets();
    for_rows(pixels.width, pixels.height, threads, |y, row| {
        for (x, rejected) in row.iter_mut().enumerate() {
            *rejected = is_hidden(pixels, focal, &offsets, x, y);
        }
    })
}

/// A neighbour: right, down, sector, and its distance in pixels.
type Offset = (isize, isize, usize, f32);

fn offsets() -> Vec<Offset> {
    let all = (-REACH..=REACH).flat_map(|dy| (-REACH..=REACH).map(move |dx| (dx, dy)));
    let neighbours = all.filter(|offset| *offset != (0, 0));
    neighbours.map(|(dx, dy)| (dx, dy, sector(dx, dy), ((dx * dx + dy * dy) as f32).sqrt())).collect()
}

/// The eighth of the directions around a pixel.
fn sector(dx: isize, dy: isize) -> usize {
    let turn = (dy as f32).atan2(dx as f32) / std::f32::consts::TAU + 1.0;
    // sectors are around the axes and diagonals, not between them
    (turn * SECTORS as f32).round() as usize % SECTORS
}

fn is_hidden(pixels: &Pixels<'_>, focal: f32, offsets: &[Offset], x: usize, y: usize) -> bool {
    let depth = pixels.depth[y * pixels.width + x];
    if !depth.is_finite() {
        return false;
    }
    // the largest ratio of nearer to sideways: the cotangent of the angle that is free
    let mut blocked = [0.0f32; SECTORS];
    let mut any = false;
    let pixel = depth / focal;
    for (dx, dy, sector, distance) in offsets {
        let (Some(nx), Some(ny)) = (x.checked_add_signed(*dx), y.checked_add_signed(*dy)) else { continue };
        if nx >= pixels.width || ny >= pixels.height {
            continue;
        }
        let nearer = depth - pixels.depth[ny * pixels.width + nx];
        if nearer > depth * NEARER {
            blocked[*sector] = blocked[*sector].max(nearer / (distance * pixel));
            any = true;
        }
    }
    // angle from the line to the eye to the highest neighbour of each sector, in right angles
    let free = |ratio: &f32| if *ratio > 0.0 { (1.0 / ratio).atan() / std::f32::consts::FRAC_PI_2 } else { 1.0 };
    any && blocked.iter().map(free).sum::<f32>() < LEAST_FREE
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of depths, focal length of 100 pixels.
    fn hidden(width: usize, depth: &mut [f32], x: usize, y: usize) -> bool {
        let mut rgb = vec![[0; 3]; depth.len()];
        let height = depth.len() / width;
        let pixels = Pixels { width, height, rgb: &mut rgb, depth };
        rejected(&pixels, 100.0, 1)[y * width + x]
    }

    #[test]
    fn sectors_are_eighths() {
        let found = [(1, 0), (3, 1), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (3, -1)];
        assert_eq!(found.map(|(dx, dy)| sector(dx, dy)), [0, 0, 1, 2, 3, 4, 5, 6, 7, 0]);
    }

    #[test]
    fn a_point_behind_a_grid_of_points_is_rejected() {
        // a surface at 10, every other pixel; behind it a point at 20
        let mut depth = vec![f32::INFINITY; 15 * 15];
        for i in (0..depth.len()).filter(|i| i / 15 % 2 == 0 && i % 15 % 2 == 0) {
            depth[i] = 10.0;
        }
        depth[7 * 15 + 7] = 20.0;
        assert!(hidden(15, &mut depth, 7, 7));
        assert!(!hidden(15, &mut depth, 6, 6), "the surface itself stays");
    }

    #[test]
    fn a_point_beside_an_edge_stays() {
        // a wall at 10 in the left half, ground at 20 in the right one
        let mut depth: Vec<f32> = (0..15 * 15).map(|i| if i % 15 < 7 { 10.0 } else { 20.0 }).collect();
        for x in 7..15 {
            assert!(!hidden(15, &mut depth, x, 7), "{x}");
        }
    }

    #[test]
    fn slopes_and_noise_stay() {
        // pixels are 0.1 wide at 10: a plane that rises by 1.7 per unit sideways, as one seen at 60 degrees does
        let mut steep: Vec<f32> = (0..15 * 15).map(|i| 10.0 + 0.17 * (i % 15) as f32).collect();
        assert!(!hidden(15, &mut steep, 7, 7));
        let mut noisy: Vec<f32> = (0..15 * 15).map(|i| 10.0 + 0.01 * (i * 7 % 3) as f32).collect();
        assert!(!hidden(15, &mut noisy, 7, 7));
    }
}
