//! What is known of the accuracy of a dataset when it is judged.

use super::deviation::Deviation;

/// What a validation knows of the accuracy of a dataset.
#[derive(Debug, Default)]
pub(crate) struct Known<'a> {
    /// Points of the dataset.
    pub(crate) points: u64,
    /// The coordinate reference system, as the dataset states it.
    pub(crate) projection: &'a str,
    /// Least and greatest world coordinate of each axis.
    pub(crate) bounds: Option<[[f64; 2]; 3]>,
    /// The lattice against the sources, if they are at hand.
    pub(crate) lattice: Option<Side>,
    /// What a reader decodes against the lattice.
    pub(crate) format: Option<Side>,
}

/// What the lattice or the format did.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Side {
    pub(crate) deviation: Deviation,
    /// Points whose integers do not come back.
    pub(crate) lost: u64,
    /// Points that fell together with points that were apart; `None`: not counted.
    pub(crate) merged: Option<u64>,
}

impl Default for Side {
    fn default() -> Self {
        Self { deviation: Deviation::default(), lost: 0, merged: Some(0) }
    }
}

impl Side {
    pub(crate) fn merge(&mut self, other: &Self) {
        self.deviation.merge(&other.deviation);
        self.lost += other.lost;
        self.merged = self.merged.zip(other.merged).map(|(a, b)| a + b);
    }
}
