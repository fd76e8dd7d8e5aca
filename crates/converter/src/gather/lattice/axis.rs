//! The step of one axis.

use pointmill_format::{Aabb, AxisGrid};

use super::steps::{least, one_two_five, power_of_two, times_coarser};
use crate::cloud::MOST_STEPS;
use crate::reason::{AxisReason, Coarser, CoarserCause, LatticeBasis};
use crate::sources::tidy_product;

/// The step where nothing at all is known of the coordinates, world units.
const USUAL_STEP: f64 = 0.001;

/// A step this many times below the finest of the sources is no longer worth its bits.
const FINEST_PART: f64 = 1e9;

/// What one source asks of an axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Need {
    /// These coordinates.
    Grid { grid: AxisGrid, origin: GridOrigin },
    /// No finer step than this.
    Step(f64),
    /// The same, of single precision whose largest coordinate this is.
    Single { step: f64, farthest: f64 },
    /// As fine as there is room.
    Finest,
    /// Nothing: all coordinates are zero, or there are none.
    Nothing,
}

/// What a grid comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum GridOrigin {
    /// The integers of the file.
    Lattice,
    /// What these integers have in common.
    Divisor,
    /// What the file states of world coordinates.
    Stated,
    /// The decimals of world coordinates.
    Decimals,
}

/// The least steps that the coordinates allow, world units; 0: any.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Room {
    /// For a step that is chosen: by all that is declared or sampled.
    pub(super) wished: f64,
    /// For a step that sources prescribe: by what is certain.
    pub(super) certain: f64,
    /// Doubles as large as the coordinates.
    pub(super) doubles: f64,
}

/// Extent and largest coordinate of an axis.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Reach {
    pub(super) extent: f64,
    pub(super) farthest: f64,
}

impl Reach {
    /// Of the points in a box; nothing if it is empty.
    pub(super) fn of(bounds: &Aabb, axis: usize) -> Self {
        if bounds.is_empty() {
            return Self::default();
        }
        let (min, max) = (bounds.min[axis], bounds.max[axis]);
        Self { extent: max - min, farthest: min.abs().max(max.abs()) }
    }
}

impl Room {
    /// `all`: by everything that is declared or sampled; `certain`: by what no header can lie about.
    pub(super) fn new(all: Reach, certain: Reach) -> Self {
        let doubles = least(certain.farthest);
        Self {
            wished: (all.extent / MOST_STEPS).max(least(all.farthest)),
            certain: (certain.extent / MOST_STEPS).max(doubles),
            doubles,
        }
    }
}

/// The step and one coordinate of an axis, and why.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AxisChoice {
    pub(super) grid: AxisGrid,
    pub(super) reason: AxisReason,
    /// Sources prescribe it as integers.
    pub(super) is_prescribed: bool,
    /// No source asks for a step.
    pub(super) is_free: bool,
    /// All coordinates are points of the grid, and no sample vouches for it.
    pub(super) holds_all: bool,
}

/// The step for these needs.
pub(super) fn choose(needs: &[Need], room: Room) -> AxisChoice {
    let grids: Vec<(AxisGrid, GridOrigin)> = needs
        .iter()
        .filter_map(|n| match n {
            Need::Grid { grid, origin } => Some((*grid, *origin)),
            _ => None,
        })
        .collect();
    let fineness = |n: &Need| match n {
        Need::Step(step) | Need::Single { step, .. } => Some(*step),
        Need::Finest => Some(0.0),
        Need::Grid { .. } | Need::Nothing => None,
    };
    let wanted = needs.iter().filter_map(fineness).reduce(f64::min);
    match (grids.is_empty(), wanted) {
        (true, None) => {
            let step = if room.wished > 0.0 { one_two_five(room.wished.max(f64::MIN_POSITIVE)) } else { USUAL_STEP };
            AxisChoice { is_free: true, ..plain(step.min(USUAL_STEP), LatticeBasis::Usual) }
        }
        (true, Some(wanted)) => without_grid(needs, wanted, room),
        (false, wanted) => with_grids(&grids, wanted, room),
    }
}

fn plain(step: f64, basis: LatticeBasis) -> AxisChoice {
    AxisChoice {
        grid: AxisGrid { step, offset: 0.0 },
        reason: AxisReason { basis, coarser: None, enough: None },
        is_prescribed: false,
        is_free: false,
        holds_all: false,
    }
}

/// No source has a grid.
fn without_grid(needs: &[Need], wanted: f64, room: Room) -> AxisChoice {
    let farthest = needs.iter().filter_map(|n| match n {
        Need::Single { farthest, .. } => Some(*farthest),
        _ => None,
    });
    let farthest = farthest.fold(0.0, f64::max);
    let are_single = needs.iter().all(|n| matches!(n, Need::Single { .. } | Need::Nothing));
    match (are_single, wanted >= room.wished && wanted > 0.0) {
        (true, true) => plain(wanted, LatticeBasis::SinglePrecision { farthest }),
        // powers of two lose nothing of what single precision holds beyond them
        (true, false) => plain(power_of_two(room.wished), LatticeBasis::PowerOfTwo),
        (false, true) => plain(wanted, LatticeBasis::StoredStep),
        (false, false) if room.wished > 0.0 => plain(one_two_five(room.wished), LatticeBasis::Decimal),
        (false, false) => plain(USUAL_STEP, LatticeBasis::Usual),
    }
}

/// Some sources have grids. `wanted`: the finest step of the others.
fn with_grids(grids: &[(AxisGrid, GridOrigin)], wanted: Option<f64>, room: Room) -> AxisChoice {
    let mut all: Vec<AxisGrid> = grids.iter().map(|(grid, _)| *grid).collect();
    all.sort_by(|a, b| a.step.total_cmp(&b.step).then(a.offset.total_cmp(&b.offset)));
    let Some(&finest) = all.first() else { return plain(USUAL_STEP, LatticeBasis::Usual) };
    let common = AxisGrid::common(&all).filter(|c| c.step >= finest.step || c.step >= room.wished);
    let mut grid = common.unwrap_or(finest);
    let basis_of = |origin| match origin {
        GridOrigin::Lattice => LatticeBasis::Sources,
        GridOrigin::Divisor => LatticeBasis::Divisor,
        GridOrigin::Stated => LatticeBasis::StoredStep,
        GridOrigin::Decimals => LatticeBasis::Decimals,
    };
    let are_equal = grids.iter().all(|(g, origin)| g.step == grid.step && *origin == grids[0].1);
    let mut basis = match common {
        Some(_) if are_equal => basis_of(grids[0].1),
        Some(_) => LatticeBasis::Common,
        None => LatticeBasis::FinestOfSources,
    };
    if let Some(wanted) = wanted {
        let parts = parts_of(grid.step, wanted.max(room.wished));
        if parts > 1.0 {
            grid.step /= parts;
            basis = LatticeBasis::PartOfFinest;
        }
    }
    let factor = times_coarser(room.certain / grid.step);
    let coarser = (factor > 1.0).then(|| {
        let cause = if room.doubles >= room.certain { CoarserCause::Doubles } else { CoarserCause::Extent };
        grid.step = tidy_product(grid.step, factor);
        Coarser { factor, cause }
    });
    let is_prescribed = grids.iter().any(|(_, o)| matches!(o, GridOrigin::Lattice | GridOrigin::Divisor));
    let are_integers = grids.iter().all(|(_, o)| *o == GridOrigin::Lattice);
    let holds_all = are_integers && common.is_some() && wanted.is_none() && coarser.is_none();
    let reason = AxisReason { basis, coarser, enough: None };
    AxisChoice { grid, reason, is_prescribed, is_free: false, holds_all }
}

/// The largest power of ten by which a step can be divided so that it stays at least `wanted`.
fn parts_of(step: f64, wanted: f64) -> f64 {
    let mut parts = 1.0;
    while wanted > 0.0 && step / (parts * 10.0) >= wanted * (1.0 - 1e-12) && parts < FINEST_PART {
        parts *= 10.0;
    }
    parts
}
