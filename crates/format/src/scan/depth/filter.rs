//! Filters of a depth image. Where nothing was measured nothing is made, and nothing there has a weight.

use super::grid::Grid;
use crate::DepthFilter;

/// Applies the filters one after the other.
pub(super) fn apply(filters: &[DepthFilter], grid: &mut Grid) {
    for filter in filters {
        let filtered = match *filter {
            DepthFilter::Median { window } => each(grid, window, Median::default()),
            DepthFilter::Bilateral { window, range_sigma } => each(grid, window, Bilateral::new(window, range_sigma)),
        };
        grid.depths = filtered;
    }
}

/// Memory that the filters take, of an image of that many pixels.
pub(super) fn bytes(filters: &[DepthFilter], pixels: u64) -> u64 {
    let window = filters.iter().map(|filter| u64::from(filter.window())).max().unwrap_or(0);
    let copy = if filters.is_empty() { 0 } else { pixels };
    (copy + window * window) * size_of::<f64>() as u64
}

/// What becomes of a depth by those around it.
trait Kernel {
    /// Begins a window around that depth.
    fn begin(&mut self, depth: f64);
    /// A depth of the window, that of the centre among them, in a distance of columns and rows.
    fn add(&mut self, depth: f64, distance: [usize; 2]);
    fn result(&mut self) -> f64;
}

fn each(grid: &Grid, window: u32, mut kernel: impl Kernel) -> Vec<f64> {
    let reach = window as usize / 2;
    let mut out = Vec::with_capacity(grid.depths.len());
    for v in 0..grid.height {
        for u in 0..grid.width {
            let Some(depth) = grid.depth(u, v) else {
                out.push(0.0);
                continue;
            };
            kernel.begin(depth);
            for row in v.saturating_sub(reach)..=(v + reach).min(grid.height - 1) {
                for column in u.saturating_sub(reach)..=(u + reach).min(grid.width - 1) {
                    if let Some(other) = grid.depth(column, row) {
                        kernel.add(other, [column.abs_diff(u), row.abs_diff(v)]);
                    }
                }
            }
            out.push(kernel.result());
        }
    }
    out
}

#[derive(Default)]
struct Median {
    depths: Vec<f64>,
}

impl Kernel for Median {
    fn begin(&mut self, _: f64) {
        self.depths.clear();
    }

    fn add(&mut self, depth: f64, _: [usize; 2]) {
        self.depths.push(depth);
    }

    fn result(&mut self) -> f64 {
        // of an even number the lesser one in the middle; there is always the depth of the centre
        let middle = self.depths.len().saturating_sub(1) / 2;
        *self.depths.select_nth_unstable_by(middle, f64::total_cmp).1
    }
}

struct Bilateral {
    /// By columns and rows: −d²/2σ².
    spatial: Vec<f64>,
    /// 1/2τ².
    range: f64,
    centre: f64,
    sum: f64,
    weights: f64,
}

impl Bilateral {
    fn new(window: u32, range_sigma: f64) -> Self {
        let sigma = f64::from(window.saturating_sub(1)) / 4.0;
        let spatial = (0..=window / 2).map(|d| -f64::from(d * d) / (2.0 * sigma * sigma)).collect();
        Self { spatial, range: 0.5 / (range_sigma * range_sigma), centre: 0.0, sum: 0.0, weights: 0.0 }
    }
}

impl Kernel for Bilateral {
    fn begin(&mut self, depth: f64) {
        (self.centre, self.sum, self.weights) = (depth, 0.0, 0.0);
    }

    fn add(&mut self, depth: f64, [columns, rows]: [usize; 2]) {
        let difference = depth - self.centre;
        let weight = (self.spatial[columns] + self.spatial[rows] - difference * difference * self.range).exp();
        self.sum += weight * difference;
        self.weights += weight;
    }

    fn result(&mut self) -> f64 {
        // the weight of the centre is 1
        self.centre + self.sum / self.weights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A step from 1 m to 2 m in the middle, a hole, a far outlier on the near side and a near one on the far side.
    fn step() -> Grid {
        let mut depths: Vec<f64> = (0..12 * 9).map(|i| if i % 12 < 6 { 1.0 } else { 2.0 }).collect();
        depths[4 * 12 + 2] = 9.0;
        depths[3 * 12 + 9] = 0.3;
        depths[12] = 0.0;
        Grid { width: 12, height: 9, depths }
    }

    #[test]
    fn the_median_removes_outliers_and_keeps_the_edge_and_the_hole() {
        let mut grid = step();
        apply(&[DepthFilter::Median { window: 3 }], &mut grid);
        for (i, depth) in grid.depths.iter().enumerate() {
            let expected = if i == 12 {
                0.0
            } else if i % 12 < 6 {
                1.0
            } else {
                2.0
            };
            assert_eq!(*depth, expected, "{i}");
        }
    }

    #[test]
    fn the_bilateral_filter_smooths_noise_and_not_the_edge() {
        let mut grid = step();
        let noise = |i: usize| if i.is_multiple_of(2) { 0.01 } else { -0.01 };
        grid.depths.iter_mut().enumerate().filter(|(_, z)| **z > 0.0).for_each(|(i, z)| *z += noise(i));
        apply(&[DepthFilter::Median { window: 3 }, DepthFilter::Bilateral { window: 5, range_sigma: 0.03 }], &mut grid);
        assert_eq!(grid.depths[12], 0.0);
        for (i, depth) in grid.depths.iter().enumerate().filter(|(i, _)| *i != 12) {
            let expected = if i % 12 < 6 { 1.0 } else { 2.0 };
            assert!((depth - expected).abs() < 0.0101, "{i}: {depth}");
        }
        let spread = |grid: &Grid| {
            let inner = (2..7).flat_map(|v| (0..4).map(move |u| v * 12 + u)).map(|i| grid.depths[i]);
            inner.clone().fold(f64::MIN, f64::max) - inner.fold(f64::MAX, f64::min)
        };
        let mut alone = step();
        alone.depths.iter_mut().enumerate().filter(|(_, z)| **z > 0.0).for_each(|(i, z)| *z += noise(i));
        alone.depths[4 * 12 + 2] = 1.01;
        let before = spread(&alone);
        apply(&[DepthFilter::Bilateral { window: 5, range_sigma: 0.03 }], &mut alone);
        assert!(spread(&alone) < before / 3.0, "{} of {before}", spread(&alone));
    }

    #[test]
    fn the_bilateral_mean_is_that_of_the_formula() {
        let mut grid = Grid { width: 3, height: 1, depths: vec![1.0, 1.02, 0.0] };
        apply(&[DepthFilter::Bilateral { window: 3, range_sigma: 0.02 }], &mut grid);
        // σ = 1/2: exp(−1/(2/4)) · exp(−1/2)
        let weight = (-2.0f64).exp() * (-0.5f64).exp();
        let expected = [(1.0 + weight * 1.02) / (1.0 + weight), (1.02 + weight) / (1.0 + weight), 0.0];
        assert!(grid.depths.iter().zip(expected).all(|(found, expected)| (found - expected).abs() < 1e-12));
    }
}
