//! The public header block of LAS 1.0–1.5 (LAS 1.4 R15 §2.4; 1.5 adds 18 bytes at its end).

use super::bytes::{f64_at, f64x3_at, u16_at, u32_at, u64_at};
use crate::scan::source::Source;
use crate::{Aabb, Advice, Fault, Lattice, ReadError, ScanWarning};

/// Bytes of the LAS 1.0–1.2 header; every later one starts with these.
const MIN_HEADER: u64 = 227;
/// The first of three doubles.
const SCALES: u64 = 131;
const OFFSETS: u64 = 155;
/// Bytes of the LAS 1.4 header.
const HEADER_1_4: u64 = 375;

/// Bytes of a record of each point format, without extra bytes.
pub(super) const RECORD_LEN: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// The fields that reading needs. Counts and offsets are claims.
#[derive(Debug, Clone)]
pub(super) struct Header {
    pub(super) version: (u8, u8),
    /// Bit 4 of the global encoding: of WKT and GeoTIFF keys, the former counts.
    pub(super) wkt_counts: bool,
    /// Where the variable length records start.
    pub(super) header_size: u64,
    pub(super) points_start: u64,
    pub(super) vlr_count: u32,
    /// Point format 0–10, without the compression bits.
    pub(super) point_format: u8,
    /// Bit 7 or 6 of the point format: LASzip sets it.
    pub(super) compressed_bit: bool,
    /// Bytes of a record, ≥ those of its format.
    pub(super) record_len: usize,
    pub(super) point_count: u64,
    pub(super) lattice: Lattice,
    /// `None` if inverted or not finite.
    pub(super) bounds: Option<Aabb>,
    /// 0 if the version has none.
    pub(super) evlr_start: u64,
    pub(super) evlr_count: u32,
}

/// True if the first bytes of a file say that it is LAS or LAZ.
pub fn is_las(first_bytes: &[u8]) -> bool {
    first_bytes.starts_with(b"LASF")
}

impl Header {
    /// Bytes of a record that the point format accounts for; what follows are extra bytes.
    pub(super) fn format_len(&self) -> usize {
        RECORD_LEN[usize::from(self.point_format)]
    }

    /// Takes the number of points from elsewhere if the header says that there are none.
    pub(super) fn take_point_count(&mut self, count: u64, warnings: &mut Vec<ScanWarning>) {
        if self.point_count == 0 && count > 0 {
            warnings.push(ScanWarning::CompatibilityCount { count });
            self.point_count = count;
        }
    }

    /// Reads and checks the header. What does not keep points from being read becomes a line in `warnings`.
    pub(super) fn read(source: &Source, warnings: &mut Vec<ScanWarning>) -> Result<Self, ReadError> {
        let path = source.path();
        let bytes = source.vec_at(0, HEADER_1_4)?;
        if !is_las(&bytes) {
            let not_las = || Fault::Header("not a LAS or LAZ file (no LASF signature)".to_owned());
            let fault = if bytes.is_empty() { Fault::Empty } else { not_las() };
            return Err(ReadError::broken(path, 0, fault).advise(Advice::WrongFile));
        }
        if source.len() < MIN_HEADER {
            let what = format!("the header has {} of at least {MIN_HEADER} bytes", source.len());
            return Err(ReadError::broken(path, source.len(), Fault::Header(what)).advise(Advice::CutShort));
        }
        let version = (bytes[24], bytes[25]);
        if version.0 != 1 || version.1 > 5 {
            let found = (u32::from(version.0), u32::from(version.1));
            let fault = Fault::UnknownVersion { format: "LAS", found, known: "1.0 to 1.5 are" };
            return Err(ReadError::unsupported(path, fault));
        }
        let point_format = bytes[104] & 0x3f;
        if point_format > 10 {
            return Err(ReadError::unsupported(
                path,
                format!("point format {point_format} is not known (0 to 10 are)"),
            ));
        }
        let header = Self {
            version,
            wkt_counts: u16_at(&bytes, 6) & 1 << 4 != 0,
            header_size: header_size(&bytes, warnings),
            points_start: u64::from(u32_at(&bytes, 96)),
            vlr_count: u32_at(&bytes, 100),
            point_format,
            compressed_bit: bytes[104] & 0xc0 != 0,
            record_len: usize::from(u16_at(&bytes, 105)),
            point_count: u64::from(u32_at(&bytes, 107)),
            lattice: Lattice { scale: f64x3_at(&bytes, SCALES as usize), offset: f64x3_at(&bytes, OFFSETS as usize) },
            bounds: bounds(&bytes),
            evlr_start: 0,
            evlr_count: 0,
        };
        header.with_1_4_fields(&bytes, warnings).checked(source, warnings)
    }

    fn with_1_4_fields(mut self, bytes: &[u8], warnings: &mut Vec<ScanWarning>) -> Self {
        if self.version.1 < 4 || self.header_size < HEADER_1_4 || (bytes.len() as u64) < HEADER_1_4 {
            return self;
        }
        self.evlr_start = u64_at(bytes, 235);
        self.evlr_count = u32_at(bytes, 243);
        let (legacy, count) = (self.point_count, u64_at(bytes, 247));
        if count == 0 && legacy != 0 {
            warnings.push(ScanWarning::LegacyCount { legacy, count });
            return self;
        }
        if legacy != 0 && legacy != count {
            warnings.push(ScanWarning::LegacyCount { legacy, count });
        }
        self.point_count = count;
        self
    }

    /// Refuses what makes records impossible to find or to place.
    fn checked(self, source: &Source, warnings: &mut Vec<ScanWarning>) -> Result<Self, ReadError> {
        let path = source.path();
        let need = self.format_len();
        if self.record_len < need {
            let what =
                format!("records are {} bytes long, point format {} needs {need}", self.record_len, self.point_format);
            return Err(ReadError::broken(path, 105, Fault::Header(what)).advise(Advice::ExportAgain));
        }
        if self.points_start < MIN_HEADER {
            let what = format!("the points are said to start at byte {}, inside the header", self.points_start);
            return Err(ReadError::broken(path, 96, Fault::Header(what)).advise(Advice::ExportAgain));
        }
        if self.points_start > source.len() {
            let (offset, file_bytes) = (self.points_start, source.len());
            let fault = Fault::OutsideFile { part: "the points", offset, bytes: None, file_bytes };
            return Err(ReadError::broken(path, source.len(), fault).advise(Advice::CutShort));
        }
        if let Some((at, what)) = self.misplaced().filter(|_| self.point_count > 0) {
            return Err(ReadError::broken(path, at, Fault::Header(what)).advise(Advice::ExportAgain));
        }
        if self.bounds.is_none() && self.point_count > 0 {
            warnings.push(ScanWarning::Bounds);
        }
        Ok(self)
    }

    /// The first scale or offset that cannot place a point: its byte, and what is wrong with it.
    fn misplaced(&self) -> Option<(u64, String)> {
        let Lattice { scale, offset } = self.lattice;
        let each = (0..3u64).zip(["x", "y", "z"]).zip(scale.into_iter().zip(offset));
        each.flat_map(|((axis, name), (scale, offset))| {
            let (least, most) = (Lattice::FINEST_STEP, Lattice::COARSEST_STEP);
            let step = format!(
                "the scale of {name} is {scale:e}, no step that coordinates can have ({least:e} to {most:.1e})"
            );
            let place = format!("the offset of {name} is {offset:e}, no place that coordinates can have");
            [
                (!Lattice::is_sound_step(scale)).then_some((SCALES + 8 * axis, step)),
                (!Lattice::is_sound_offset(offset)).then_some((OFFSETS + 8 * axis, place)),
            ]
        })
        .flatten()
        .min_by_key(|(at, _)| *at)
    }
}

fn header_size(bytes: &[u8], warnings: &mut Vec<ScanWarning>) -> u64 {
    let size = u64::from(u16_at(bytes, 94));
    if size < MIN_HEADER {
        warnings.push(ScanWarning::HeaderSize { declared: size, taken: MIN_HEADER });
        return MIN_HEADER;
    }
    size
}

/// Stored as max x, min x, max y, min y, max z, min z.
fn bounds(bytes: &[u8]) -> Option<Aabb> {
    let max = [179, 195, 211].map(|at| f64_at(bytes, at));
    let min = [187, 203, 219].map(|at| f64_at(bytes, at));
    let aabb = Aabb { min, max };
    (!aabb.is_empty() && min.iter().chain(&max).all(|v| v.is_finite())).then_some(aabb)
}

#[cfg(test)]
mod tests {
    use pointmill_testkit::las::Las;

    use super::super::open;
    use crate::ErrorKind;

    /// The byte at which a file with one odd number is refused; `None`: it is read.
    fn refused_at(at: usize, value: f64) -> Option<u64> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.las");
        let mut bytes = Las { offset: [0.0; 3], ..Las::terrain(5, 1) }.bytes();
        bytes[at..at + 8].copy_from_slice(&value.to_le_bytes());
        std::fs::write(&path, &bytes).unwrap();
        let error = open(&path).err()?;
        assert!(matches!(error.kind(), ErrorKind::Broken), "{error}");
        error.offset()
    }

    #[test]
    fn scales_and_offsets_that_place_no_point_are_refused_with_their_byte() {
        for at in [131, 139, 147] {
            for scale in [0.0, -0.0, -0.001, 5e-310, 1e-300, 9e-16, 5e20, 1e300, f64::NAN, f64::INFINITY] {
                assert_eq!(refused_at(at, scale), Some(at as u64), "{scale:e}");
            }
            for scale in [1e-15, 1e-12, 1e-7, 0.3048, 1000.0, 4e20] {
                assert_eq!(refused_at(at, scale), None, "{scale:e}");
            }
        }
        for at in [155, 163, 171] {
            for offset in [1.1e30, -1e300, f64::NAN, f64::NEG_INFINITY] {
                assert_eq!(refused_at(at, offset), Some(at as u64), "{offset:e}");
            }
            assert_eq!((refused_at(at, -1e30), refused_at(at, 5e-310)), (None, None));
        }
    }
}
