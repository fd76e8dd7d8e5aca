//! How far the colours of a level are from those of the whole cloud at the same places.

use palette::color_difference::Ciede2000 as _;
use palette::{IntoColor as _, Lab, Srgb};
use pointmill_format::Aabb;
use pointmill_format::batches::morton21;
use rayon::prelude::*;
use serde::Serialize;

use crate::cloud::Cloud;

/// Cells per level that are compared, at most; of more, every k-th is, evenly along the Morton curve.
const MOST_CELLS: usize = 500_000;

/// Bits of a Morton code per axis.
const BITS: u32 = 21;

/// What a level of detail shows of the whole cloud: the points of that level and all above it, in cells as large as the
/// spacing of the level or up to twice as large: a power of two of the scene's cube.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LevelError {
    /// The level, 0 the coarsest.
    pub level: usize,
    /// Side of a cell, world units.
    pub cell: f64,
    /// Points of the level and all above it.
    pub points: u64,
    /// Cells with points of the cloud.
    pub cells: u64,
    /// Of these, the share with a point of the level or above: 1 is a picture without holes.
    pub covered: f64,
    /// Mean over the covered cells of CIE ΔE2000 between the mean colour of the drawn points and that of all points; `None` without
    /// colours.
    pub delta_e: Option<f64>,
    /// 99 % of these cells have no larger one.
    pub delta_e_p99: Option<f64>,
    /// Root mean square of the difference per channel, 0 to 255.
    pub rms: Option<f64>,
}

/// Points in Morton order over a cube.
struct Curve {
    codes: Vec<u64>,
    rgb: Vec<[u8; 3]>,
    level: Vec<u8>,
}

/// The whole cloud, ready for comparisons.
pub(crate) struct Reference {
    min: [f64; 3],
    side: f64,
    curve: Curve,
}

impl Reference {
    pub(crate) fn new(cloud: &Cloud, bounds: &Aabb) -> Self {
        let extent = bounds.extent();
        let side = extent.into_iter().fold(f64::MIN_POSITIVE, f64::max);
        Self { min: bounds.min, side, curve: curve(cloud, bounds.min, side) }
    }

    /// The errors of each level, whose points are `spacings` apart. Without levels the whole cloud is one.
    pub(crate) fn levels(&self, cloud: &Cloud, spacings: &[f64]) -> Vec<LevelError> {
        let drawn = curve(cloud, self.min, self.side);
        (0..spacings.len()).into_par_iter().map(|level| self.level(&drawn, level, spacings[level])).collect()
    }

    /// How far apart the points are, world units: the side of cells of which each that holds a point holds two on average, over
    /// the root of two. Of a cloud of one place 0.
    pub(crate) fn spacing(&self) -> f64 {
        let codes = &self.curve.codes;
        let occupied = |halvings: u32| {
            let shift = 3 * (BITS - halvings);
            1 + codes.par_windows(2).filter(|pair| pair[0] >> shift != pair[1] >> shift).count()
        };
        let is_fine = |halvings: &u32| codes.len() <= 2 * occupied(*halvings);
        let finest = (0..=BITS).find(is_fine);
        finest.map_or(0.0, |halvings| self.side / 2_f64.powi(halvings as i32) / 2_f64.sqrt())
    }

    fn level(&self, drawn: &Curve, level: usize, spacing: f64) -> LevelError {
        // cells are no smaller than the spacing, or a sample that keeps it would have holes; the cube of a dataset may be a
        // little larger than that of the points
        let halvings = ((self.side / spacing).log2() + 0.05).floor().clamp(0.0, f64::from(BITS)) as u32;
        let shift = 3 * (BITS - halvings);
        let is_in = |i: usize| usize::from(drawn.level[i]) <= level;
        let mut sums = Sums { points: (0..drawn.codes.len()).filter(|i| is_in(*i)).count() as u64, ..Sums::default() };
        let mut at = 0;
        let mut pairs = Vec::new();
        for (cell, range) in (Cells { codes: &self.curve.codes, shift, next: 0 }) {
            while at < drawn.codes.len() && drawn.codes[at] >> shift < cell {
                at += 1;
            }
            let begin = at;
            while at < drawn.codes.len() && drawn.codes[at] >> shift == cell {
                at += 1;
            }
            let has_points = (begin..at).any(is_in);
            sums.cells += 1;
            sums.covered += u64::from(has_points);
            if has_points && !self.curve.rgb.is_empty() && !drawn.rgb.is_empty() {
                pairs.push((range, begin..at));
            }
        }
        let step = pairs.len().div_ceil(MOST_CELLS).max(1);
        let differences: Vec<(f64, f64)> = pairs
            .par_iter()
            .step_by(step)
            .map(|(whole, part)| {
                let whole = mean(whole.clone().map(|i| self.curve.rgb[i]));
                let part = mean(part.clone().filter(|i| is_in(*i)).map(|i| drawn.rgb[i]));
                difference(whole, part)
            })
            .collect();
        let cell = self.side / 2_f64.powi(halvings as i32);
        sums.finish(level, cell, &differences)
    }
}

#[derive(Default)]
struct Sums {
    cells: u64,
    covered: u64,
    points: u64,
}

impl Sums {
    /// `differences`: ΔE and mean square of each cell.
    fn finish(self, level: usize, cell: f64, differences: &[(f64, f64)]) -> LevelError {
        let count = differences.len() as f64;
        let mut sorted: Vec<f64> = differences.iter().map(|d| d.0).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let has_colours = !sorted.is_empty();
        LevelError {
            level,
            cell,
            points: self.points,
            cells: self.cells,
            covered: self.covered as f64 / self.cells.max(1) as f64,
            delta_e: has_colours.then(|| sorted.iter().sum::<f64>() / count),
            delta_e_p99: has_colours.then(|| sorted[(sorted.len() * 99).div_ceil(100) - 1]),
            rms: has_colours.then(|| (differences.iter().map(|d| d.1).sum::<f64>() / count).sqrt()),
        }
    }
}

/// Runs of points in one cell.
struct Cells<'a> {
    codes: &'a [u64],
    shift: u32,
    next: usize,
}

impl Iterator for Cells<'_> {
    type Item = (u64, std::ops::Range<usize>);

    fn next(&mut self) -> Option<Self::Item> {
        let begin = self.next;
        let cell = self.codes.get(begin)? >> self.shift;
        while self.codes.get(self.next).is_some_and(|code| code >> self.shift == cell) {
            self.next += 1;
        }
        Some((cell, begin..self.next))
    }
}

/// Points outside of the cube, where rounding put them, count as those at its border.
fn curve(cloud: &Cloud, min: [f64; 3], side: f64) -> Curve {
    let steps = f64::from((1_u32 << BITS) - 1);
    let code = |i: usize| {
        let mut cell = [0; 3];
        for ((cell, axis), min) in cell.iter_mut().zip(&cloud.xyz).zip(min) {
            // `as` saturates; a cube of no extent has one cell
            *cell = (((axis[i] - min) / side) * (steps + 1.0)).clamp(0.0, steps) as u32;
        }
        morton21(cell)
    };
    let mut order: Vec<(u64, u32)> = (0..cloud.len()).into_par_iter().map(|i| (code(i), i as u32)).collect();
    order.par_sort_unstable();
    let level = if cloud.level.is_empty() {
        vec![0; cloud.len()]
    } else {
        order.par_iter().map(|(_, i)| cloud.level[*i as usize]).collect()
    };
    let rgb =
        if cloud.rgb.is_empty() { Vec::new() } else { order.par_iter().map(|(_, i)| cloud.rgb[*i as usize]).collect() };
    Curve { codes: order.into_par_iter().map(|(code, _)| code).collect(), rgb, level }
}

fn mean(colours: impl Iterator<Item = [u8; 3]>) -> [f32; 3] {
    let (mut count, mut sums) = (0_u64, [0_u64; 3]);
    for rgb in colours {
        count += 1;
        sums.iter_mut().zip(rgb).for_each(|(sum, channel)| *sum += u64::from(channel));
    }
    sums.map(|sum| (sum as f64 / count.max(1) as f64) as f32)
}

/// ΔE2000 of two colours of 0 to 255, and the mean square of their channels' differences.
pub(crate) fn difference(a: [f32; 3], b: [f32; 3]) -> (f64, f64) {
    let lab = |rgb: [f32; 3]| -> Lab {
        let [r, g, b] = rgb.map(|channel| channel / 255.0);
        Srgb::new(r, g, b).into_color()
    };
    let squares: f32 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    let delta = if a == b { 0.0 } else { lab(a).difference(lab(b)) };
    (f64::from(delta), f64::from(squares) / 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of points a unit apart, in a cube of 2^3 = 8 units.
    fn row(rgb: impl Fn(usize) -> [u8; 3], level: impl Fn(usize) -> u8) -> Cloud {
        let x = (0..8).map(|i| i as f64 * (8.0 / 7.0)).collect();
        Cloud {
            xyz: [x, vec![0.0; 8], vec![0.0; 8]],
            rgb: (0..8).map(rgb).collect(),
            level: (0..8).map(level).collect(),
        }
    }

    #[test]
    fn a_level_is_compared_with_the_means_of_all_points_of_its_cells() {
        let cloud = row(|i| [if i % 2 == 0 { 100 } else { 110 }, 50, 50], |_| 0);
        let reference = Reference::new(&cloud, &cloud.bounds());
        // every second point is of the coarse level: 100 where the mean is 105
        let drawn = row(|i| cloud.rgb[i], |i| (i % 2) as u8);
        let levels = reference.levels(&drawn, &[2.0, 1.0]);
        assert_eq!((levels[0].points, levels[0].cells, levels[0].covered, levels[0].cell), (4, 4, 1.0, 2.0));
        // one channel of three is 5 off
        assert!((levels[0].rms.unwrap() - (25.0_f64 / 3.0).sqrt()).abs() < 1e-6, "{levels:?}");
        assert!(levels[0].delta_e.unwrap() > 0.5);
        assert_eq!((levels[1].points, levels[1].rms, levels[1].delta_e), (8, Some(0.0), Some(0.0)));
        // averaged: the same level shows the means
        let averaged = row(|i| [if i % 2 == 0 { 105 } else { 110 }, 50, 50], |i| (i % 2) as u8);
        assert_eq!(reference.levels(&averaged, &[2.0])[0].delta_e, Some(0.0));
    }

    #[test]
    fn the_spacing_is_that_of_the_points() {
        let cloud = row(|_| [0; 3], |_| 0);
        // two of eight points in each of four cells
        assert_eq!(Reference::new(&cloud, &cloud.bounds()).spacing(), 2.0 / 2.0_f64.sqrt());
        let one_place = Cloud { xyz: [vec![5.0; 9], vec![5.0; 9], vec![5.0; 9]], ..Cloud::default() };
        assert_eq!(Reference::new(&one_place, &one_place.bounds()).spacing(), 0.0);
    }

    #[test]
    fn cells_without_a_point_of_the_level_are_holes() {
        let cloud = row(|_| [9; 3], |_| 0);
        let reference = Reference::new(&cloud, &cloud.bounds());
        let mut drawn = row(|_| [9; 3], |i| u8::from(i > 1));
        let covered = |drawn: &Cloud| reference.levels(drawn, &[2.0])[0].covered;
        assert_eq!(covered(&drawn), 0.25);
        assert_eq!(reference.levels(&drawn, &[2.0])[0].delta_e, Some(0.0), "holes have no colour to compare");
        drawn.rgb.clear();
        assert_eq!(reference.levels(&drawn, &[2.0])[0].delta_e, None);
    }

    #[test]
    fn differences_of_colours_are_those_of_the_standard() {
        // white and black are 100 apart in lightness; equal colours not at all
        let (delta, square) = difference([255.0; 3], [0.0; 3]);
        assert!((delta - 100.0).abs() < 0.01 && square == 255.0 * 255.0, "{delta}");
        assert_eq!(difference([17.0, 4.0, 99.0], [17.0, 4.0, 99.0]), (0.0, 0.0));
    }

    #[test]
    fn one_point_and_no_point_have_levels() {
        let one = Cloud { xyz: [vec![1e9], vec![0.0], vec![-5.0]], rgb: vec![[1, 2, 3]], level: vec![0] };
        let reference = Reference::new(&one, &one.bounds());
        let levels = reference.levels(&one, &[1.0]);
        assert_eq!((levels[0].cells, levels[0].covered, levels[0].rms), (1, 1.0, Some(0.0)));
        let nothing = reference.levels(&Cloud::default(), &[1.0]);
        assert_eq!((nothing[0].points, nothing[0].covered), (0, 0.0));
    }

    fn line(x: &[f64], grey: &[u8]) -> Cloud {
        let rgb = grey.iter().map(|v| [*v; 3]).collect();
        Cloud { xyz: [x.to_vec(), vec![-7.0; x.len()], vec![3.0; x.len()]], rgb, level: vec![0; x.len()] }
    }

    #[test]
    fn points_where_the_cloud_has_none_are_passed_over() {
        let cloud = line(&[1000.0, 1007.0, 1008.0], &[9, 9, 9]);
        let reference = Reference::new(&cloud, &cloud.bounds());
        let drawn = line(&[1000.0, 1002.5, 1004.5, 1007.0], &[9, 0, 255, 9]);
        let level = &reference.levels(&drawn, &[2.0])[0];
        assert_eq!((level.points, level.cells, level.covered, level.delta_e), (4, 2, 1.0, Some(0.0)));
    }

    #[test]
    fn a_point_on_a_border_is_in_the_upper_cell() {
        let cloud = line(&[1000.0, 1004.0, 1008.0], &[0, 100, 100]);
        let reference = Reference::new(&cloud, &cloud.bounds());
        let level = &reference.levels(&line(&[1004.0], &[100]), &[4.0])[0];
        assert_eq!((level.cells, level.covered, level.delta_e), (2, 0.5, Some(0.0)));
    }

    #[test]
    fn figures_of_a_level_are_over_its_cells() {
        let cloud = row(|_| [255; 3], |_| 0);
        let reference = Reference::new(&cloud, &cloud.bounds());
        // black in two of four cells, which is 100 of lightness
        let level = &reference.levels(&row(|i| [if i < 4 { 255 } else { 0 }; 3], |_| 0), &[2.0])[0];
        let [mean, p99] = [level.delta_e, level.delta_e_p99].map(Option::unwrap);
        assert!((mean - 50.0).abs() < 0.01 && (p99 - 100.0).abs() < 0.01, "{mean} {p99}");
        assert_eq!(level.rms, Some((255.0 * 255.0 / 2.0_f64).sqrt()));
    }
}
