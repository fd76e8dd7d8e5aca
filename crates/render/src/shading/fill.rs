//! Small gaps between points, closed from their neighbours.

use super::pixels::{Pixels, for_rows};

/// An empty pixel takes the mean of its neighbours if at least this many of the eight are filled ...
const LEAST_NEIGHBOURS: usize = 4;

/// ... and these are not all on one side, where it is beside a silhouette: of the four pairs of opposite neighbours, at
/// least this many are filled on both sides.
const LEAST_PAIRS: usize = 1;

/// Neighbours that are this part of the depth behind the nearest one belong to another surface.
const BEHIND: f32 = 0.02;

/// Empties the rejected pixels.
pub(super) fn clear(pixels: &mut Pixels<'_>, rejected: &[bool]) {
    for (depth, rejected) in pixels.depth.iter_mut().zip(rejected) {
        if *rejected {
            *depth = f32::INFINITY;
        }
    }
}

/// One round: empty pixels among filled ones get their mean colour and depth. Rejected pixels that stay empty show the
/// background.
pub(super) fn round(pixels: &mut Pixels<'_>, rejected: &[bool], background: [u8; 3], threads: usize) {
    let filled = for_rows(pixels.width, pixels.height, threads, |y, row: &mut [Option<([u8; 3], f32)>]| {
        for (x, filled) in row.iter_mut().enumerate() {
            if !pixels.depth[y * pixels.width + x].is_finite() {
                *filled = mean(pixels, x, y);
            }
        }
    });
    for (i, filled) in filled.into_iter().enumerate() {
        if let Some((rgb, depth)) = filled {
            (pixels.rgb[i], pixels.depth[i]) = (rgb, depth);
        } else if rejected.get(i) == Some(&true) && !pixels.depth[i].is_finite() {
            pixels.rgb[i] = background;
        }
    }
}

/// The neighbours, so that opposite ones are four apart.
const AROUND: [(isize, isize); 8] = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// The mean of the filled neighbours of a pixel that belong to the nearest surface around it.
fn mean(pixels: &Pixels<'_>, x: usize, y: usize) -> Option<([u8; 3], f32)> {
    let mut around = [None; 8];
    for (neighbour, (dx, dy)) in around.iter_mut().zip(AROUND) {
        if let (Some(nx), Some(ny)) = (x.checked_add_signed(dx), y.checked_add_signed(dy))
            && nx < pixels.width
            && ny < pixels.height
        {
            let at = ny * pixels.width + nx;
            *neighbour = Some(at).filter(|at| pixels.depth[*at].is_finite());
        }
    }
    let filled = || around.iter().flatten();
    let pairs = (0..4).filter(|i| around[*i].is_some() && around[i + 4].is_some()).count();
    if filled().count() < LEAST_NEIGHBOURS || pairs < LEAST_PAIRS {
        return None;
    }
    let nearest = filled().fold(f32::INFINITY, |nearest, at| nearest.min(pixels.depth[*at]));
    let (mut sums, mut depth, mut count) = ([0u32; 3], 0.0f64, 0u32);
    for at in filled().filter(|at| pixels.depth[**at] <= nearest * (1.0 + BEHIND)) {
        for (sum, c) in sums.iter_mut().zip(pixels.rgb[*at]) {
            *sum += u32::from(c);
        }
        depth += f64::from(pixels.depth[*at]);
        count += 1;
    }
    let rgb = sums.map(|sum| ((sum + count / 2) / count.max(1)) as u8);
    Some((rgb, (depth / f64::from(count.max(1))) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    const BACKGROUND: [u8; 3] = [9; 3];

    /// 3 × 3 pixels after one round; `None` is empty.
    fn filled(cells: [Option<(u8, f32)>; 9]) -> (Vec<[u8; 3]>, Vec<f32>) {
        let mut rgb: Vec<[u8; 3]> = cells.iter().map(|c| c.map_or(BACKGROUND, |(grey, _)| [grey; 3])).collect();
        let mut depth: Vec<f32> = cells.iter().map(|c| c.map_or(f32::INFINITY, |(_, depth)| depth)).collect();
        let mut pixels = Pixels { width: 3, height: 3, rgb: &mut rgb, depth: &mut depth };
        round(&mut pixels, &[false; 9], BACKGROUND, 1);
        (rgb, depth)
    }

    #[test]
    fn a_gap_takes_the_mean_of_the_nearest_surface_around_it() {
        let (n, f) = (|grey| Some((grey, 10.0)), Some((200, 20.0)));
        let (rgb, depth) = filled([n(10), n(11), f, n(10), None, f, n(12), n(10), f]);
        // 10 + 11 + 10 + 12 + 10 = 53 of five; what is behind does not count
        assert_eq!((rgb[4], depth[4]), ([11; 3], 10.0));
        assert_eq!(rgb[2], [200; 3], "what is filled stays");
    }

    #[test]
    fn what_is_beside_a_silhouette_stays_empty() {
        let n = Some((10, 10.0));
        // all on one side: the left column and the middle one, seen from the right one
        let (rgb, _) = filled([n, n, None, n, n, None, n, n, None]);
        assert_eq!([rgb[2], rgb[5], rgb[8]], [BACKGROUND; 3]);
        let (rgb, _) = filled([None, None, None, None, None, n, n, n, n]);
        assert_eq!(rgb[4], BACKGROUND, "four, but none is opposite another");
        let (rgb, _) = filled([n, None, None, None, None, None, None, None, n]);
        assert_eq!(rgb[4], BACKGROUND, "two opposite ones are a pair, but too few");
    }

    #[test]
    fn rejected_pixels_are_empty_until_they_are_filled() {
        let (mut rgb, mut depth) = (vec![[50; 3]; 9], vec![10.0; 9]);
        let mut rejected = vec![false; 9];
        rejected[4] = true;
        let mut pixels = Pixels { width: 3, height: 3, rgb: &mut rgb, depth: &mut depth };
        pixels.depth[4] = 30.0;
        pixels.rgb[4] = [250; 3];
        clear(&mut pixels, &rejected);
        round(&mut pixels, &rejected, BACKGROUND, 1);
        assert_eq!((pixels.rgb[4], pixels.depth[4]), ([50; 3], 10.0));
        let mut alone = Pixels { width: 1, height: 1, rgb: &mut [[7; 3]], depth: &mut [1.0] };
        clear(&mut alone, &[true]);
        round(&mut alone, &[true], BACKGROUND, 1);
        assert_eq!((alone.rgb[0], alone.depth[0]), (BACKGROUND, f32::INFINITY));
    }
}
