//! What all formats of files have in common.

use pointmill_format::Changes;
use pointmill_format::scan::las::write::Tally;

use super::rows::Block;
use crate::error::ConvertError;
use crate::runtime::DiskFile;
use crate::sources::Schema;

/// Where an attribute is in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Place {
    /// Index in the schema.
    pub(super) attribute: usize,
    /// For reports: "field", "extra bytes", "red green blue".
    pub(super) place: String,
}

/// Encodes blocks of points, on any thread; writes what stands around them.
pub(super) trait Encoder: Sync {
    /// For people: "LAS 1.4, point format 7".
    fn describe(&self) -> String;

    /// Where attributes are.
    fn places(&self) -> Vec<Place>;

    /// The byte of the first point.
    fn start(&self) -> Result<u64, ConvertError>;

    /// The bytes of a block; `None`: a value contradicts what was concluded before.
    fn encode(
        &self,
        block: &Block,
        schema: &Schema,
        tally: &mut Tally,
        changes: &mut [Changes],
    ) -> Result<Option<Vec<u8>>, ConvertError>;

    /// Writes what stands before and behind the points, which end at `end`; the length of the file.
    fn finish(&self, file: &DiskFile, tally: &Tally, parts: &[(u32, u32)], end: u64) -> Result<u64, ConvertError>;
}
