//! Options of depth maps: their camera, and what becomes of their depths.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::Args as ClapArgs;
use pointmill_format::{DepthFilter, DepthOptions, Intrinsics};

use super::placing::matrix;
use crate::exit::Failure;

/// What depth maps do not say of themselves.
#[derive(Debug, Default, ClapArgs)]
pub(crate) struct DepthArgs {
    /// Camera of depth maps in pixels, in place of what JSON files say: FX,FY,CX,CY, with the size of its pictures if the
    /// centre is not near their middle
    #[arg(
        long,
        value_name = "FX,FY,CX,CY[,WIDTH,HEIGHT]",
        value_parser = parse_intrinsics,
        allow_hyphen_values = true,
        help_heading = "Reading depth maps"
    )]
    pub(crate) intrinsics: Option<Intrinsics>,
    /// Units of depth in a metre (TUM RGB-D: 5000, RealSense: 1000), in place of what JSON files say
    #[arg(long, value_name = "UNITS", value_parser = parse_depth_scale, help_heading = "Reading depth maps")]
    pub(crate) depth_scale: Option<f64>,
    /// Pose of single depth maps, from the camera (x right, y down, z forward) to the world: a 4 × 4 matrix as for
    /// --transform [default: from JSON files, else none]
    #[arg(long, value_name = "MATRIX|FILE", allow_hyphen_values = true, help_heading = "Reading depth maps")]
    pub(crate) pose: Option<String>,
    /// Colours of a single depth map: a PNG or JPEG picture of the same size, registered to it [default: from its JSON file, else
    /// none]
    #[arg(long, value_name = "FILE", help_heading = "Reading depth maps")]
    pub(crate) depth_colours: Option<PathBuf>,
    /// Keeps only depths of this range, in metres: NEAR..FAR
    #[arg(long, value_name = "NEAR..FAR", value_parser = parse_depth_range, help_heading = "Reading depth maps")]
    pub(crate) depth_range: Option<RangeInclusive<f64>>,
    /// Filters depths, in the order given: median:WINDOW, bilateral:WINDOW,SIGMA with a window of 3 to 31 pixels (odd) and
    /// a sigma in metres, as in median:3,bilateral:5,0.03
    #[arg(long, value_name = "LIST", value_parser = parse_filters, help_heading = "Reading depth maps")]
    pub(crate) depth_filter: Option<Filters>,
    /// Makes normals of depth maps from neighbouring pixels
    #[arg(long, help_heading = "Reading depth maps")]
    pub(crate) depth_normals: bool,
}

/// Filters, one after the other.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Filters(Vec<DepthFilter>);

impl DepthArgs {
    /// Each option, and whether it was given.
    pub(super) fn given(&self) -> [(&'static str, bool); 7] {
        [
            ("--intrinsics", self.intrinsics.is_some()),
            ("--depth-scale", self.depth_scale.is_some()),
            ("--pose", self.pose.is_some()),
            ("--depth-colours", self.depth_colours.is_some()),
            ("--depth-range", self.depth_range.is_some()),
            ("--depth-filter", self.depth_filter.is_some()),
            ("--depth-normals", self.depth_normals),
        ]
    }

    /// The options for the reader.
    pub(super) fn options(&self) -> Result<DepthOptions, Failure> {
        let mut options = DepthOptions::default();
        options.intrinsics = self.intrinsics;
        options.units_per_metre = self.depth_scale;
        options.pose = self.pose.as_ref().map(|pose| matrix("--pose", pose)).transpose()?;
        options.colours.clone_from(&self.depth_colours);
        options.range.clone_from(&self.depth_range);
        options.filters = self.depth_filter.clone().map(|Filters(filters)| filters).unwrap_or_default();
        options.normals = self.depth_normals;
        Ok(options)
    }
}

fn parse_intrinsics(text: &str) -> Result<Intrinsics, String> {
    let refuse = || "expected 4 numbers FX,FY,CX,CY, the first two above 0, or 6 with width and height".to_owned();
    let fields: Vec<&str> = text.split(',').map(str::trim).collect();
    let numbers = fields.iter().take(4).map(|field| field.parse().ok()).collect::<Option<Vec<f64>>>();
    let [fx, fy, cx, cy] = numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(refuse)?;
    let size = match fields[4..] {
        [] => None,
        [width, height] => match (width.parse(), height.parse()) {
            (Ok(width), Ok(height)) => Some([width, height]),
            _ => return Err(refuse()),
        },
        _ => return Err(refuse()),
    };
    let intrinsics = Intrinsics { focal: [fx, fy], centre: [cx, cy], size };
    if intrinsics.is_sound() { Ok(intrinsics) } else { Err(refuse()) }
}

fn parse_depth_scale(text: &str) -> Result<f64, String> {
    let scale = text.parse().ok().filter(|scale| DepthOptions::is_scale(*scale));
    scale
        .ok_or_else(|| "expected the units of depth in a metre, 10 to 1000000, such as 1000 for millimetres".to_owned())
}

fn parse_depth_range(text: &str) -> Result<RangeInclusive<f64>, String> {
    let refuse = || "expected NEAR..FAR in metres, such as 0.4..5".to_owned();
    let (near, far) = text.split_once("..").ok_or_else(refuse)?;
    let length = |text: &str| text.trim().parse().ok().filter(|v: &f64| v.is_finite() && *v >= 0.0);
    let (near, far) = length(near).zip(length(far)).ok_or_else(refuse)?;
    if near < far { Ok(near..=far) } else { Err(refuse()) }
}

fn parse_filters(text: &str) -> Result<Filters, String> {
    let refuse = || {
        let (least, most) = (DepthFilter::WINDOWS.start(), DepthFilter::WINDOWS.end());
        format!(
            "expected median:WINDOW or bilateral:WINDOW,SIGMA, or several, with an odd window of {least} to {most} pixels and \
             a sigma in metres above 0"
        )
    };
    let mut filters = Vec::new();
    let mut fields = text.split(',').map(str::trim);
    while let Some(field) = fields.next() {
        let (name, window) = field.split_once(':').ok_or_else(refuse)?;
        let window = window.parse().map_err(|_| refuse())?;
        filters.push(match name {
            "median" => DepthFilter::Median { window },
            "bilateral" => {
                let sigma = fields.next().and_then(|sigma| sigma.parse().ok());
                DepthFilter::Bilateral { window, range_sigma: sigma.ok_or_else(refuse)? }
            }
            _ => return Err(refuse()),
        });
    }
    if filters.iter().all(|filter| filter.is_sound()) { Ok(Filters(filters)) } else { Err(refuse()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_and_filters_are_read_or_refused() {
        let found = parse_intrinsics("525,525.5, 319.5,-1,640,480").unwrap();
        let size = Some([640, 480]);
        assert_eq!(found, Intrinsics { focal: [525.0, 525.5], centre: [319.5, -1.0], size });
        for text in ["", "1,2,3", "1,2,3,4,5", "0,2,3,4", "1,2,3,nan", "1,2,3,4,5,6,7", "1,2,3,4,5.5,6"] {
            assert!(parse_intrinsics(text).is_err(), "{text}");
        }
        let both = [DepthFilter::Median { window: 3 }, DepthFilter::Bilateral { window: 5, range_sigma: 0.03 }];
        assert_eq!(parse_filters("median:3,bilateral:5,0.03").unwrap().0, both);
        for text in
            ["", "median", "median:4", "median:1", "median:33", "bilateral:5", "bilateral:5,0", "mean:3", "0.03"]
        {
            assert!(parse_filters(text).is_err(), "{text}");
        }
        assert_eq!(parse_depth_range("0.4..5").unwrap(), 0.4..=5.0);
        for text in ["5..0.4", "1", "1..1", "-1..2", "a..b", "1..inf"] {
            assert!(parse_depth_range(text).is_err(), "{text}");
        }
        assert!(parse_depth_scale("0.001").is_err() && parse_depth_scale("5000").is_ok());
    }
}
