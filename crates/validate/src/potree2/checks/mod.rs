//! One check per file. Each takes what it needs and pushes findings.

pub(crate) mod metadata;
pub(crate) mod payload_ranges;
pub(crate) mod ranges;
pub(crate) mod structure;
