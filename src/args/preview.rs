//! Options of `pointmill preview`.

use std::num::NonZero;
use std::path::PathBuf;

use clap::{Args as ClapArgs, ValueEnum};
use pointmill_format::batches::Precision;
use pointmill_render::{Bits, Camera, Colour, Shape, Size, Style, View};

use super::common::InputArgs;
use super::values::{parse_size, parse_threads, whole};

/// Points of a dataset that are drawn, unless it is said.
const BUDGET: &str = "2000000";

#[derive(Debug, ClapArgs)]
pub(crate) struct PreviewArgs {
    #[command(flatten)]
    pub(crate) inputs: InputArgs,
    /// The picture to write, a PNG file; with --path, the pictures are numbered: x0001.png and so on
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
    /// Replaces pictures that are there
    #[arg(long, help_heading = "Output")]
    pub(crate) overwrite: bool,
    /// Width and height in pixels
    #[arg(long, value_name = "WxH", default_value = "1920x1080", value_parser = parse_size, help_heading = "Output")]
    pub(crate) size: Size,

    /// The side to look from; all points are in the picture. fit: the one of eight around the scene, from above, that shows
    /// the most
    #[arg(long, value_name = "SIDE", default_value = "fit", value_parser = parse_view,
          conflicts_with_all = ["camera", "path"], help_heading = "Camera")]
    pub(crate) view: View,
    /// Where the camera is and what it looks at, in world coordinates; then the direction that is up [default: 0,0,1] and
    /// the angle from the lower to the upper border in degrees [default: 60]
    #[arg(long, value_name = "EX,EY,EZ,TX,TY,TZ[,UX,UY,UZ[,FOV]]", value_parser = parse_camera,
          conflicts_with = "path", allow_hyphen_values = true, help_heading = "Camera")]
    pub(crate) camera: Option<Camera>,
    /// Writes a flight: cameras of the JSON file, and others between them (docs/preview.md)
    #[arg(long, value_name = "JSON", requires = "frames", help_heading = "Camera")]
    pub(crate) path: Option<PathBuf>,
    /// Number of pictures of the flight
    #[arg(long, value_name = "N", requires = "path", value_parser = whole::<u32>(1..=100_000),
          allow_negative_numbers = true, help_heading = "Camera")]
    pub(crate) frames: Option<u32>,

    /// What the colours say: auto (rgb, or else intensity, or else height), rgb, intensity, class, height, level, normal,
    /// overdraw, bits
    #[arg(long, value_name = "WHAT", default_value = "auto", value_parser = parse_colour, help_heading = "Style")]
    pub(crate) colour: Colour,
    /// How points become a picture
    #[arg(long, value_enum, value_name = "WAY", default_value = "filled", help_heading = "Style")]
    pub(crate) shading: ShadingArg,
    /// What a point covers, instead of what --shading has: one pixel, or a square or a paraboloid as large as the gaps between
    /// points
    #[arg(long, value_enum, value_name = "SHAPE", help_heading = "Style")]
    pub(crate) shape: Option<ShapeArg>,
    /// Quantised batches: continuous levels of detail by this factor, instead of --budget; 1 is fine, more is fewer points
    #[arg(long, value_name = "X", value_parser = parse_clod, conflicts_with = "budget", allow_negative_numbers = true,
          help_heading = "Style")]
    pub(crate) clod: Option<f32>,
    /// Quantised batches: bits of a coordinate that are decoded. auto: as many as keep the error within half a pixel
    /// [default: auto]
    #[arg(long, value_name = "N", value_parser = parse_bits, allow_negative_numbers = true, help_heading = "Style")]
    pub(crate) bits: Option<Bits>,
    /// Draws the boxes of the nodes, leaves or batches that are drawn
    #[arg(long, help_heading = "Style")]
    pub(crate) boxes: bool,

    /// Points of a dataset to draw at most; scans are drawn whole
    #[arg(long, value_name = "N", default_value = BUDGET, value_parser = whole::<u64>(1..=u64::MAX),
          allow_negative_numbers = true, help_heading = "Resources")]
    pub(crate) budget: u64,
    /// Number of worker threads [default: all cores]
    #[arg(long, value_name = "N", value_parser = parse_threads, allow_negative_numbers = true,
          help_heading = "Resources")]
    pub(crate) threads: Option<NonZero<u16>>,

    /// Prints one JSON object on standard output: camera, what was drawn, seconds
    #[arg(long, help_heading = "Reporting")]
    pub(crate) json: bool,
    /// Reports errors only
    #[arg(short, long, help_heading = "Reporting")]
    pub(crate) quiet: bool,
}

/// How points become a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ShadingArg {
    /// One pixel per point; the nearest is seen
    Plain,
    /// One pixel per point; a pixel has the mean colour of the points of its surface
    Hq,
    /// Points as large as the gaps between them; what is seen through a surface is removed, and small holes are closed
    Filled,
    /// As filled, with dark lines where depth changes
    Edl,
}

/// What a point covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ShapeArg {
    Pixel,
    Square,
    Paraboloid,
}

impl From<ShapeArg> for Shape {
    fn from(shape: ShapeArg) -> Self {
        match shape {
            ShapeArg::Pixel => Self::Pixel,
            ShapeArg::Square => Self::Square,
            ShapeArg::Paraboloid => Self::Paraboloid,
        }
    }
}

impl PreviewArgs {
    /// All options of the style together.
    pub(crate) fn style(&self) -> Style {
        let way = self.shading.style();
        Style {
            colour: self.colour,
            has_boxes: self.boxes,
            shape: self.shape.map_or(way.shape, Into::into),
            clod: self.clod,
            bits: self.bits.unwrap_or(way.bits),
            ..way
        }
    }
}

impl ShadingArg {
    pub(crate) fn style(self) -> Style {
        match self {
            Self::Plain => Style::plain(),
            Self::Hq => Style::averaged(),
            Self::Filled => Style::default(),
            Self::Edl => Style { eye_dome: 1.0, ..Style::default() },
        }
    }
}

fn parse_view(text: &str) -> Result<View, String> {
    View::named(text).ok_or_else(|| format!("expected one of {}", View::ALL.map(View::name).join(", ")))
}

fn parse_colour(text: &str) -> Result<Colour, String> {
    Colour::named(text).ok_or_else(|| format!("expected one of {}", Colour::ALL.map(Colour::name).join(", ")))
}

fn parse_clod(text: &str) -> Result<f32, String> {
    let factor = text.parse().ok().filter(|factor: &f32| factor.is_finite() && *factor > 0.0);
    factor.ok_or_else(|| "expected a number above 0; 1 is fine, more is fewer points".to_owned())
}

fn parse_bits(text: &str) -> Result<Bits, String> {
    let always = || text.parse().ok().and_then(Precision::from_bits).map(Bits::Always);
    let bits = if text == "auto" { Some(Bits::HalfPixel) } else { always() };
    bits.ok_or_else(|| "expected auto, 10, 20 or 30".to_owned())
}

/// Six, nine or ten numbers, checked as a camera.
fn parse_camera(text: &str) -> Result<Camera, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let numbers = numbers.filter(|n| matches!(n.len(), 6 | 9 | 10));
    let numbers = numbers.ok_or_else(|| {
        "expected 6, 9 or 10 numbers: eye x,y,z, target x,y,z, up x,y,z, degrees from top to bottom".to_owned()
    })?;
    let vector = |at: usize| std::array::from_fn(|i| numbers.get(at + i).copied().unwrap_or_default());
    let mut camera = Camera::new(vector(0), vector(3));
    if numbers.len() >= 9 {
        camera.up = vector(6);
    }
    if let Some(degrees) = numbers.get(9) {
        camera.vertical_fov = *degrees;
    }
    camera.axes().map(|_| camera).map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_have_defaults() {
        let camera = parse_camera("1,2,3, 4,5,6").unwrap();
        assert_eq!(camera, Camera::new([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]));
        let all = parse_camera("-1,2e3,3,4,5,6,0,1,0,45").unwrap();
        assert_eq!((all.eye[1], all.up, all.vertical_fov), (2000.0, [0.0, 1.0, 0.0], 45.0));
        for text in ["", "1,2,3", "1,2,3,4,5,6,7", "1,2,3,4,5,x", "1,1,1,1,1,1", "nan,0,0,1,1,1", "inf,0,0,1,1,1"] {
            assert!(parse_camera(text).is_err(), "{text}");
        }
        assert!(parse_camera("0,0,0,1,1,1,0,0,1,180").unwrap_err().contains("180 degrees"));
    }

    #[test]
    fn sizes_are_two_numbers_of_pixels() {
        assert_eq!(parse_size("640x480").unwrap(), Size::new(640, 480).unwrap());
        for text in ["640", "640x", "x480", "0x480", "640x1000000", "-640x480", "+640x480", "6.4x4.8", "16384x16384"] {
            assert!(parse_size(text).is_err(), "{text}");
        }
    }
}
