//! A requested precision in the units of the coordinates.

use std::f64::consts::FRAC_PI_2;

use pointmill_format::Unit;

use super::crs::ResolvedCrs;
use super::degrees::metres_per_radian;
use crate::plan::{Plan, PlanError, PlanFault, PositionPrecision, ScaleChoice, Setting};

/// The part of it that the lattice may take where formats add errors of their own.
const SHARED: f64 = 0.5;

/// The largest errors that coordinates may have, by axis, world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Tolerance {
    /// What a reader of a dataset decodes, against the scan.
    pub(crate) total: [f64; 3],
    /// What the lattice of the run may do of it.
    pub(crate) lattice: [f64; 3],
}

impl Tolerance {
    /// What the plan requests; `None`: it does not. `keeps_lattice`: all outputs hold points of the lattice as they are.
    ///
    /// # Errors
    /// A length in a unit where that of the coordinates is unknown.
    pub(crate) fn of(plan: &Plan, crs: &ResolvedCrs, keeps_lattice: bool) -> Result<Option<Self>, PlanError> {
        let ScaleChoice::Within(precision) = plan.scale else { return Ok(None) };
        let total = by_axis(precision, crs)?;
        let share = if keeps_lattice { 1.0 } else { SHARED };
        Ok(Some(Self { total, lattice: total.map(|allowed| allowed * share) }))
    }
}

/// The precision on each axis, world units.
fn by_axis(precision: PositionPrecision, crs: &ResolvedCrs) -> Result<[f64; 3], PlanError> {
    let Some(metres) = precision.unit.metres().map(|unit| precision.length * unit) else {
        return Ok([precision.length; 3]);
    };
    let length = |unit: Option<Unit>| unit.and_then(Unit::metres);
    match crs.unit {
        // heights are in the unit of the plane unless they say another
        Some(Unit::Length(unit)) => {
            let height = length(crs.vertical_unit).unwrap_or(unit);
            Ok([unit, unit, height].map(|unit| metres / unit))
        }
        // nowhere on the Earth degrees are longer
        Some(Unit::Angle(radians)) => {
            let [east, north] = metres_per_radian([0.0, FRAC_PI_2]).map(|of_radian| metres / (of_radian * radians));
            Ok([east, north, metres / length(crs.vertical_unit).unwrap_or(1.0)])
        }
        _ => Err(PlanError::new(Setting::Precision, PlanFault::UnknownUnit)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::LengthUnit;

    fn tolerance(unit: Option<Unit>, vertical_unit: Option<Unit>) -> Result<[f64; 3], PlanError> {
        let mut crs = ResolvedCrs::default();
        (crs.unit, crs.vertical_unit) = (unit, vertical_unit);
        by_axis(PositionPrecision { length: 1.0, unit: LengthUnit::Centimetre }, &crs)
    }

    #[test]
    fn lengths_become_units_of_each_axis() {
        let (metre, foot) = (Some(Unit::Length(1.0)), Some(Unit::Length(0.3048)));
        assert_eq!(tolerance(metre, None).unwrap(), [0.01; 3]);
        assert_eq!(tolerance(metre, foot).unwrap(), [0.01, 0.01, 0.01 / 0.3048]);
        assert_eq!(tolerance(foot, None).unwrap(), [0.01 / 0.3048; 3]);
        let degree = Some(Unit::Angle(1f64.to_radians()));
        assert_eq!(tolerance(degree, foot).unwrap()[2], 0.01 / 0.3048);
        let degrees = tolerance(degree, None).unwrap();
        let centimetres = [111_319.491 * 100.0, 111_693.980 * 100.0, 100.0];
        for (found, per_unit) in degrees.iter().zip(centimetres) {
            assert!((found * per_unit - 1.0).abs() < 1e-8, "{degrees:?}");
        }
    }

    #[test]
    fn a_length_of_unknown_coordinates_is_refused_and_a_number_is_theirs() {
        for unit in [None, Some(Unit::Unknown)] {
            assert_eq!(tolerance(unit, None).unwrap_err().fault, PlanFault::UnknownUnit);
        }
        let number = PositionPrecision { length: 0.25, unit: LengthUnit::Coordinates };
        assert_eq!(by_axis(number, &ResolvedCrs::default()).unwrap(), [0.25; 3]);
    }

    #[test]
    fn formats_with_errors_of_their_own_get_half() {
        let mut plan = Plan::new(Vec::new(), "out".into());
        assert_eq!(Tolerance::of(&plan, &ResolvedCrs::default(), true).unwrap(), None);
        plan.scale = ScaleChoice::Within(PositionPrecision { length: 2.0, unit: LengthUnit::Coordinates });
        let of = |keeps| Tolerance::of(&plan, &ResolvedCrs::default(), keeps).unwrap().unwrap();
        assert_eq!((of(true).lattice, of(false).lattice, of(false).total), ([2.0; 3], [1.0; 3], [2.0; 3]));
    }
}
