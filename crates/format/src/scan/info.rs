//! What is known of a scan before its points are decoded.

use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use super::image::ScanImage;
use crate::{Aabb, Attribute, AxisGrid, Lattice, ScanWarning, Unit};

/// The coordinate reference system as the file declares it; nothing is derived.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Crs {
    /// OGC WKT text, as stored, without trailing zero bytes.
    pub wkt: Option<String>,
    /// EPSG code of the projected (else geographic) system from GeoTIFF keys, 1–32766.
    pub epsg: Option<u32>,
    /// EPSG code of the vertical system from GeoTIFF keys.
    pub vertical_epsg: Option<u32>,
    /// Unit of x and y that GeoTIFF keys declare beside the code; it goes before the unit of `epsg`.
    pub unit: Option<Unit>,
    /// Unit of z that GeoTIFF keys declare beside the code; it goes before the unit of `vertical_epsg`.
    pub vertical_unit: Option<Unit>,
    /// What GeoTIFF keys call the system, for people.
    pub citation: Option<String>,
    /// GeoTIFF keys define a projected or geographic system of their own, by parameters that are not read.
    pub is_user_defined: bool,
    /// There are WKT and GeoTIFF keys, and the file says that the keys count.
    pub keys_first: bool,
    /// A proj4 definition, as datasets have it; it counts where neither WKT nor a code says more.
    pub proj4: Option<String>,
}

impl Crs {
    /// What is known: WKT text, code of the (projected) system, code of the vertical one.
    #[must_use]
    pub fn new(wkt: Option<String>, epsg: Option<u32>, vertical_epsg: Option<u32>) -> Self {
        Self { wkt, epsg, vertical_epsg, ..Self::default() }
    }

    /// The same with the units that GeoTIFF keys declare, of x and y, and of z.
    #[must_use]
    pub fn with_units(self, unit: Option<Unit>, vertical_unit: Option<Unit>) -> Self {
        Self { unit, vertical_unit, ..self }
    }
}

/// What is known of a scan before its points are decoded. Header values are claims, not facts.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ScanInfo {
    /// The file.
    pub path: PathBuf,
    /// For people: "LAZ 1.4, point format 7".
    pub format: String,
    /// What the header says, unchecked.
    pub points_declared: u64,
    /// What the header says, unchecked; `None` if it says nothing or nonsense (inverted, not finite).
    pub bounds_declared: Option<Aabb>,
    /// The lattice of [`crate::Positions::Quantized`] batches; `None` for world coordinates.
    pub lattice: Option<Lattice>,
    /// How finely the file stores world coordinates, per axis; meaningless for scans that have a lattice.
    pub resolution: [Resolution; 3],
    /// The scans within the file that are read, where its format knows such (E57, PTX); else empty.
    pub parts: Vec<ScanPart>,
    /// The images within the file (E57).
    pub images: Vec<ScanImage>,
    /// The columns beside the position, in order.
    pub attributes: Arc<[Attribute]>,
    /// True if `rgb` has 16 bits because the file says so (E57), however small its values are.
    pub rgb_is_16_bit: bool,
    /// The coordinate reference system.
    pub crs: Crs,
    /// Bytes of the file.
    pub file_bytes: u64,
    /// Disagreements that did not stop the reader ("the header declares 10 points, 3 are there").
    pub warnings: Vec<ScanWarning>,
}

impl ScanInfo {
    /// A scan of which nothing else is known: world coordinates in double precision, without attributes.
    #[must_use]
    pub fn new(path: impl Into<PathBuf>, format: impl Into<String>, points_declared: u64) -> Self {
        Self {
            path: path.into(),
            format: format.into(),
            points_declared,
            bounds_declared: None,
            lattice: None,
            resolution: [Resolution::default(); 3],
            parts: Vec::new(),
            images: Vec::new(),
            attributes: [].into(),
            rgb_is_16_bit: false,
            crs: Crs::default(),
            file_bytes: 0,
            warnings: Vec::new(),
        }
    }

    /// The column of that name: its index in [`Self::attributes`], and what it holds.
    pub fn attribute(&self, name: &str) -> Option<(usize, &Attribute)> {
        self.attributes.iter().enumerate().find(|(_, a)| a.name == name)
    }

    /// The part that the point `index` of the file belongs to.
    pub fn part_of(&self, index: u64) -> Option<&ScanPart> {
        // empty parts start where the next one does
        self.parts.iter().find(|part| part.range.contains(&index))
    }
}

/// How finely coordinates are stored: steps below that carry nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Resolution {
    /// As these coordinates and no others (scaled integers), but for the rounding of doubles.
    Grid(AxisGrid),
    /// In steps of that many world units, anywhere (scaled integers that are turned, single precision of a known range).
    Step(f64),
    /// In single precision, as world coordinates: 24 bits, so the step grows with the distance from 0.
    Single,
    /// In double precision, as decimal text, or not known: finer than any lattice.
    #[default]
    Double,
}

/// A scan within a file, as the file describes it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ScanPart {
    /// Its number in the file, from 1.
    pub number: usize,
    /// Its name, or empty.
    pub name: String,
    /// Points that it declares.
    pub points: u64,
    /// Its points among those of the whole file, as the pieces count them: no piece holds points of two parts. Empty if
    /// none of its points are there.
    pub range: Range<u64>,
    /// The box that it declares, moved to world coordinates; `None` if it declares none or nonsense.
    pub bounds: Option<Aabb>,
    /// `world = rotation · local + translation`, rows of the matrix; the reader has applied it.
    pub rotation: [[f64; 3]; 3],
    /// See `rotation`: where the scan's own origin (the scanner, as a rule) stands; world units.
    pub translation: [f64; 3],
}

/// A part of a scan that decodes without any other part.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Piece {
    /// Index in the scan of the first point.
    pub first_point: u64,
    /// Number of points, as the structures of the file give it.
    pub points: u64,
    /// Where the (compressed) bytes lie.
    pub byte_offset: u64,
    /// How many there are.
    pub byte_len: u64,
}

impl Piece {
    /// The piece of the points `points` (indices in the scan), stored in the bytes `bytes` (places in the file).
    #[must_use]
    pub const fn new(points: Range<u64>, bytes: Range<u64>) -> Self {
        Self {
            first_point: points.start,
            points: points.end.saturating_sub(points.start),
            byte_offset: bytes.start,
            byte_len: bytes.end.saturating_sub(bytes.start),
        }
    }
}
