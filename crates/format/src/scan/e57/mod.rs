//! E57 (ASTM E2807): all scans of a file as one cloud.
//!
//! [`open`] reads the XML and the heads of the packets and cuts the scans into pieces; [`Scan::decode`] turns a piece
//! into columns. Every page that is read is compared with its checksum; a bad one is an error of the pieces that need
//! it, naming the byte, and the others are read.
//!
//! * Positions are world coordinates: spherical ones are converted, the pose of the scan is applied in double
//!   precision. A point whose position is marked as invalid, or as a direction only, keeps its place in the file and
//!   has NaN coordinates, so that counts stay exact. A missing z (or elevation) is 0, with a warning.
//! * `rgb` and `intensity` are scaled to 16 bits: by the declared limits of the scan, else by the range of the field in
//!   the prototype, else (floats without any) by the usual range that holds a sample of the values, with a warning.
//!   Values outside of that range take its nearest end, NaN and infinity 0; both are counted
//!   ([`crate::PointBatch::changes`]). Colours and intensities that are marked as invalid are 0 and count as missing.
//! * `point source id` is the number of the scan in the file, from 0; beyond 65,535 it stays there.
//! * `NormalX`, `NormalY`, `NormalZ` (of the extension for surface normals) turn with the scan.
//! * All other fields keep their names, and their integers as they are stored ([`Attribute::scale`] and `offset` give
//!   what scaled ones mean). A scan that lacks a field has zeros. Times marked as invalid are NaN, or 0 as integers.
//! * `rowIndex` and `columnIndex` come only if [`E57Options::keep_row_column`] asks for them.
//! * Text fields are not read, as [`ScanInfo::warnings`] reports. Images are described ([`ScanInfo::images`]); their
//!   bytes come with [`read_blob`].
//!
//! ```no_run
//! use pointmill_format::scan::e57;
//! use pointmill_format::{Scan, Scratch, Wanted};
//! use std::ops::ControlFlow;
//!
//! let scan = e57::open("scan.e57")?;
//! let (wanted, mut scratch, mut points) = (Wanted::all(scan.info()), Scratch::default(), 0);
//! for piece in 0..scan.pieces().len() {
//!     scan.decode(piece, &wanted, &mut scratch, &mut |batch| {
//!         points += batch.len();
//!         ControlFlow::Continue(())
//!     })?;
//! }
//! # Ok::<(), pointmill_format::ReadError>(())
//! ```
//!
//! Sources: ASTM E2807-11; D. Huber, "The ASTM E57 file format for 3D imaging data exchange", 2011.

mod cuts;
mod decode;
mod fields;
mod file;
mod header;
mod images;
mod notes;
mod open;
mod options;
mod packets;
mod pages;
mod pose;
mod scaling;
mod schema;
mod streams;
mod unpack;
mod xml;

use std::path::Path;

#[cfg(doc)]
use crate::Attribute;
use crate::{Piece, ReadError, Scan, ScanInfo, Scratch, Sink, Wanted};
use file::E57Scan;

pub use images::read_blob;
pub use options::E57Options;

/// True if the first bytes of a file say that it is E57.
pub fn is_e57(first_bytes: &[u8]) -> bool {
    first_bytes.starts_with(header::SIGNATURE)
}

/// Opens an E57 file: reads its XML and the heads of its packets. Points are decoded only to find the range of
/// colours or intensities that the file does not declare, from a sample.
///
/// # Errors
/// Not E57, cut short before the XML, XML that is damaged or not understood, a scan without positions.
pub fn open(path: impl AsRef<Path>) -> Result<Box<dyn Scan>, ReadError> {
    open_with(path, E57Options::default())
}

/// [`open`], with options.
///
/// # Errors
/// Those of [`open`].
#[allow(clippy::needless_pass_by_value)] // built in place by callers
pub fn open_with(path: impl AsRef<Path>, options: E57Options) -> Result<Box<dyn Scan>, ReadError> {
    Ok(Box::new(open::open(path.as_ref(), &options)?))
}

impl Scan for E57Scan {
    fn info(&self) -> &ScanInfo {
        &self.info
    }

    fn pieces(&self) -> &[Piece] {
        &self.pieces
    }

    fn decode_bytes(&self, wanted: &Wanted) -> u64 {
        decode::bytes(self, wanted)
    }

    fn decode(
        &self,
        piece: usize,
        wanted: &Wanted,
        scratch: &mut Scratch,
        sink: &mut Sink<'_>,
    ) -> Result<(), ReadError> {
        decode::piece(self, piece, wanted, scratch, sink)
    }
}
