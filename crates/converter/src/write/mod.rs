//! Payloads, and the dataset as files.

pub(crate) mod dataset;
pub(crate) mod payload;
