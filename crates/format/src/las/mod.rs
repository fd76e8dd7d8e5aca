//! LAS 1.0–1.5 and LAZ.

use std::path::Path;

use crate::{ReadError, Scan};

/// True if the first bytes of a file say that it is LAS or LAZ.
pub fn is_las(first_bytes: &[u8]) -> bool {
    first_bytes.starts_with(b"LASF")
}

/// Opens a LAS or LAZ file: reads its header, records and (LAZ) chunk table, decodes no point.
///
/// # Errors
/// Not LAS, cut short before the points, or a point format or compression that is not known.
pub fn open(path: &Path) -> Result<Box<dyn Scan>, ReadError> {
    Err(ReadError::unsupported(path, "LAS is not built yet"))
}
