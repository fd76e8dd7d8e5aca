//! How far one picture is from another.

use serde::Serialize;

/// Side of the windows of the structural similarity, pixels.
const WINDOW: usize = 8;

/// Distance between windows, pixels.
const STRIDE: usize = 4;

/// Constants that keep its quotients finite (Wang et al. 2004): (0.01 · 255)² and (0.03 · 255)².
const C1: f64 = 6.5025;
const C2: f64 = 58.5225;

/// A picture, and how far each pixel is from the eye.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Image<'a> {
    pub(crate) width: usize,
    /// Red, green and blue, row by row from the top.
    pub(crate) rgb: &'a [[u8; 3]],
    /// Along the axis of view, world units; infinite where nothing is.
    pub(crate) depth: &'a [f32],
}

/// Differences between the picture of a dataset and that of the whole cloud at the same camera.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ImageError {
    /// Peak signal-to-noise ratio of the colours over all pixels, dB; `None` if there is no difference.
    pub psnr: Option<f64>,
    /// Mean structural similarity of the luma, −1 to 1 (equal).
    pub ssim: f64,
    /// Pixels that show the cloud in its picture, and nothing here; a share of the pixels that show the cloud.
    pub holes: f64,
    /// Pixels that show something here and nothing in the picture of the cloud, likewise.
    pub extra: f64,
    /// Mean difference of depths, world units, over pixels that show something in both.
    pub depth_mean: f64,
    /// 95 % of these pixels have no larger one.
    pub depth_p95: f64,
}

/// Compares pictures of one size.
pub(crate) fn compare(image: Image<'_>, exact: Image<'_>) -> ImageError {
    let count = image.rgb.len().min(exact.rgb.len());
    let squares: u64 = image.rgb.iter().zip(exact.rgb).map(|(a, b)| squared_distance(*a, *b)).sum();
    let mean_square = squares as f64 / (3 * count.max(1)) as f64;
    let psnr = (squares > 0).then(|| 10.0 * (255.0 * 255.0 / mean_square).log10());
    let (mut shown, mut holes, mut extra) = (0_u64, 0_u64, 0_u64);
    let mut depths = Vec::new();
    for (here, there) in image.depth.iter().zip(exact.depth) {
        shown += u64::from(there.is_finite());
        match (here.is_finite(), there.is_finite()) {
            (false, true) => holes += 1,
            (true, false) => extra += 1,
            (true, true) => depths.push(f64::from(here - there).abs()),
            (false, false) => {}
        }
    }
    let share = |pixels: u64| pixels as f64 / shown.max(1) as f64;
    depths.sort_unstable_by(f64::total_cmp);
    let rank = (depths.len() * 95).div_ceil(100).max(1) - 1;
    ImageError {
        psnr,
        ssim: similarity(image, exact),
        holes: share(holes),
        extra: share(extra),
        depth_mean: depths.iter().sum::<f64>() / depths.len().max(1) as f64,
        depth_p95: depths.get(rank).copied().unwrap_or(0.0),
    }
}

fn squared_distance(a: [u8; 3], b: [u8; 3]) -> u64 {
    a.iter().zip(b).map(|(a, b)| u64::from(a.abs_diff(b)).pow(2)).sum()
}

/// Luma of BT.601, 0 to 255.
pub(crate) fn luma(rgb: [u8; 3]) -> f64 {
    let [r, g, b] = rgb.map(f64::from);
    0.299 * r + 0.587 * g + 0.114 * b
}

/// Mean structural similarity over windows without weights (Wang, Bovik, Sheikh, Simoncelli 2004, §III.B).
fn similarity(image: Image<'_>, exact: Image<'_>) -> f64 {
    let width = image.width;
    let height = image.rgb.len().checked_div(width).unwrap_or(0);
    let [a, b] = [image, exact].map(|i| i.rgb.iter().map(|c| luma(*c)).collect::<Vec<f64>>());
    // a picture smaller than a window is one window
    let (w, h) = (WINDOW.min(width), WINDOW.min(height));
    let (mut sum, mut windows) = (0.0, 0_u64);
    for y in (0..=height - h).step_by(STRIDE) {
        for x in (0..=width - w).step_by(STRIDE) {
            sum += window_similarity(&a, &b, (y..y + h).flat_map(|y| (x..x + w).map(move |x| y * width + x)));
            windows += 1;
        }
    }
    if windows == 0 { 1.0 } else { sum / windows as f64 }
}

fn window_similarity(a: &[f64], b: &[f64], window: impl Iterator<Item = usize>) -> f64 {
    let (mut n, mut sa, mut sb, mut saa, mut sbb, mut sab) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
    for i in window {
        let (va, vb) = (a[i], b[i]);
        n += 1.0;
        sa += va;
        sb += vb;
        saa += va * va;
        sbb += vb * vb;
        sab += va * vb;
    }
    if n == 0.0 {
        return 1.0;
    }
    let (ma, mb) = (sa / n, sb / n);
    let (va, vb, cov) = (saa / n - ma * ma, sbb / n - mb * mb, sab / n - ma * mb);
    ((2.0 * ma * mb + C1) * (2.0 * cov + C2)) / ((ma * ma + mb * mb + C1) * (va + vb + C2))
}

/// The share of pixels whose error changes by more than `threshold` (luma, 0 to 255) from one picture of a flight to the next:
/// what pops, while the cloud itself moves as it should.
pub(crate) fn popping(before: [Image<'_>; 2], after: [Image<'_>; 2], threshold: f64) -> f64 {
    let error = |[image, exact]: [Image<'_>; 2], i: usize| luma(image.rgb[i]) - luma(exact.rgb[i]);
    let count = before.iter().chain(&after).map(|image| image.rgb.len()).min().unwrap_or(0);
    let pops = (0..count).filter(|i| (error(after, *i) - error(before, *i)).abs() > threshold).count();
    pops as f64 / count.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image<'a>(rgb: &'a [[u8; 3]], depth: &'a [f32]) -> Image<'a> {
        Image { width: 16, rgb, depth }
    }

    #[test]
    fn equal_pictures_differ_in_nothing() {
        let rgb: Vec<[u8; 3]> = (0..256).map(|i| [i as u8, 0, 255 - i as u8]).collect();
        let depth = vec![2.0; 256];
        let equal = compare(image(&rgb, &depth), image(&rgb, &depth));
        assert_eq!(equal, ImageError { ssim: 1.0, ..ImageError::default() });
    }

    #[test]
    fn differences_are_those_of_the_definitions() {
        let (black, grey) = (vec![[0; 3]; 256], vec![[51; 3]; 256]);
        let mut far = vec![3.0; 256];
        far[0] = f32::INFINITY;
        let mut near = vec![1.0; 256];
        near[1] = f32::INFINITY;
        let found = compare(image(&grey, &near), image(&black, &far));
        // a fifth of the range: 10 · log10(25)
        assert!((found.psnr.unwrap() - 13.979_400_086_720_376).abs() < 1e-9);
        // flat windows: C1 / (51² + C1)
        assert!((found.ssim - C1 / (2601.0 + C1)).abs() < 1e-9, "{}", found.ssim);
        assert_eq!((found.holes, found.extra), (1.0 / 255.0, 1.0 / 255.0));
        assert_eq!((found.depth_mean, found.depth_p95), (2.0, 2.0));
    }

    #[test]
    fn structure_that_is_turned_round_is_not_similar() {
        let rgb: Vec<[u8; 3]> = (0..256).map(|i| [if i % 2 == 0 { 0 } else { 255 }; 3]).collect();
        let other: Vec<[u8; 3]> = rgb.iter().map(|c| c.map(|v| 255 - v)).collect();
        let depth = vec![1.0; 256];
        assert!(compare(image(&rgb, &depth), image(&other, &depth)).ssim < -0.9);
    }

    #[test]
    fn pixels_whose_error_stays_do_not_pop() {
        let (dark, bright) = (vec![[10; 3]; 256], vec![[60; 3]; 256]);
        let depth = vec![1.0; 256];
        let [dark, bright] = [image(&dark, &depth), image(&bright, &depth)];
        // the scene became brighter, the picture with it
        assert_eq!(popping([dark, dark], [bright, bright], 24.0), 0.0);
        // the picture alone did
        assert_eq!(popping([dark, dark], [bright, dark], 24.0), 1.0);
        assert_eq!(popping([dark, dark], [bright, dark], 50.5), 0.0);
    }

    #[test]
    fn pictures_smaller_than_a_window_are_compared() {
        let (a, b) = ([[5; 3]; 3], [[5; 3]; 3]);
        let depth = [1.0; 3];
        let small = |rgb| Image { width: 3, rgb, depth: &depth };
        assert_eq!(compare(small(&a), small(&b)).ssim, 1.0);
        let nothing = Image { width: 0, rgb: &[], depth: &[] };
        assert_eq!(compare(nothing, nothing).ssim, 1.0);
    }

    #[test]
    fn of_twenty_depths_the_nineteenth_is_not_exceeded_by_95_percent() {
        let rgb = [[0; 3]; 20];
        let far: Vec<f32> = (1..=20).map(|i| 100.0 + i as f32).collect();
        let found = compare(image(&rgb, &[100.0; 20]), image(&rgb, &far));
        assert_eq!((found.depth_p95, found.depth_mean), (19.0, 10.5));
    }

    #[test]
    fn every_row_is_compared() {
        let grey = vec![[90; 3]; 256];
        let depth = vec![1.0; 256];
        for row in 0..16 {
            let mut other = grey.clone();
            other[16 * row..16 * (row + 1)].fill([200; 3]);
            assert!(compare(image(&other, &depth), image(&grey, &depth)).ssim < 0.99, "{row}");
        }
    }

    #[test]
    fn an_error_that_stays_is_none_of_the_flight() {
        let (dark, bright) = (vec![[10; 3]; 256], vec![[60; 3]; 256]);
        let depth = vec![1.0; 256];
        let [dark, bright] = [image(&dark, &depth), image(&bright, &depth)];
        assert_eq!(popping([bright, dark], [bright, dark], 24.0), 0.0);
    }
}
