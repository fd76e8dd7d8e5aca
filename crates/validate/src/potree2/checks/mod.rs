//! One check per file. Each takes what it needs and pushes findings.

pub(crate) mod coverage;
pub(crate) mod metadata;
pub(crate) mod node_points;
pub(crate) mod payload_ranges;
pub(crate) mod ranges;
pub(crate) mod seams;
pub(crate) mod spacing;
pub(crate) mod structure;
