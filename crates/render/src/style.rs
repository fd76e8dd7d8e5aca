//! How points look.

use pointmill_format::octree::Order;

/// What the colour of a point says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Colour {
    /// Its own colour; without colours, or if all that were sampled are black, intensity, or else height.
    #[default]
    Auto,
    /// Its own colour, of 8 or 16 bits.
    Rgb,
    /// Intensity, dark to bright.
    Intensity,
    /// Classification, a colour per class of LAS.
    Class,
    /// z, blue to red.
    Height,
    /// Level of detail: of the node in an octree, of the point in batches, depth of the leaf in a binary tree.
    Level,
    /// Direction of the normal: x, y and z as red, green and blue.
    Normal,
    /// How many points fell into the pixel: dark to bright, by powers of two.
    Overdraw,
    /// Bits that were decoded of a position: 10 green, 20 yellow, 30 red; white where the format has no such choice.
    Bits,
}

impl Colour {
    /// Every choice.
    pub const ALL: [Self; 9] = [
        Self::Auto,
        Self::Rgb,
        Self::Intensity,
        Self::Class,
        Self::Height,
        Self::Level,
        Self::Normal,
        Self::Overdraw,
        Self::Bits,
    ];

    /// The one with that name, if there is one.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|colour| colour.name() == name)
    }

    /// The word: "rgb".
    pub const fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Rgb => "rgb",
            Self::Intensity => "intensity",
            Self::Class => "class",
            Self::Height => "height",
            Self::Level => "level",
            Self::Normal => "normal",
            Self::Overdraw => "overdraw",
            Self::Bits => "bits",
        }
    }
}

/// What a point covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// One pixel, whatever [`PointSize`] says.
    Pixel,
    /// A square that faces the picture.
    Square,
    /// A paraboloid that opens away from the eye: where two discs overlap, each pixel shows the nearer centre (Schütz,
    /// "Potree: Rendering Large Point Clouds in Web Browsers", 2016).
    Paraboloid,
}

/// How large a point is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PointSize {
    /// Side or diameter in pixels.
    Pixels(f32),
    /// Side or diameter in world units.
    World(f32),
    /// The distance between points at that place, times this factor: in an octree that of the deepest node drawn there.
    Adaptive(f32),
}

/// How many bits of a quantised position are decoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Bits {
    /// The fewest that keep the error within half a pixel.
    HalfPixel,
    /// By the projected diagonal of the batch, as published (Schütz et al. 2022).
    Published,
    /// As many as that, 10, 20 or 30, or as there are.
    Always(pointmill_format::batches::Precision),
}

/// How points look. The default is the picture that people expect: colours, holes filled.
#[derive(Debug, Clone, PartialEq)]
pub struct Style {
    /// What the colours say.
    pub colour: Colour,
    /// What a point covers.
    pub shape: Shape,
    /// How large that is.
    pub size: PointSize,
    /// High-quality shading: a pixel has the mean colour of all points that are hardly farther than its nearest one
    /// ([`Self::depth_tolerance`]), not the colour of that point alone. Points are drawn twice.
    pub is_averaged: bool,
    /// How much farther such points are at most, relative to the depth of the nearest one.
    pub depth_tolerance: f32,
    /// Pixels that show the background through the gaps of a nearer surface are rejected, and small gaps are filled.
    pub is_filled: bool,
    /// Strength of eye-dome lighting, 0 for none, 1 as usual: dark lines where depth changes (Boucheny 2009).
    pub eye_dome: f32,
    /// What pixels without a point show: red, green, blue.
    pub background: [u8; 3],
    /// Draws the boxes of what was drawn: octree nodes, leaves, batches.
    pub has_boxes: bool,
    /// Octrees: which nodes come first.
    pub order: Order,
    /// Octrees: nodes whose sphere has a smaller radius in the picture, in pixels, are not drawn.
    pub min_node_pixels: f64,
    /// Batches: continuous levels of detail, 1 is fine, more is fewer points; `None`: all points, or as many as the
    /// budget allows.
    pub clod: Option<f32>,
    /// Batches: how many bits of a position are decoded.
    pub bits: Bits,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            colour: Colour::Auto,
            shape: Shape::Paraboloid,
            size: PointSize::Adaptive(1.3),
            is_averaged: false,
            depth_tolerance: 0.01,
            is_filled: true,
            eye_dome: 0.0,
            background: [24, 26, 30],
            has_boxes: false,
            order: Order::Radius,
            min_node_pixels: 30.0,
            clod: None,
            bits: Bits::HalfPixel,
        }
    }
}

impl Style {
    /// One pixel per point, the nearest wins: what every renderer does at least.
    #[must_use]
    pub fn plain() -> Self {
        Self { shape: Shape::Pixel, is_filled: false, ..Self::default() }
    }

    /// One pixel per point, colours averaged.
    #[must_use]
    pub fn averaged() -> Self {
        Self { is_averaged: true, ..Self::plain() }
    }
}
