//! What points cover.

use crate::Shape;
use crate::projection::Projection;

use super::Target;

/// No splat is larger, in pixels: one point at the eye does not cover the picture, and no input makes a picture slow.
const MOST_PIXELS: f32 = 64.0;

/// Splats up to this many pixels are one pixel.
const ONE_PIXEL: f32 = 1.0;

/// Weight of a point at its centre, where means are made; at its border it is 1.
const CENTRE_WEIGHT: f32 = 16.0;

/// How large the points of a block are.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Sizes<'a> {
    /// One pixel.
    One,
    /// Pixels.
    Pixels(f32),
    /// World units.
    World(f32),
    /// World units of each point; 0 is one pixel.
    Each(&'a [f32]),
}

/// What becomes of a point in a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Pass {
    /// The nearest one stays.
    Nearest,
    /// The nearest one stays, and all are counted.
    Count,
    /// Those near the nearest one are added up.
    Gather,
}

/// Draws points of a shape.
#[derive(Debug)]
pub(crate) struct Splats<'a> {
    target: &'a Target,
    shape: Shape,
    pass: Pass,
    reach: f32,
    focal: f32,
    half: [f32; 2],
    width: f32,
    height: f32,
}

/// A point in the picture.
struct Point {
    /// Pixels from the left and the top.
    x: f32,
    y: f32,
    depth: f32,
    rgb: u32,
}

impl<'a> Splats<'a> {
    /// `tolerance`: how much farther points may be that are added up, relative to the nearest.
    pub(crate) fn new(target: &'a Target, projection: &Projection, shape: Shape, pass: Pass, tolerance: f32) -> Self {
        let (width, height) = (target.width() as f32, target.height() as f32);
        let focal = projection.focal as f32;
        Self { target, shape, pass, reach: 1.0 + tolerance, focal, half: [width / 2.0, height / 2.0], width, height }
    }

    /// Draws points: right, up and depth of each, relative to the eye, and colour words.
    pub(crate) fn draw(&self, points: &[[f32; 3]], colours: &[u32], sizes: Sizes<'_>) {
        let points = points.iter().zip(colours).map(|(view, rgb)| (*view, *rgb));
        match sizes {
            _ if self.shape == Shape::Pixel => self.draw_ones(points),
            Sizes::One => self.draw_ones(points),
            Sizes::Pixels(pixels) => points.for_each(|(view, rgb)| self.splat(view, rgb, pixels)),
            Sizes::World(size) => points.for_each(|(view, rgb)| self.splat(view, rgb, size * self.focal / view[2])),
            Sizes::Each(sizes) => points.zip(sizes).for_each(|((view, rgb), size)| {
                self.splat(view, rgb, size * self.focal / view[2]);
            }),
        }
    }

    /// One pixel a point.
    pub(crate) fn draw_ones(&self, points: impl Iterator<Item = ([f32; 3], u32)>) {
        for (view, rgb) in points {
            if let Some(point) = self.project(view, rgb)
                && point.x >= 0.0
                && point.y >= 0.0
                && point.x < self.width
                && point.y < self.height
            {
                self.hit(point.y as u32, point.x as u32, point.depth, rgb, 1);
            }
        }
    }

    #[inline]
    fn project(&self, [x, y, depth]: [f32; 3], rgb: u32) -> Option<Point> {
        // what is not a number is no point, nor is what is infinitely far
        if !(f32::MIN_POSITIVE..=f32::MAX).contains(&depth) {
            return None;
        }
        let scale = self.focal / depth;
        Some(Point { x: self.half[0] + x * scale, y: self.half[1] - y * scale, depth, rgb })
    }

    #[inline]
    fn hit(&self, row: u32, column: u32, depth: f32, rgb: u32, weight: u32) {
        let pixel = row as usize * self.target.width() as usize + column as usize;
        match self.pass {
            Pass::Nearest => self.target.put(pixel, depth, rgb),
            Pass::Gather => self.target.gather(pixel, depth, self.reach, rgb, weight),
            Pass::Count => {
                self.target.put(pixel, depth, rgb);
                self.target.count(pixel);
            }
        }
    }

    /// A point that is `pixels` wide.
    fn splat(&self, view: [f32; 3], rgb: u32, pixels: f32) {
        if pixels.is_nan() || pixels <= ONE_PIXEL {
            return self.draw_ones(std::iter::once((view, rgb)));
        }
        let Some(point) = self.project(view, rgb) else { return };
        let radius = pixels.min(MOST_PIXELS) / 2.0;
        let Some([left, right]) = covered(point.x, radius, self.width) else { return };
        let Some([top, bottom]) = covered(point.y, radius, self.height) else { return };
        // the radius in world units: how far a paraboloid goes back at its border
        let back = radius * point.depth / self.focal;
        let per_square = 1.0 / (radius * radius);
        let (is_round, is_weighed) = (self.shape == Shape::Paraboloid, self.pass == Pass::Gather);
        let is_one = right - left == 1;
        for row in top..bottom {
            let dy = row as f32 + 0.5 - point.y;
            for column in left..right {
                let dx = column as f32 + 0.5 - point.x;
                let from_centre = (dx * dx + dy * dy) * per_square;
                if is_round && from_centre > 1.0 && !is_one {
                    continue;
                }
                let behind = if is_round { back * from_centre } else { 0.0 };
                let weight = if is_weighed { 1.0 + (CENTRE_WEIGHT - 1.0) * (1.0 - from_centre).max(0.0) } else { 1.0 };
                self.hit(row, column, (point.depth + behind).min(f32::MAX), point.rgb, weight as u32);
            }
        }
    }
}

/// The pixels, from the first to before the last, whose centres are within `radius` of `centre`; the one that the centre is in
/// at least. `None` if that is outside of the picture.
#[inline]
fn covered(centre: f32, radius: f32, side: f32) -> Option<[u32; 2]> {
    let (mut first, mut end) = ((centre - radius + 0.5).floor(), (centre + radius + 0.5).floor());
    if first >= end {
        (first, end) = (centre.floor(), centre.floor() + 1.0);
    }
    (first < side && end > 0.0).then(|| [first.max(0.0) as u32, end.min(side) as u32])
}

#[cfg(test)]
mod tests {
    use super::super::target::word;
    use super::*;
    use crate::{Camera, Size};

    /// 8 × 8 pixels, focal length 4: a place (x, y) at depth 4 is x pixels right of the middle and y above it.
    fn drawn(shape: Shape, points: &[[f32; 3]], sizes: Sizes<'_>) -> Vec<f32> {
        let size = Size::new(8, 8).unwrap();
        let camera = Camera { vertical_fov: 90.0, ..Camera::new([0.0; 3], [0.0, 1.0, 0.0]) };
        let projection = Projection::new(&camera, size).unwrap();
        let target = Target::new(size, false);
        let colours = vec![word([1, 2, 3]); points.len()];
        Splats::new(&target, &projection, shape, Pass::Nearest, 0.01).draw(points, &colours, sizes);
        target.depths()
    }

    fn rows(depths: &[f32]) -> Vec<String> {
        let mark = |depth: &f32| if depth.is_finite() { '#' } else { '.' };
        depths.chunks(8).map(|row| row.iter().map(mark).collect()).collect()
    }

    fn count(depths: &[f32]) -> usize {
        depths.iter().filter(|depth| depth.is_finite()).count()
    }

    #[test]
    fn a_point_is_in_the_pixel_that_it_falls_into() {
        let depths = drawn(Shape::Pixel, &[[0.5, 0.5, 4.0], [-4.0, 4.0, 4.0], [3.99, -3.99, 4.0]], Sizes::One);
        let marked: Vec<usize> = (0..64).filter(|i| depths[*i].is_finite()).collect();
        assert_eq!(marked, [0, 3 * 8 + 4, 63]);
        assert_eq!(depths[0], 4.0);
    }

    #[test]
    fn what_is_behind_or_beside_or_no_number_is_not_drawn() {
        let (nan, inf) = (f32::NAN, f32::INFINITY);
        let outside = [
            [0.0, 0.0, -4.0],
            [0.0, 0.0, 0.0],
            [4.0, 0.0, 4.0],
            [0.0, -4.0, 4.0],
            [0.0, 0.0, inf],
            [nan, 0.0, 4.0],
            [0.0, inf, 4.0],
            [0.0, 0.0, nan],
        ];
        for shape in [Shape::Pixel, Shape::Square, Shape::Paraboloid] {
            assert_eq!(count(&drawn(shape, &outside, Sizes::One)), 0, "{shape:?}");
        }
        for point in outside {
            let depths = drawn(Shape::Square, &[point], Sizes::Pixels(nan));
            assert_eq!(count(&depths), 0, "{point:?}");
        }
    }

    #[test]
    fn a_square_covers_the_pixels_whose_centres_it_has() {
        let at = [0.0, 0.0, 4.0];
        assert_eq!(rows(&drawn(Shape::Square, &[at], Sizes::Pixels(2.0)))[3..5], ["...##...", "...##..."]);
        // the same in world units: 2 pixels at a depth of 4 with a focal length of 4
        assert_eq!(drawn(Shape::Square, &[at], Sizes::Pixels(2.0)), drawn(Shape::Square, &[at], Sizes::World(2.0)));
        assert_eq!(drawn(Shape::Square, &[at], Sizes::Pixels(2.0)), drawn(Shape::Square, &[at], Sizes::Each(&[2.0])));
        // a square that has no centre of a pixel still has one pixel
        assert_eq!(count(&drawn(Shape::Square, &[[0.5, 0.5, 4.0]], Sizes::Pixels(1.01))), 1);
        // at the corner of the picture
        let corner = drawn(Shape::Square, &[[-4.0, 4.0, 4.0]], Sizes::Pixels(4.0));
        assert_eq!(rows(&corner)[..3], ["##......", "##......", "........"]);
    }

    #[test]
    fn a_paraboloid_is_round_and_goes_back_at_its_border() {
        // centre in the middle of pixel (4, 3), 5 pixels wide: radius 2.5, of which 1, 2, √2 and √5 are inside
        let depths = drawn(Shape::Paraboloid, &[[0.5, 0.5, 4.0]], Sizes::Pixels(5.0));
        assert_eq!(rows(&depths)[1..6], ["...###..", "..#####.", "..#####.", "..#####.", "...###.."]);
        assert_eq!(depths[3 * 8 + 4], 4.0);
        // 2 of 2.5 pixels away: back by (2/2.5)² of the radius of 2.5 world units
        let expected = 4.0 + 0.64 * 2.5;
        assert!((depths[3 * 8 + 2] - expected).abs() < 1e-5, "{}", depths[3 * 8 + 2]);
    }

    #[test]
    fn where_paraboloids_overlap_the_nearer_centre_is_seen() {
        let depths = drawn(Shape::Paraboloid, &[[-1.5, 0.5, 4.0], [1.5, 0.5, 4.0]], Sizes::Pixels(6.0));
        let row = &depths[3 * 8..4 * 8];
        assert!(row[2] < row[3] && row[4] > row[5], "{row:?}");
    }
}
