//! Records as they are stored between being read and being written: a position, then the attributes, packed.

use super::cube::Cube;
use super::frames::{StoredOrigin, StoredPoint, TreePoint};
use crate::sources::POSITION_BYTES;

/// How stored records are read.
#[derive(Debug, Clone)]
pub(crate) struct RecordFrame {
    /// Bytes of a stored record.
    pub(crate) stride: usize,
    pub(crate) cube: Cube,
    pub(crate) origin: StoredOrigin,
}

impl RecordFrame {
    /// Tree coordinates of a stored record.
    #[inline]
    pub(crate) fn tree(&self, record: &[u8]) -> TreePoint {
        self.cube.tree(self.origin.job(position(record)))
    }
}

/// The stored integers of a record.
#[inline]
pub(crate) fn position(record: &[u8]) -> StoredPoint {
    StoredPoint(match record.first_chunk::<POSITION_BYTES>() {
        Some(&[a, b, c, d, e, f, g, h, i, j, k, l]) => {
            [i32::from_le_bytes([a, b, c, d]), i32::from_le_bytes([e, f, g, h]), i32::from_le_bytes([i, j, k, l])]
        }
        None => [0; 3],
    })
}

/// Copies one record: a few 16-byte moves instead of a call, since records are short and their length varies.
#[inline]
pub(crate) fn copy_record(from: &[u8], to: &mut [u8]) {
    let n = from.len().min(to.len());
    let (from, to) = (&from[..n], &mut to[..n]);
    if n < 16 {
        match (from.first_chunk::<8>(), from.last_chunk::<8>()) {
            (Some(first), Some(last)) => {
                to[..8].copy_from_slice(first);
                to[n - 8..].copy_from_slice(last);
            }
            _ => to.copy_from_slice(from),
        }
        return;
    }
    for (from, to) in from.as_chunks::<16>().0.iter().zip(to.as_chunks_mut::<16>().0) {
        *to = *from;
    }
    // The last move may overlap the one before.
    if let (Some(from), Some(to)) = (from.last_chunk::<16>(), to.last_chunk_mut::<16>()) {
        *to = *from;
    }
}
