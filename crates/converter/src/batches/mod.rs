//! Batches: not there yet.

use crate::convert::Run;
use crate::error::ConvertError;
use crate::plan::BatchesSettings;
use crate::report::OutputReport;
use crate::write::dataset::StagedDataset;

/// Builds and writes the dataset.
pub(crate) fn write(_: &Run<'_>, _: &BatchesSettings, _: &StagedDataset) -> Result<OutputReport, ConvertError> {
    Err(ConvertError::Unsupported("--to batches is not supported yet by this version".into()))
}
