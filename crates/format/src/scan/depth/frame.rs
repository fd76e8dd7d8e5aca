//! A depth image with its camera, its place and its colours.

use std::path::{Path, PathBuf};

use super::camera::Camera;
use super::colour::{self, Colours};
use super::filter;
use super::grid::Grid;
use super::normals::normal;
use super::picture::{DepthPicture, Header, Rule, SIZE_AT, check_size, cut, first_bytes, is_cut, not_depth};
use crate::{Advice, Affine, DepthFilter, DepthOptions, ReadError};

/// A frame of a scan.
#[derive(Debug)]
pub(super) struct Frame {
    /// For people.
    pub(super) name: String,
    /// Its number in the sequence, from 0.
    pub(super) index: usize,
    pub(super) depth: PathBuf,
    pub(super) colour: Option<PathBuf>,
    pub(super) camera: Camera,
    pub(super) pose: Affine,
    /// Of its picture, or what that should be.
    pub(super) size: [u32; 2],
    /// What is wrong without a look into the pictures.
    pub(super) fault: Option<Flaw>,
}

/// What is wrong with a frame: in which file, at which byte.
#[derive(Debug, Clone)]
pub(super) struct Flaw {
    pub(super) path: PathBuf,
    pub(super) at: u64,
    pub(super) what: String,
}

/// What was found out about a frame without its depths.
pub(super) struct Seen {
    pub(super) size: [u32; 2],
    pub(super) bytes: u64,
    /// Pixels with a depth.
    pub(super) points: u64,
}

/// The pixels of a frame.
pub(super) struct Pixels {
    pub(super) grid: Grid,
    pub(super) colours: Option<Colours>,
}

impl Frame {
    /// Looks at the pictures: their sizes, and how many depths there are.
    pub(super) fn look(&self, rule: &Rule) -> Result<Seen, ReadError> {
        self.check()?;
        let bytes = std::fs::metadata(&self.depth).map_err(|e| ReadError::io(&self.depth, "opening", e))?.len();
        let size = self.header()?;
        if let Some(path) = &self.colour {
            colour::check(path, colour::size(path)?, size)?;
        }
        let points = DepthPicture::open(&self.depth, rule)?.count()?;
        Ok(Seen { size, bytes, points })
    }

    /// Which of its pixels are depths.
    pub(super) fn rule(&self, options: &DepthOptions) -> Rule {
        Rule { units_per_metre: self.camera.units_per_metre, range: options.range.clone() }
    }

    /// What is wrong without a look into the pictures.
    fn check(&self) -> Result<(), ReadError> {
        if let Some(Flaw { path, at, what }) = &self.fault {
            return Err(ReadError::broken(path, *at, what.clone()).advise(Advice::SkipUnreadable));
        }
        for path in [Some(&self.depth), self.colour.as_ref()].into_iter().flatten() {
            if path.is_dir() {
                let what = "this is a folder, not a picture";
                return Err(ReadError::broken(path, None, what).advise("correct the path of the picture"));
            }
            if !path.is_file() {
                return Err(ReadError::broken(path, None, "no such picture").advise(Advice::SkipUnreadable));
            }
        }
        Ok(())
    }

    /// The size of the depth picture, which is of that camera.
    fn header(&self) -> Result<[u32; 2], ReadError> {
        let header = header_of(&self.depth)?;
        check_size(&self.depth, header.size)?;
        let broken = |what: String| ReadError::broken(&self.depth, SIZE_AT, what).advise(Advice::NameCamera);
        self.camera.intrinsics.check(header.size).map_err(broken)?;
        Ok(header.size)
    }

    /// Reads the pictures; the depths are filtered. `memory` is for what a decoder gives, and is kept.
    pub(super) fn pixels(
        &self,
        rule: &Rule,
        filters: &[DepthFilter],
        with_colours: bool,
        memory: &mut Vec<u8>,
    ) -> Result<Pixels, ReadError> {
        self.check()?;
        let size = self.header()?;
        let picture = DepthPicture::open(&self.depth, rule)?;
        if [size, picture.size()] != [self.size; 2] {
            return Err(changed(&self.depth));
        }
        let colours = self.colour.as_ref().filter(|_| with_colours).map(|path| colour::read(path, size)).transpose()?;
        let mut grid = picture.depths(memory)?;
        filter::apply(filters, &mut grid);
        Ok(Pixels { grid, colours })
    }

    /// Where a pixel of that depth is in the world.
    #[inline]
    pub(super) fn world(&self, pixel: [usize; 2], depth: f64) -> [f64; 3] {
        self.pose.apply(self.camera.intrinsics.place(pixel, depth))
    }

    /// The normal of a pixel in the world, towards the camera; zeros where it has none.
    pub(super) fn normal(&self, grid: &Grid, pixel: [usize; 2]) -> [f32; 3] {
        let turned = self.pose.turn(normal(grid, &self.camera.intrinsics, pixel));
        let length = crate::geometry::vectors::length(turned);
        if length > 0.0 { turned.map(|n| (n / length) as f32) } else { [0.0; 3] }
    }

    /// Memory of the pictures.
    pub(super) fn pixel_bytes(&self, filters: &[DepthFilter]) -> u64 {
        let pixels = u64::from(self.size[0]) * u64::from(self.size[1]);
        let colours = if self.colour.is_some() { Colours::bytes(pixels) } else { 0 };
        // as stored, and as lengths
        pixels * 2 + pixels * size_of::<f64>() as u64 + filter::bytes(filters, pixels) + colours
    }
}

/// The header of a depth picture.
pub(super) fn header_of(path: &Path) -> Result<Header, ReadError> {
    let first = first_bytes(path)?;
    let header = Header::of(&first).ok_or_else(|| match is_cut(&first) || first.is_empty() {
        true => cut(path, first.len() as u64),
        false => {
            ReadError::broken(path, 0, "no PNG picture; a depth map is one of 16-bit grey").advise(Advice::Damaged)
        }
    })?;
    if header.is_depth() { Ok(header) } else { Err(not_depth(path, header)) }
}

/// A picture that is not what it was when it was opened.
pub(super) fn changed(path: &Path) -> ReadError {
    ReadError::broken(path, 0, "the picture has changed since it was opened")
        .advise("convert it once nothing writes to it")
}
