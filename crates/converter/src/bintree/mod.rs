//! Bintree: not there yet.

use crate::convert::Run;
use crate::error::ConvertError;
use crate::plan::BintreeSettings;
use crate::report::OutputReport;
use crate::write::dataset::StagedDataset;

/// Builds and writes the dataset.
pub(crate) fn write(_: &Run<'_>, _: &BintreeSettings, _: &StagedDataset) -> Result<OutputReport, ConvertError> {
    Err(ConvertError::Unsupported("--to bintree is not supported yet by this version".into()))
}
