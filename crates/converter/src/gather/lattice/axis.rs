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

#[cfg(test)]
mod tests {
    use super::*;

    fn of(step: f64, origin: GridOrigin) -> Need {
        Need::Grid { grid: AxisGrid { step, offset: 0.0 }, origin }
    }

    const ALL: Room = Room { wished: 0.0, certain: 0.0, doubles: 0.0 };

    #[test]
    fn parts_are_the_most_powers_of_ten_that_are_asked_for() {
        let cases = [(0.001, 0.0001), (0.001, 0.000_11), (0.001, 0.001), (0.3, 0.03), (0.3, 0.003), (1.0, 2e-5)];
        assert_eq!(cases.map(|(step, wanted)| parts_of(step, wanted)), [10.0, 1.0, 1.0, 10.0, 100.0, 1e4]);
        assert_eq!([parts_of(1.0, 1e-9), parts_of(1.0, 1e-10), parts_of(1.0, 0.0)], [1e9, 1e9, 1.0]);
    }

    #[test]
    fn room_is_what_integers_and_doubles_leave() {
        let reach = |extent, farthest| Reach { extent, farthest };
        let by_extent = Room::new(reach(4.0 * MOST_STEPS, 8.0), reach(MOST_STEPS, 1.0));
        assert_eq!(by_extent, Room { wished: 4.0, certain: 1.0, doubles: 2f64.powi(-51) });
        let by_doubles = Room::new(reach(1.0, 2f64.powi(60)), reach(1.0, 2f64.powi(53)));
        assert_eq!(by_doubles, Room { wished: 512.0, certain: 4.0, doubles: 4.0 });
        let of = |min, max| Reach::of(&Aabb { min: [min; 3], max: [max; 3] }, 1);
        assert_eq!([of(-3.0, 1.0), of(-1.0, 3.0), of(2.0, 1.0)], [reach(4.0, 3.0), reach(4.0, 3.0), reach(0.0, 0.0)]);
    }

    #[test]
    fn grids_give_their_step_and_the_reason() {
        let chosen = |needs: &[Need], room| {
            let c = choose(needs, room);
            (c.grid.step, c.reason.basis, [c.is_prescribed, c.is_free, c.holds_all])
        };
        let origins = [
            (GridOrigin::Lattice, LatticeBasis::Sources, [true, false, true]),
            (GridOrigin::Divisor, LatticeBasis::Divisor, [true, false, false]),
            (GridOrigin::Stated, LatticeBasis::StoredStep, [false; 3]),
            (GridOrigin::Decimals, LatticeBasis::Decimals, [false; 3]),
        ];
        for (origin, basis, flags) in origins {
            assert_eq!(chosen(&[of(0.01, origin)], ALL), (0.01, basis, flags));
        }
        let [lattice, decimals] = [GridOrigin::Lattice, GridOrigin::Decimals];
        let two = [of(0.01, lattice), of(0.001, lattice)];
        assert_eq!(chosen(&two, ALL), (0.001, LatticeBasis::Common, [true, false, true]));
        let kinds = [of(0.01, lattice), of(0.01, decimals)];
        assert_eq!(chosen(&kinds, ALL), (0.01, LatticeBasis::Common, [true, false, false]));
        let none = [of(0.1, lattice), of(1.0 / 3.0, lattice)];
        assert_eq!(chosen(&none, ALL), (0.1, LatticeBasis::FinestOfSources, [true, false, false]));
        // one that is common to both is finer than either: there must be room for it
        let between = [of(0.01, lattice), of(0.025, lattice)];
        assert_eq!(chosen(&between, ALL).0, 0.005);
        assert_eq!(chosen(&between, Room { wished: 0.005, ..ALL }).0, 0.005);
        assert_eq!(chosen(&between, Room { wished: 0.006, ..ALL }).0, 0.01);
    }

    #[test]
    fn others_that_resolve_more_make_it_a_part_and_extents_make_it_coarser() {
        let own = of(0.01, GridOrigin::Lattice);
        let step = |others: &[Need], room| choose(&[&[own], others].concat(), room).grid.step;
        assert_eq!(step(&[Need::Step(0.001)], ALL), 0.001);
        assert_eq!(step(&[Need::Step(0.1)], ALL), 0.01);
        assert_eq!(choose(&[own, Need::Step(0.1)], ALL).reason.basis, LatticeBasis::Sources, "one part is no part");
        assert_eq!(step(&[Need::Finest], Room { wished: 2e-6, ..ALL }), 0.01 / 1000.0);
        assert_eq!(step(&[Need::Finest, Need::Step(0.1)], Room { wished: 2e-6, ..ALL }), 0.01 / 1000.0);
        assert_eq!(step(&[Need::Single { step: 0.0001, farthest: 1.0 }], Room { wished: 2e-6, ..ALL }), 0.0001);
        let part = choose(&[own, Need::Step(0.001)], ALL);
        assert_eq!((part.reason.basis, part.holds_all), (LatticeBasis::PartOfFinest, false));
        let coarser = |certain, doubles| {
            let c = choose(&[own], Room { certain, doubles, ..ALL });
            (c.grid.step, c.reason.coarser.map(|c| (c.factor, c.cause)), c.holds_all)
        };
        assert_eq!(coarser(0.01, 0.01), (0.01, None, true));
        assert_eq!(coarser(0.015, 0.01), (0.02, Some((2.0, CoarserCause::Extent)), false));
        assert_eq!(coarser(0.04, 0.04), (0.05, Some((5.0, CoarserCause::Doubles)), false));
    }

    #[test]
    fn without_grids_steps_are_what_is_resolved_or_what_there_is_room_for() {
        let chosen = |needs: &[Need], wished| {
            let c = choose(needs, Room { wished, ..ALL });
            (c.grid.step, c.reason.basis, c.is_free)
        };
        let single = Need::Single { step: 2f64.powi(-10), farthest: 5000.0 };
        let basis = LatticeBasis::SinglePrecision { farthest: 5000.0 };
        assert_eq!(chosen(&[single, Need::Nothing], 0.0), (2f64.powi(-10), basis, false));
        assert_eq!(chosen(&[single], 2f64.powi(-10)), (2f64.powi(-10), basis, false));
        assert_eq!(chosen(&[single], 0.3), (0.5, LatticeBasis::PowerOfTwo, false));
        assert_eq!(chosen(&[single, Need::Step(0.25)], 0.0), (2f64.powi(-10), LatticeBasis::StoredStep, false));
        assert_eq!(chosen(&[Need::Step(0.25)], 0.25), (0.25, LatticeBasis::StoredStep, false));
        assert_eq!(chosen(&[Need::Step(0.25)], 0.3), (0.5, LatticeBasis::Decimal, false));
        assert_eq!(chosen(&[Need::Finest], 3e-7), (5e-7, LatticeBasis::Decimal, false));
        assert_eq!(chosen(&[Need::Finest], 0.0), (USUAL_STEP, LatticeBasis::Usual, false));
        assert_eq!([0.0, 3e-7, 3.0].map(|wished| chosen(&[], wished).0), [USUAL_STEP, 5e-7, USUAL_STEP]);
        assert_eq!(chosen(&[Need::Nothing], 0.0), (USUAL_STEP, LatticeBasis::Usual, true));
    }
}
