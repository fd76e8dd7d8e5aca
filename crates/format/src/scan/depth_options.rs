//! What depth maps do not say of themselves, and what becomes of their depths.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use crate::Affine;

/// What the files of a depth map do not say of themselves, and what becomes of its depths.
///
/// ```
/// use pointmill_format::{DepthFilter, DepthOptions, Intrinsics, OpenOptions};
///
/// let mut depth = DepthOptions::default();
/// depth.intrinsics = Some(Intrinsics { focal: [525.0, 525.0], centre: [319.5, 239.5], size: None });
/// depth.units_per_metre = Some(5000.0);
/// depth.filters = vec![DepthFilter::Median { window: 3 }];
/// let options = OpenOptions::default().depth(depth);
/// assert_eq!(options.depth.units_per_metre, Some(5000.0));
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct DepthOptions {
    /// The camera, in place of what stands in files; `None`: as they say.
    pub intrinsics: Option<Intrinsics>,
    /// Units of a stored depth in a metre (TUM RGB-D 5000, RealSense 1000), in place of what stands in files.
    pub units_per_metre: Option<f64>,
    /// From the axes of the camera (x right, y down, z forward) to the world, in place of what stands beside a single depth
    /// map. Where a trajectory has the poses, this is refused.
    pub pose: Option<Affine>,
    /// The colour picture of a single depth map, registered to it, in place of what stands beside it. Refused for a folder with
    /// a trajectory.
    pub colours: Option<PathBuf>,
    /// Depths outside of this range, in metres, are no measurements; tested before the filters.
    pub range: Option<RangeInclusive<f64>>,
    /// Filters of the depths, in this order.
    pub filters: Vec<DepthFilter>,
    /// Make normals from neighbouring pixels.
    pub normals: bool,
}

/// A pinhole camera: the pixel (u, v), from (0, 0) in the centre of the first one, of depth z is at
/// x = (u − cx) · z / fx, y = (v − cy) · z / fy.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// fx and fy, in pixels.
    pub focal: [f64; 2],
    /// cx and cy, in pixels.
    pub centre: [f64; 2],
    /// Width and height of the pictures that they are of, if that is known.
    pub size: Option<[u32; 2]>,
}

/// A filter of depths. It changes measured depths alone: where there is none, none is made.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum DepthFilter {
    /// The median of the depths in a square window; of an even number of them the lesser of the two in the middle, so
    /// that the result was measured.
    Median {
        /// Pixels along a side, odd.
        window: u32,
    },
    /// The mean of the depths in a square window, weighted by exp(−d²/2σ² − Δz²/2τ²), where d is the distance in pixels,
    /// σ a quarter of `window` − 1, Δz the difference of depth and τ `range_sigma`.
    Bilateral {
        /// Pixels along a side, odd.
        window: u32,
        /// Metres.
        range_sigma: f64,
    },
}

impl DepthFilter {
    /// Windows along a side that filters have: odd ones of these.
    pub const WINDOWS: RangeInclusive<u32> = 3..=31;

    /// Pixels along a side.
    pub const fn window(self) -> u32 {
        match self {
            Self::Median { window } | Self::Bilateral { window, .. } => window,
        }
    }

    /// True if the window is odd and among [`Self::WINDOWS`], and the sigma a length above 0.
    pub fn is_sound(self) -> bool {
        let window = self.window();
        let has_sigma = match self {
            Self::Median { .. } => true,
            Self::Bilateral { range_sigma, .. } => range_sigma.is_finite() && range_sigma > 0.0,
        };
        Self::WINDOWS.contains(&window) && window % 2 == 1 && has_sigma
    }
}

impl Intrinsics {
    /// True if the focal lengths are above 0 and all numbers finite.
    pub fn is_sound(&self) -> bool {
        self.focal.iter().all(|f| f.is_finite() && *f > 0.0) && self.centre.iter().all(|c| c.is_finite())
    }
}

/// Units in a metre that a depth map can have: coarser ones than decimetres, or finer ones than micrometres, are none of 16
/// bits.
pub(crate) const UNITS_PER_METRE: RangeInclusive<f64> = 10.0..=1e6;

impl DepthOptions {
    /// True if these units of depth in a metre can be meant: 10 to 1,000,000.
    pub fn is_scale(units_per_metre: f64) -> bool {
        UNITS_PER_METRE.contains(&units_per_metre)
    }
}
