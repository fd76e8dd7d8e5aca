//! An open E57 file.

use super::cuts::Cut;
use super::fields::Field;
use super::pose::Pose;
use super::schema::{Fill, PositionFields};
use crate::scan::source::Source;
use crate::{Piece, ScanInfo};

/// An open file.
pub(super) struct E57Scan {
    pub(super) source: Source,
    pub(super) info: ScanInfo,
    /// Scans with points.
    pub(super) scans: Vec<ScanPlan>,
    pub(super) pieces: Vec<Piece>,
    /// What each piece is made of; [`Cut::scan`] is an index into `scans`.
    pub(super) cuts: Vec<Cut>,
}

/// All that decoding needs of a scan.
pub(super) struct ScanPlan {
    /// Number in the file.
    pub(super) index: usize,
    pub(super) fields: Vec<Field>,
    pub(super) positions: PositionFields,
    pub(super) pose: Pose,
    /// By attribute.
    pub(super) fills: Vec<Fill>,
}
