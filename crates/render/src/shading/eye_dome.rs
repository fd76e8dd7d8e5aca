//! Eye-dome lighting: a pixel is darker the farther it lies behind its neighbours (Boucheny, "Interactive Scientific
//! Visualization of Large Datasets: Towards a Perceptive-based Approach", 2009), with logarithms of depths, as in Potree: what
//! is twice as far needs twice the step.

use super::pixels::{Pixels, for_rows};

/// How much a step by a factor of two darkens at strength 1.
const STEEPNESS: f32 = 12.0;

/// A neighbour without a point counts as that far behind, which darkens nothing; a pixel beside it is not darkened either.
const EMPTY: f32 = f32::INFINITY;

/// Pixels between neighbours in pictures of that height; larger pictures have wider lines.
const HEIGHT_PER_PIXEL: usize = 1080;

/// Darkens the pixels.
pub(super) fn shade(pixels: &mut Pixels<'_>, strength: f32, threads: usize) {
    let (width, height) = (pixels.width, pixels.height);
    let logarithms: Vec<f32> = pixels.depth.iter().map(|d| if d.is_finite() { d.log2() } else { EMPTY }).collect();
    let away = (height / HEIGHT_PER_PIXEL).max(1);
    let shades = for_rows(width, height, threads, |y, row: &mut [f32]| {
        for (x, shade) in row.iter_mut().enumerate() {
            *shade = darkness(&logarithms, [width, height], [x, y], away, strength);
        }
    });
    for (rgb, shade) in pixels.rgb.iter_mut().zip(shades) {
        *rgb = rgb.map(|c| (f32::from(c) * shade + 0.5) as u8);
    }
}

/// What is left of the light, 0 to 1: e to the mean of what the eight neighbours are in front of the pixel.
fn darkness(logarithms: &[f32], [width, height]: [usize; 2], [x, y]: [usize; 2], away: usize, strength: f32) -> f32 {
    let own = logarithms[y * width + x];
    if own == EMPTY {
        return 1.0;
    }
    let mut sum = 0.0;
    let away = away as isize;
    for (dx, dy) in [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)] {
        let (Some(nx), Some(ny)) = (x.checked_add_signed(dx * away), y.checked_add_signed(dy * away)) else { continue };
        if nx < width && ny < height {
            sum += (own - logarithms[ny * width + nx]).max(0.0);
        }
    }
    (-sum / 8.0 * STEEPNESS * strength).exp()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_behind_its_neighbours_is_darker() {
        let mut rgb = vec![[200; 3]; 9];
        let mut depth = vec![8.0, 8.0, 8.0, 8.0, 16.0, 8.0, 8.0, 8.0, f32::INFINITY];
        let mut pixels = Pixels { width: 3, height: 3, rgb: &mut rgb, depth: &mut depth };
        shade(&mut pixels, 0.1, 1);
        // 7 neighbours, each one power of two nearer: e^(-7/8 · 12 · 0.1)
        let expected = (200.0 * (-7.0f32 / 8.0 * 1.2).exp()).round() as u8;
        assert_eq!(rgb[4], [expected; 3]);
        assert_eq!([rgb[0], rgb[8]], [[200; 3]; 2], "nothing is in front of these");
    }
}
