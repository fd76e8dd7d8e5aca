//! Why a lattice is the one that it is, and why a dataset that scans were added to was built anew, as data.

use std::fmt;

use serde::{Serialize, Serializer};

/// Why a lattice was chosen. `Display` is for people.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct LatticeReason {
    /// Per axis.
    pub axes: [AxisReason; 3],
}

/// Why the step of an axis was chosen.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct AxisReason {
    /// What it was chosen by.
    pub basis: LatticeBasis,
    /// It had to be coarser than that.
    pub coarser: Option<Coarser>,
    /// It is this many times coarser again, because the requested precision needs no finer step.
    pub enough: Option<f64>,
}

/// How much coarser a step had to be, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Coarser {
    /// As many times.
    pub factor: f64,
    /// Why.
    pub cause: CoarserCause,
}

/// Why a step had to be coarser.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum CoarserCause {
    /// 31 bits do not hold the extent.
    Extent,
    /// Doubles as large as the coordinates are further apart: a step is at least two of their distances.
    Doubles,
}

/// What a step was chosen by.
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
    /// The coarsest step that holds the coordinates of all sources.
    Common,
    /// The finest step of the sources, for want of a common one.
    FinestOfSources,
    /// Decimal parts of the step of some sources, for the others' sake.
    PartOfFinest,
    /// What all integers of the sources have in common.
    Divisor,
    /// The decimals that the coordinates have.
    Decimals,
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
    /// The finest step of 1, 2 or 5 times a power of ten.
    Decimal,
}

impl LatticeReason {
    /// True if the step of an axis is coarser than that of the sources, and nobody requested it.
    pub(crate) fn is_forced_coarser(&self) -> bool {
        self.axes.iter().any(|axis| axis.coarser.is_some() && axis.enough.is_none())
    }

    /// The same reason for all axes.
    pub(crate) fn of_all(basis: LatticeBasis) -> Self {
        Self { axes: [AxisReason { basis, coarser: None, enough: None }; 3] }
    }
}

impl fmt::Display for LatticeBasis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Open => f.write_str("known once the points are read"),
            Self::Requested => f.write_str("as requested"),
            Self::Sources => f.write_str("that of the sources"),
            Self::Common => f.write_str("the coarsest that holds the coordinates of all sources"),
            Self::FinestOfSources => f.write_str("the finest of the sources, which have none in common"),
            Self::PartOfFinest => {
                f.write_str("a power of ten below the finest of the sources that store integers, for the other sources")
            }
            Self::Divisor => f.write_str("a power of ten that all integers of the sources are multiples of"),
            Self::Decimals => f.write_str("the decimals of the coordinates"),
            Self::SinglePrecision { farthest } => {
                write!(f, "single precision of the sources, which resolves no finer at {farthest:.6}")
            }
            Self::PowerOfTwo => f.write_str(
                "the finest power of two that 31-bit integers hold; single precision of the sources would be finer",
            ),
            Self::StoredStep => f.write_str("the step in which the sources store coordinates"),
            Self::Usual => f.write_str("the inputs have no lattice and no extent"),
            Self::Decimal => f.write_str("the finest of 1, 2 and 5 times powers of ten that 31-bit integers hold"),
        }
    }
}

/// A factor: a step that was absurdly fine would give hundreds of digits.
struct Factor(f64);

impl fmt::Display for Factor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(factor) = self;
        if *factor < 1e9 { write!(f, "{factor}") } else { write!(f, "{factor:e}") }
    }
}

impl fmt::Display for AxisReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.basis.fmt(f)?;
        if let Some(Coarser { factor, cause }) = self.coarser {
            write!(f, "; made {} times coarser, because ", Factor(factor))?;
            f.write_str(match cause {
                CoarserCause::Extent => "31 bits do not hold the extent",
                CoarserCause::Doubles => "doubles as large as the coordinates are further apart",
            })?;
        }
        match self.enough {
            Some(factor) => {
                write!(f, "; made {} times coarser, because the requested precision needs no finer", Factor(factor))
            }
            None => Ok(()),
        }
    }
}

impl fmt::Display for LatticeReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = &self.axes;
        if x == y && y == z {
            return x.fmt(f);
        }
        write!(f, "x: {x}; y: {y}; z: {z}")
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
/// Why nothing of a dataset that scans were added to could be taken over. `Display` is for people.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum BuiltAnew {
    /// One new point may change all of such a dataset, or nobody has looked into it.
    Format,
    /// The dataset has no report, or that of another version or of other settings.
    OtherMaking,
    /// The root cube is another one.
    Cube,
    /// The coordinate step is another one.
    Step,
    /// The attributes differ, or are not stored as they are read.
    Attributes,
    /// The spacing of the root is another one.
    Spacing,
    /// Subtrees have another size, or too small leaves.
    Units,
    /// Looking into it would take more memory than there is.
    Memory,
    /// The dataset cannot be opened a second time.
    Unreadable,
    /// The new points touch every part.
    AllTouched,
}

impl fmt::Display for BuiltAnew {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Format => "in this format one new point may change all of it",
            Self::OtherMaking => "it was made by another version or with other settings",
            Self::Cube => "with the new points the root cube is another one",
            Self::Step => "with the new points the coordinate step is another one",
            Self::Attributes => {
                "with the new points its attributes are others, or they are not stored as they are read"
            }
            Self::Spacing => "with the new points the spacing of the root is another one",
            Self::Units => "its subtrees have another size, or its leaves are too small",
            Self::Memory => "looking into it takes more memory than there is",
            Self::Unreadable => "it cannot be opened a second time",
            Self::AllTouched => "the new points touch every part of it",
        })
    }
}

impl Serialize for BuiltAnew {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
