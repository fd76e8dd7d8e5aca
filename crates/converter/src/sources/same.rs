//! Whether a file that is opened again is still the one that was opened first.

use std::hash::{DefaultHasher, Hash, Hasher};

use pointmill_format::{Scan, ScanInfo};

use super::shared::hash_attributes;

/// A number that differs, but for one case in 2^64, where anything differs that the run relies on: the time of the last
/// change, the size, what the points are and where in the file they lie.
pub(super) fn mark(scan: &dyn Scan) -> u64 {
    let info: &ScanInfo = scan.info();
    let mut hasher = DefaultHasher::new();
    let h = &mut hasher;
    // where the system knows no such time, the rest must do
    std::fs::metadata(&info.path).and_then(|meta| meta.modified()).ok().hash(h);
    (info.file_bytes, info.points_declared, &info.format, info.rgb_is_16_bit).hash(h);
    let bits = |corner: [f64; 3]| corner.map(f64::to_bits);
    info.lattice.map(|l| [bits(l.scale), bits(l.offset)]).hash(h);
    info.bounds_declared.map(|b| [bits(b.min), bits(b.max)]).hash(h);
    hash_attributes(&info.attributes, h);
    for part in &info.parts {
        (&part.range, bits(part.translation)).hash(h);
    }
    for piece in scan.pieces() {
        (piece.first_point, piece.points, piece.byte_offset, piece.byte_len).hash(h);
    }
    hasher.finish()
}
