//! An open LAS or LAZ file.

use super::laszip::LaszipRecord;
use super::pieces::Plan;
use super::schema::Schema;
use crate::ScanInfo;
use crate::scan::source::Source;

/// An open file.
pub(super) struct LasScan {
    /// No other scan of this process has it.
    pub(super) id: u64,
    pub(super) source: Source,
    pub(super) info: ScanInfo,
    pub(super) schema: Schema,
    pub(super) record_len: usize,
    pub(super) laszip: Option<LaszipRecord>,
    pub(super) plan: Plan,
}
