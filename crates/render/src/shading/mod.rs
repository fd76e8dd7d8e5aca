//! What is done to a picture once all points are drawn.

mod eye_dome;
mod fill;
mod pixels;
mod reject;

use crate::Style;
use crate::projection::Projection;
use pixels::Pixels;

/// Rounds of filling: a gap up to six pixels wide closes.
const ROUNDS: usize = 3;

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
