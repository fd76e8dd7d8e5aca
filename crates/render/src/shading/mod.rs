//! What is done to a picture once all points are drawn.

mod eye_dome;
mod fill;
mod reject;

use crate::Style;
use crate::projection::Projection;

/// Rounds of filling: a gap up to six pixels wide closes.
const ROUNDS: usize = 3;

/// Colours and depths of a picture; infinite depths where there is no point.
pub(crate) struct Pixels<'a> {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) rgb: &'a mut [[u8; 3]],
    pub(crate) depth: &'a mut [f32],
}

/// Rejects what is seen through gaps, fills the gaps, and shades by depth, as the style says.
pub(crate) fn shade(rgb: &mut [[u8; 3]], depth: &mut [f32], projection: &Projection, style: &Style, threads: usize) {
    let [width, height] = [projection.size.width(), projection.size.height()].map(|side| side as usize);
    let mut pixels = Pixels { width, height, rgb, depth };
    if style.is_filled {
        let rejected = reject::rejected(&pixels, projection.focal as f32, threads);
        fill::clear(&mut pixels, &rejected);
        for _ in 0..ROUNDS {
            fill::round(&mut pixels, &rejected, style.background, threads);
        }
    }
    if style.eye_dome > 0.0 {
        eye_dome::shade(&mut pixels, style.eye_dome, threads);
    }
}

/// Makes a value for each pixel, row by row on all threads.
pub(crate) fn for_rows<T: Send + Default + Clone>(
    width: usize,
    height: usize,
    threads: usize,
    row: impl Fn(usize, &mut [T]) + Sync,
) -> Vec<T> {
    let mut all = vec![T::default(); width * height];
    // bands of rows, as many for each thread that none waits long for another
    let threads = crate::workers::thread_count(threads);
    let band = height.div_ceil(threads * 4).max(1);
    let bands: Vec<_> = all.chunks_mut(width * band).map(std::sync::Mutex::new).collect();
    let done = crate::workers::for_each(bands.len(), threads, |number, (): &mut ()| {
        let mut pixels = bands[number].lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        for (offset, pixels) in pixels.chunks_mut(width).enumerate() {
            row(number * band + offset, pixels);
        }
        Ok::<(), std::convert::Infallible>(())
    });
    match done {
        Ok(()) => drop(bands),
        Err(never) => match never {},
    }
    all
}
