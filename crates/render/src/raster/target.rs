//! The pixels that all threads draw into.
//!
//! The nearest point of a pixel is one word: its depth above its colour, so that one atomic minimum decides both (Schütz,
//! Kerbl, Wimmer, "Rendering Point Clouds with Compute Shaders", 2021). Of points at the same depth the one with the least
//! colour wins: no picture depends on which thread came first. Sums for means are integers, for the same reason.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use crate::Size;

/// No point: farther than any.
const EMPTY: u64 = u64::MAX;

/// The sum of weights of a pixel does not grow beyond this: 255 times it, and some more by points that other threads add
/// at the same time, fit into 32 bits. What comes later does not count.
const MOST_WEIGHT: u64 = (1 << 24) - (1 << 17);

/// A pixel's sums: weighted red and green, weighted blue and the weights.
#[derive(Debug, Default)]
struct Sums([AtomicU64; 2]);

/// Depth and colour of each pixel.
#[derive(Debug)]
pub(crate) struct Target {
    width: u32,
    height: u32,
    nearest: Vec<AtomicU64>,
    /// While means are made, and where points are counted.
    sums: Vec<Sums>,
}

impl Target {
    /// An empty one; `has_sums` if points are counted from the start.
    pub(crate) fn new(size: Size, has_sums: bool) -> Self {
        let nearest = std::iter::repeat_with(|| AtomicU64::new(EMPTY)).take(size.pixels()).collect();
        let mut target = Self { width: size.width(), height: size.height(), nearest, sums: Vec::new() };
        if has_sums {
            target.prepare_sums();
        }
        target
    }

    /// Makes room for sums.
    pub(crate) fn prepare_sums(&mut self) {
        self.sums.resize_with(self.nearest.len(), Sums::default);
    }

    pub(crate) fn width(&self) -> u32 {
        self.width
    }

    pub(crate) fn height(&self) -> u32 {
        self.height
    }

    /// Draws a point into a pixel: it stays if it is the nearest so far. `depth`: positive and finite.
    #[inline]
    pub(crate) fn put(&self, pixel: usize, depth: f32, rgb: u32) {
        let word = u64::from(depth.to_bits()) << 32 | u64::from(rgb);
        let Some(nearest) = self.nearest.get(pixel) else { return };
        // most points are hidden: a load is much cheaper than the minimum
        if word < nearest.load(Relaxed) {
            nearest.fetch_min(word, Relaxed);
        }
    }

    /// Adds a point to the sums of a pixel if it is at most `reach` times as far as its nearest point.
    #[inline]
    pub(crate) fn gather(&self, pixel: usize, depth: f32, reach: f32, rgb: u32, weight: u32) {
        let (Some(nearest), Some(Sums([red_green, blue_weight]))) = (self.nearest.get(pixel), self.sums.get(pixel))
        else {
            return;
        };
        let nearest = f32::from_bits((nearest.load(Relaxed) >> 32) as u32);
        if depth <= nearest * reach && blue_weight.load(Relaxed) & 0xffff_ffff < MOST_WEIGHT {
            let weight = u64::from(weight);
            let [red, green, blue] = channels(rgb).map(|c| u64::from(c) * weight);
            red_green.fetch_add(red << 32 | green, Relaxed);
            blue_weight.fetch_add(blue << 32 | weight, Relaxed);
        }
    }

    /// Counts a point of a pixel, whatever its depth.
    #[inline]
    pub(crate) fn count(&self, pixel: usize) {
        if let Some(Sums([_, weight])) = self.sums.get(pixel)
            && weight.load(Relaxed) & 0xffff_ffff < MOST_WEIGHT
        {
            weight.fetch_add(1, Relaxed);
        }
    }

    /// How many points were counted, or the sum of the weights, of each pixel; nothing if there are no sums.
    pub(crate) fn counts(&self) -> impl Iterator<Item = u32> + '_ {
        self.sums.iter().map(|Sums([_, weight])| weight.load(Relaxed) as u32)
    }

    /// Depths, infinite where nothing was drawn.
    pub(crate) fn depths(&self) -> Vec<f32> {
        self.nearest.iter().map(|word| depth_of(word.load(Relaxed))).collect()
    }

    /// The colour of the nearest point of each pixel, or, if `means`, of the sums.
    pub(crate) fn colours(&self, background: [u8; 3], means: bool) -> Vec<[u8; 3]> {
        let own = self.nearest.iter().map(|word| match word.load(Relaxed) {
            EMPTY => background,
            word => channels(word as u32),
        });
        if !means || self.sums.is_empty() {
            return own.collect();
        }
        own.zip(&self.sums).map(|(own, sums)| sums.mean().unwrap_or(own)).collect()
    }
}

impl Sums {
    /// The mean, rounded to nearest.
    fn mean(&self) -> Option<[u8; 3]> {
        let [red_green, blue_weight] = self.0.each_ref().map(|word| word.load(Relaxed));
        let weight = blue_weight & 0xffff_ffff;
        let mean = |sum: u64| ((sum + weight / 2) / weight) as u8;
        (weight > 0).then(|| [mean(red_green >> 32), mean(red_green & 0xffff_ffff), mean(blue_weight >> 32)])
    }
}

fn depth_of(word: u64) -> f32 {
    if word == EMPTY { f32::INFINITY } else { f32::from_bits((word >> 32) as u32) }
}

/// Red, green and blue of a colour word.
fn channels(rgb: u32) -> [u8; 3] {
    [(rgb >> 16) as u8, (rgb >> 8) as u8, rgb as u8]
}

/// The colour word of red, green and blue.
#[inline]
pub(crate) fn word([red, green, blue]: [u8; 3]) -> u32 {
    u32::from(red) << 16 | u32::from(green) << 8 | u32::from(blue)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BACKGROUND: [u8; 3] = [1, 2, 3];

    fn target() -> Target {
        Target::new(Size::new(2, 1).unwrap(), true)
    }

    #[test]
    fn the_nearest_point_wins_and_then_the_least_colour() {
        let target = target();
        for (depth, rgb) in [(5.0, [9; 3]), (2.0, [200, 0, 0]), (2.0, [100, 255, 0]), (3.0, [0; 3])] {
            target.put(0, depth, word(rgb));
        }
        assert_eq!(target.depths(), [2.0, f32::INFINITY]);
        assert_eq!(target.colours(BACKGROUND, false), [[100, 255, 0], BACKGROUND]);
    }

    #[test]
    fn means_are_those_of_the_points_that_are_hardly_farther() {
        let target = target();
        let points = [(2.0, [200, 0, 10], 1), (2.01, [101, 1, 10], 1), (2.021, [0; 3], 1), (2.0, [0, 8, 10], 2)];
        points.iter().for_each(|(depth, rgb, _)| target.put(0, *depth, word(*rgb)));
        points.iter().for_each(|(depth, rgb, weight)| target.gather(0, *depth, 1.01, word(*rgb), *weight));
        // red (200 + 101) / 4 = 75.25, green (1 + 16) / 4 = 4.25; 2.021 is beyond 2.02
        assert_eq!(target.colours(BACKGROUND, true), [[75, 4, 10], BACKGROUND]);
        assert_eq!(target.counts().collect::<Vec<_>>(), [4, 0]);
    }

    #[test]
    fn sums_of_very_many_points_stay_what_they_are() {
        let target = target();
        target.put(0, 1.0, word([255; 3]));
        for _ in 0..(1 << 9) {
            target.gather(0, 1.0, 1.0, word([255; 3]), 1 << 16);
        }
        assert_eq!(target.colours(BACKGROUND, true)[0], [255; 3]);
    }
}
