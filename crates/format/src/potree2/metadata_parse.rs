//! Reads `metadata.json`.

use std::path::Path;

use crate::ReadError;

use super::Metadata;

pub(super) fn parse(_bytes: &[u8], path: &Path) -> Result<Metadata, ReadError> {
    Err(ReadError::unsupported(path, "not yet"))
}
