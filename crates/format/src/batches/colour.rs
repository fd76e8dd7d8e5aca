//! Colour words and means (`docs/formats/batches.md`, §4.3 and §6.2).

/// `r | g<<8 | b<<16 | lod<<24`.
pub const fn colour_word(rgb: [u8; 3], lod: u8) -> u32 {
    u32::from_le_bytes([rgb[0], rgb[1], rgb[2], lod])
}

/// The colour of a word.
pub const fn rgb_of(word: u32) -> [u8; 3] {
    let [r, g, b, _] = word.to_le_bytes();
    [r, g, b]
}

/// The level of detail of a word: its top byte.
pub const fn lod_of(word: u32) -> u8 {
    (word >> 24) as u8
}

/// 8 bits of a 16-bit channel, rounded.
pub const fn eight_bit(channel: u16) -> u8 {
    ((channel as u32 * 255 + 32_767) / 65_535) as u8
}

/// The grey of an intensity in a cloud whose intensities span `least`…`greatest`; 255 if they are all the same.
pub fn grey(intensity: u16, least: u16, greatest: u16) -> u8 {
    let range = u32::from(greatest.saturating_sub(least));
    if range == 0 {
        return 255;
    }
    let above = u32::from(intensity.saturating_sub(least)).min(range);
    ((above * 255 + range / 2) / range) as u8
}

/// Sums up the colours of a cell.
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ColourSum {
    points: u64,
    channels: [u64; 3],
}

impl ColourSum {
    /// Adds a point's colour; the top byte of the word is ignored.
    #[inline]
    pub fn add(&mut self, word: u32) {
        self.points += 1;
        for (sum, channel) in self.channels.iter_mut().zip(rgb_of(word)) {
            *sum += u64::from(channel);
        }
    }

    /// Adds what another sum holds, as if its points had been added here.
    #[inline]
    pub fn merge(&mut self, other: &Self) {
        self.points += other.points;
        for (sum, channel) in self.channels.iter_mut().zip(other.channels) {
            *sum += channel;
        }
    }

    /// True if so many points at most can have that sum.
    pub fn can_be_of(&self, points: u64) -> bool {
        let most = self.points.checked_mul(255);
        self.points <= points && most.is_some_and(|most| self.channels.iter().all(|sum| *sum <= most))
    }

    /// Points added.
    pub const fn points(&self) -> u64 {
        self.points
    }

    /// The mean of each channel, halves rounded up; 0 without points.
    #[must_use]
    #[inline]
    pub fn mean(&self) -> [u8; 3] {
        let points = self.points.max(1);
        self.channels.map(|sum| ((sum + points / 2) / points) as u8)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_have_red_lowest_and_the_level_on_top() {
        assert_eq!(colour_word([1, 2, 3], 4), 0x0403_0201);
        assert_eq!((rgb_of(0x0403_0201), lod_of(0x0403_0201)), ([1, 2, 3], 4));
    }

    #[test]
    fn sixteen_bits_become_the_nearest_eight() {
        assert!((0..=255u16).all(|v| eight_bit(v * 257) == v as u8), "widened values come back");
        assert_eq!([0, 128, 129, 385, 386, 65_535].map(eight_bit), [0, 0, 1, 1, 2, 255]);
        for v in 0..=u16::MAX {
            assert_eq!(eight_bit(v), (f64::from(v) / 257.0).round() as u8, "{v}: no halves, 257 is odd");
        }
    }

    #[test]
    fn greys_span_the_range_of_the_intensities() {
        assert_eq!([100, 150, 200].map(|v| grey(v, 100, 200)), [0, 128, 255]);
        assert_eq!([0, 32_767, 65_535].map(|v| grey(v, 0, 65_535)), [0, 127, 255]);
        assert_eq!(grey(7, 7, 7), 255);
        assert_eq!([grey(0, 5, 9), grey(99, 5, 9)], [0, 255], "outside of what was declared");
    }

    #[test]
    fn means_are_exact_and_round_halves_up() {
        let mut sum = ColourSum::default();
        assert_eq!(sum.mean(), [0; 3]);
        for word in [colour_word([1, 255, 0], 3), colour_word([2, 255, 0], 0)] {
            sum.add(word);
        }
        assert_eq!(sum.mean(), [2, 255, 0]);
        let mut twice = sum;
        twice.merge(&sum);
        assert_eq!((twice.points(), twice.mean()), (4, [2, 255, 0]));
    }

    #[test]
    fn means_of_a_thousand_million_colours_are_those_of_128_bits() {
        // so many thousandths of white in red, green and blue; halves and what is next to them are among the means
        for white in [[0, 1000, 1], [2, 998, 500], [333, 667, 999]] {
            let mut sum = ColourSum::default();
            for i in 0..1000 {
                sum.add(colour_word(white.map(|n| if i < n { 255 } else { 0 }), 3));
            }
            (0..20).for_each(|_| sum.merge(&sum.clone()));
            let points = 1000u128 << 20;
            let mean = |n: u32| (2 * ((u128::from(n) * 255) << 20) + points) / (2 * points);
            assert_eq!(sum.points(), points as u64);
            assert_eq!(sum.mean().map(u128::from), white.map(mean), "{white:?}");
        }
        let mut half = ColourSum::default();
        half.add(colour_word([127, 0, 254], 0));
        half.add(colour_word([128, 1, 255], 0));
        (0..29).for_each(|_| half.merge(&half.clone()));
        assert_eq!((half.points(), half.mean()), (1 << 30, [128, 1, 255]), "halves up");
        half.add(colour_word([127, 0, 254], 0));
        assert_eq!(half.mean(), [127, 0, 254], "one in 2^30 tips the half");
    }

    #[test]
    #[ignore = "long: each is added by itself"]
    fn so_are_those_of_colours_one_by_one() {
        let mut sum = ColourSum::default();
        (0..1_000_000_000u32).for_each(|i| sum.add(i));
        let exact = |at: u32| (0..1_000_000_000u128).map(|i| i >> (8 * at) & 255).sum::<u128>();
        let mean = [0, 1, 2].map(|at| (2 * exact(at) + 1_000_000_000) / 2_000_000_000);
        assert_eq!(sum.mean().map(u128::from), mean);
    }
}
