//! What came of a case.

use pointmill_bench::process::Cost;

use crate::cases::Case;

/// All runs of one case, or why they stopped.
pub(crate) struct Outcome {
    pub(crate) case: Case,
    pub(crate) costs: Vec<Cost>,
    pub(crate) output_bytes: u64,
    pub(crate) fault: Option<String>,
}
