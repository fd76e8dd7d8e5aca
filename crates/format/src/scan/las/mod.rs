//! LAS 1.0–1.5 and LAZ, point formats 0–10.
//!
//! [`open`] reads what stands around the points and cuts them into pieces; [`Scan::decode`] turns a piece into columns.
//! Nothing that the file says is believed where the bytes can be asked: counts, lengths and offsets are clamped to the
//! file, and disagreements are reported in [`ScanInfo::warnings`].
//!
//! * The header's point count is obeyed where it is smaller than what is there (0 means no points), with a warning;
//!   where it is larger, the points that are there are read.
//! * A LAZ file without a usable chunk table is still read: layered chunks (formats 6–10) are found one by one, others
//!   are decoded in sequence as one piece. COPC files are read as the LAZ files that they are.
//! * Several Extra Bytes records are joined where their widths add up; points that LASzip stored in its compatibility
//!   mode (formats 6–10 as 1, 3, 4 or 5) have the fields of the format that they were made from.
//! * A broken chunk table is mended where the mended one can be proven.
//! * Waveform packets (formats 4, 5, 9, 10) are not read, all other values of these formats are.
//!
//! ```no_run
//! use pointmill_format::scan::las;
//! use pointmill_format::{Scan, Scratch, Wanted};
//! use std::ops::ControlFlow;
//!
//! let scan = las::open("scan.laz")?;
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
//! Sources: ASPRS LAS Specification 1.4 R15 and 1.5; LASzip by M. Isenburg ("LASzip: lossless compression of LiDAR
//! data", 2013).

mod ahead;
mod bytes;
mod chunk_table;
mod chunks;
mod compatible;
mod compressed;
mod crs;
mod decode;
mod decompress;
mod emitter;
mod extra_bytes;
mod file;
mod front;
mod geotiff;
mod header;
mod kernels;
mod laszip;
mod laz;
mod memory;
mod mend;
mod pieces;
mod records;
mod schema;
pub mod write;

use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::scan::source::Source;
use crate::{Piece, ReadError, Scan, ScanInfo, Scratch, Sink, Wanted};
use chunk_table::Layout;
use file::LasScan;
use front::Front;
use laszip::LaszipRecord;
use pieces::Planner;

pub use chunks::chunk_table_entries;
pub(crate) use chunks::{ChunkFile, ChunkPlace};
pub use header::is_las;

/// Scans opened so far: each has a number of its own.
static SCANS: AtomicU64 = AtomicU64::new(0);

/// Opens a LAS or LAZ file: reads its header, records and (LAZ) chunk table, decodes no point.
///
/// # Errors
/// Not LAS, cut short before the points, a point format or compression that is not known, records that cannot hold
/// their point format, or a scale that cannot place a point.
pub fn open(path: impl AsRef<Path>) -> Result<Box<dyn Scan>, ReadError> {
    Ok(Box::new(LasScan::open(path.as_ref())?))
}

impl LasScan {
    fn open(path: &Path) -> Result<Self, ReadError> {
        let source = Source::open(path)?;
        let front = Front::read(&source)?;
        let format = front.format_name();
        let Front { header, records, schema, laszip, crs, mut warnings } = front;
        let mut planner = Planner { source: &source, header: &header, records: &records, warnings: &mut warnings };
        let plan = match &laszip {
            Some(laszip) => planner.laz(laszip)?,
            None => planner.las(),
        };
        let info = ScanInfo {
            path: path.to_path_buf(),
            format,
            points_declared: header.point_count,
            bounds_declared: header.bounds,
            lattice: header.lattice.is_valid().then_some(header.lattice),
            resolution: Default::default(),
            parts: Vec::new(),
            images: Vec::new(),
            rgb_is_16_bit: false,
            attributes: schema.attributes.clone().into(),
            crs,
            file_bytes: source.len(),
            warnings,
        };
        let id = SCANS.fetch_add(1, Ordering::Relaxed);
        Ok(Self { id, source, info, schema, record_len: header.record_len, laszip, plan })
    }

    /// How the chunks of this file are laid out.
    fn layout(&self, laszip: &LaszipRecord) -> Layout {
        Layout {
            points_start: 0,
            record_len: self.record_len,
            chunk_points: laszip.chunk_points,
            layers: laszip.layers(),
        }
    }
}

impl Scan for LasScan {
    fn info(&self) -> &ScanInfo {
        &self.info
    }

    fn pieces(&self) -> &[Piece] {
        &self.plan.pieces
    }

    fn decode_bytes(&self, wanted: &Wanted) -> u64 {
        memory::decode_bytes(self, wanted)
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
