//! How many of the 30 bits: in a file, and in a picture (`docs/formats/batches.md`, §7 and §9).

/// Bits of a position on each axis: how many planes there are, or are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Precision {
    /// hi10
    Ten,
    /// hi10 and mid10
    Twenty,
    /// hi10, mid10 and lo10
    Thirty,
}

impl Precision {
    /// All, ascending.
    pub const ALL: [Self; 3] = [Self::Ten, Self::Twenty, Self::Thirty];

    /// 10, 20 or 30.
    pub const fn bits(self) -> u32 {
        10 * self.planes()
    }

    /// 1, 2 or 3.
    pub const fn planes(self) -> u32 {
        self as u32 + 1
    }

    /// The precision with that number of bits, if there is one.
    pub const fn from_bits(bits: u32) -> Option<Self> {
        match bits {
            10 => Some(Self::Ten),
            20 => Some(Self::Twenty),
            30 => Some(Self::Thirty),
            _ => None,
        }
    }

    /// The published choice, from the projected diagonal of a batch's box ([`projected_diagonal`]), in pixels.
    ///
    /// Source: `m-schuetz/compute_rasterizer`: below 500 pixels 10 bits, below 10,000 pixels 20.
    #[must_use]
    pub fn for_diagonal(pixels: f64) -> Self {
        if pixels < 500.0 {
            Self::Ten
        } else if pixels < 10_000.0 {
            Self::Twenty
        } else {
            Self::Thirty
        }
    }

    /// The least precision whose error is at most half a pixel.
    ///
    /// `longest_side` of the box and `distance` to it ([`distance_to_box`], 0 inside) in world units, `near` > 0: the
    /// distance of the near plane; `focal`: [`focal_pixels`].
    #[must_use]
    pub fn for_error(longest_side: f64, distance: f64, near: f64, focal: f64) -> Self {
        let error = |p: Self| longest_side / f64::from(2u32 << p.bits()) * focal / distance.max(near);
        Self::ALL.into_iter().find(|p| error(*p) <= 0.5).unwrap_or(Self::Thirty)
    }
}

/// Focal length in pixels of a picture that is `height` pixels high and sees `fov_vertical` radians.
pub fn focal_pixels(height: f64, fov_vertical: f64) -> f64 {
    height / (2.0 * (fov_vertical / 2.0).tan())
}

/// Pixels between the centre of a box with that diagonal and a point one diagonal to its side; `depth` of the centre
/// along the view direction. Infinite if the centre is not in front of the camera.
pub fn projected_diagonal(diagonal: f64, depth: f64, focal: f64) -> f64 {
    if depth > 0.0 { diagonal * focal / depth } else { f64::INFINITY }
}

/// Distance from `point` to the closed box `min`…`max`, 0 inside.
pub fn distance_to_box(point: [f64; 3], min: [f64; 3], max: [f64; 3]) -> f64 {
    let squares = (0..3).map(|a| (min[a] - point[a]).max(point[a] - max[a]).max(0.0)).map(|d| d * d);
    squares.sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::super::BatchRecord;
    use super::*;

    #[test]
    fn half_a_pixel_is_the_border() {
        let focal = focal_pixels(1080.0, 60f64.to_radians());
        assert!((focal - 935.307).abs() < 1e-3);
        assert_eq!(Precision::for_error(40.0, 100.0, 0.1, focal), Precision::Ten);
        assert_eq!(Precision::for_error(40.0, 30.0, 0.1, focal), Precision::Twenty);
        assert_eq!(Precision::for_error(40.0, 0.0, 1e-3, focal), Precision::Thirty);
        assert_eq!(Precision::for_error(1.0, 0.0, 1.0, focal), Precision::Ten, "inside, but a small box");
        // 1,024 pixels of projected side
        assert_eq!(Precision::for_error(1.0, 1.0, 0.1, 1024.0), Precision::Ten);
        assert_eq!(Precision::for_error(1.0, 1.0, 0.1, 1024.1), Precision::Twenty);
    }

    #[test]
    fn the_published_thresholds_hold() {
        let choice = [0.0, 499.9, 500.0, 9_999.0, 10_000.0, f64::INFINITY].map(|p| Precision::for_diagonal(p).bits());
        assert_eq!(choice, [10, 10, 20, 20, 30, 30]);
        assert_eq!(projected_diagonal(51.0, 100.0, 935.0), 476.85);
        assert_eq!(projected_diagonal(51.0, -1.0, 935.0), f64::INFINITY);
    }

    #[test]
    fn planes_are_omitted_when_every_box_is_below_the_step() {
        let record = |side: f32| BatchRecord { min: [0.0; 3], first_point: 0, max: [1.0, side, 1.0], points: 1 };
        let step = [0.125; 3];
        assert_eq!(Precision::for_steps(&[], step), Precision::Ten);
        assert_eq!(Precision::for_steps(&[record(127.9)], step), Precision::Ten);
        assert_eq!(Precision::for_steps(&[record(1.0), record(128.0), record(1.0)], step), Precision::Twenty);
        assert_eq!(Precision::for_steps(&[record(131_072.0)], step), Precision::Thirty);
        assert_eq!(Precision::for_steps(&[record(127.9)], [0.125, 0.01, 0.125]), Precision::Twenty);
    }

    #[test]
    fn distances_to_a_box_are_zero_inside() {
        let at = |p| distance_to_box(p, [0.0; 3], [1.0, 2.0, 3.0]);
        assert_eq!(
            [at([0.5; 3]), at([1.0, 2.0, 3.0]), at([4.0, 6.0, 1.0]), at([-2.0, 0.0, 0.0])],
            [0.0, 0.0, 5.0, 2.0]
        );
    }

    #[test]
    fn bits_are_ten_for_each_plane() {
        assert_eq!([10, 20, 30].map(Precision::from_bits), Precision::ALL.map(Some));
        assert_eq!([0, 9, 11, 40].map(Precision::from_bits), [None; 4]);
        assert_eq!(projected_diagonal(0.0, 0.0, 935.0), f64::INFINITY, "the centre is beside the camera");
    }
}
