//! Why a lattice is the one that it is, as data.

use std::fmt;

use serde::{Serialize, Serializer};

/// Why a lattice was chosen. `Display` is for people.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct LatticeReason {
    /// What it was chosen by.
    pub basis: LatticeBasis,
    /// Made this many times coarser, because 31 bits could not hold the extent.
    pub coarser: Option<f64>,
}

/// What a lattice was chosen by.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub enum LatticeBasis {
    /// Not chosen yet: the headers do not suffice.
    #[default]
    Open,
    /// The plan.
    Requested,
    /// The lattice that all sources share.
    Sources,
    /// The finest of the sources, per axis.
    FinestOfSources,
    /// The finest of the sources that have one, per axis.
    FinestOfSome,
    /// Decimal parts of that, for the others' sake.
    PartOfFinest,
    /// The resolution of single precision at the largest coordinate, world units.
    SinglePrecision {
        /// The largest coordinate.
        farthest: f64,
    },
    /// The finest power of two; single precision would be finer.
    PowerOfTwo,
    /// The step in which the sources store coordinates.
    StoredStep,
    /// Neither lattice nor extent: the usual step.
    Usual,
    /// The finest power of ten.
    PowerOfTen,
}

impl fmt::Display for LatticeReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.basis {
            LatticeBasis::Open => f.write_str("known once the points are read"),
            LatticeBasis::Requested => f.write_str("as requested"),
            LatticeBasis::Sources => f.write_str("that of the sources"),
            LatticeBasis::FinestOfSources => f.write_str("the finest scale of the sources, per axis"),
            LatticeBasis::FinestOfSome => f.write_str(
                "the finest scale of the sources that have a lattice, per axis; the others are rounded to it",
            ),
            LatticeBasis::PartOfFinest => f.write_str(
                "a power of ten below the finest scale of the sources that have a lattice, for the other sources",
            ),
            LatticeBasis::SinglePrecision { farthest } => write!(
                f,
                "single precision of the sources: coordinates up to {farthest:.6} resolve no finer on every axis"
            ),
            LatticeBasis::PowerOfTwo => f.write_str(
                "the finest power of two that 31-bit integers hold; single precision of the sources would be finer",
            ),
            LatticeBasis::StoredStep => f.write_str("the step in which the sources store coordinates"),
            LatticeBasis::Usual => f.write_str("the inputs have no lattice and no extent"),
            LatticeBasis::PowerOfTen => {
                f.write_str("the sources have no lattice; the finest power of ten that 31-bit integers hold")
            }
        }?;
        match self.coarser {
            Some(factor) => write!(f, "; made {factor} times coarser, because 31 bits could not hold the extent"),
            None => Ok(()),
        }
    }
}

/// Why the grid of a dataset is the one that it is. Serialises to its text.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct GridReason {
    /// Why the lattice was chosen.
    pub lattice: LatticeReason,
    /// Some coordinates of the sources are not on it, and are rounded.
    pub rounds: bool,
}

impl fmt::Display for GridReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.lattice.fmt(f)?;
        if self.rounds { f.write_str("; coordinates that are not on it are rounded") } else { Ok(()) }
    }
}

impl Serialize for GridReason {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
