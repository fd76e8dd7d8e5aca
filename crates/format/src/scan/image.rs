//! Images within a file of scans, as the file describes them.

use std::fmt;

/// An image within a file of scans (E57), and where its bytes are.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ScanImage {
    /// The number of the image in the file, from 1; its preview, if it has one, has the same.
    pub number: usize,
    /// Its name, or empty.
    pub name: String,
    /// How its pixels are related to space.
    pub kind: ImageKind,
    /// The encoding that the file declares.
    pub encoding: ImageEncoding,
    /// Width and height that the file declares, in pixels.
    pub pixels: [u64; 2],
    /// Where the encoded image is.
    pub data: Blob,
    /// Where a PNG of the same size is whose pixels are 0 where the image is not valid.
    pub mask: Option<Blob>,
    /// The number of the scan ([`crate::ScanPart::number`]) that it belongs to.
    pub scan: Option<usize>,
    /// Where the camera stood: `world = rotation · local + translation`; `None` if the file does not say.
    pub pose: Option<ImagePose>,
    /// Distances of the projection, as far as its kind has them.
    pub geometry: ImageGeometry,
}

/// Where a camera stood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImagePose {
    /// Rows of the matrix.
    pub rotation: [[f64; 3]; 3],
    /// In world units.
    pub translation: [f64; 3],
}

/// How the pixels of an image are related to space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum ImageKind {
    /// A plane before a pinhole.
    Pinhole,
    /// Azimuth by elevation: a panorama.
    Spherical,
    /// Azimuth by height.
    Cylindrical,
    /// Not at all: a preview, or an illustration.
    VisualReference,
}

impl ImageKind {
    /// "pinhole", "spherical", "cylindrical", "visual reference".
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pinhole => "pinhole",
            Self::Spherical => "spherical",
            Self::Cylindrical => "cylindrical",
            Self::VisualReference => "visual reference",
        }
    }
}

impl fmt::Display for ImageKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How an image is encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ImageEncoding {
    /// JPEG.
    Jpeg,
    /// PNG.
    Png,
}

impl ImageEncoding {
    /// "JPEG", "PNG".
    pub const fn name(self) -> &'static str {
        match self {
            Self::Jpeg => "JPEG",
            Self::Png => "PNG",
        }
    }

    /// The usual extension of a file's name: "jpg", "png".
    pub const fn extension(self) -> &'static str {
        match self {
            Self::Jpeg => "jpg",
            Self::Png => "png",
        }
    }

    /// The encoding that an image starting with these bytes has.
    #[must_use]
    pub fn of(first_bytes: &[u8]) -> Option<Self> {
        match first_bytes {
            [0xff, 0xd8, 0xff, ..] => Some(Self::Jpeg),
            [0x89, b'P', b'N', b'G', ..] => Some(Self::Png),
            _ => None,
        }
    }
}

/// Bytes within a file that stand for themselves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Blob {
    /// Where its section starts in the file.
    pub byte_offset: u64,
    /// How many bytes it declares.
    pub bytes: u64,
}

/// Distances of an image's projection (ASTM E2807 §8.4.4); each is `None` where its kind has none.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct ImageGeometry {
    /// Pinhole: from the pinhole to the plane, metres.
    pub focal_length: Option<f64>,
    /// Width and height of a pixel: metres (pinhole), radians (spherical), radians and metres (cylindrical).
    pub pixel_size: Option<[f64; 2]>,
    /// Pinhole and cylindrical: column and row where the optical axis meets the image, pixels from the upper left one's
    /// centre; cylindrical images have a row alone, and 0 as column.
    pub principal_point: Option<[f64; 2]>,
    /// Cylindrical: from the axis to the image, metres.
    pub radius: Option<f64>,
}
