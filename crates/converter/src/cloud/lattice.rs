//! The lattice of a run, and why it is that one.

use pointmill_format::Lattice;

use crate::reason::LatticeReason;

/// The lattice of a run.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct JobLattice {
    pub(crate) lattice: Lattice,
    pub(crate) reason: LatticeReason,
    /// Which steps it may take when it must become coarser.
    pub(crate) steps: Steps,
}

impl JobLattice {
    /// True if the extent of the cloud decided the step.
    pub(crate) fn is_held_back(&self) -> bool {
        self.steps == Steps::Decimal || self.reason.coarser.is_some()
    }

    /// The lattice with a step at least `factor` times as coarse.
    #[must_use]
    pub(crate) fn coarsened(&self, factor: f64) -> Self {
        let before = self.lattice.scale[0];
        let mut coarser = self.clone();
        coarser.lattice.scale = self.lattice.scale.map(|s| self.steps.coarsen(s, factor));
        let made = (coarser.lattice.scale[0] / before).round();
        coarser.reason.coarser = Some(made * self.reason.coarser.unwrap_or(1.0));
        coarser
    }
}

/// Which steps a lattice may take when it must become coarser.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Steps {
    /// Powers of two of the present one, so that coordinates of integer sources stay as near as they can.
    Doubled,
    /// Powers of ten, so that decimal coordinates stay exact.
    Decimal,
}

impl Steps {
    /// A step at least `factor` times as coarse.
    fn coarsen(self, step: f64, factor: f64) -> f64 {
        match self {
            Self::Doubled => step * factor,
            Self::Decimal => {
                let mut times = 1.0;
                while times < factor {
                    times *= 10.0;
                }
                tidy(step * times)
            }
        }
    }
}

/// The nearest double with few decimal digits, if there is one within rounding.
fn tidy(step: f64) -> f64 {
    format!("{step:.12e}").parse().ok().filter(|t: &f64| ((t - step) / step).abs() < 1e-13).unwrap_or(step)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reason::LatticeBasis;

    #[test]
    fn coarser_decimal_steps_stay_decimal() {
        assert_eq!(Steps::Decimal.coarsen(1e-6, 2.0), 1e-5);
        assert_eq!(Steps::Decimal.coarsen(1e-6, 64.0), 1e-4);
        assert_eq!(Steps::Doubled.coarsen(0.5, 4.0), 2.0);
    }

    #[test]
    fn a_lattice_made_coarser_twice_is_held_back_and_says_by_how_much() {
        let reason = LatticeReason { basis: LatticeBasis::Sources, coarser: None };
        let lattice = Lattice { scale: [0.01; 3], offset: [0.0; 3] };
        let fine = JobLattice { lattice, reason, steps: Steps::Doubled };
        assert!(!fine.is_held_back());
        let coarse = fine.coarsened(2.0).coarsened(4.0);
        assert!(coarse.is_held_back());
        assert_eq!(coarse.lattice.scale, [0.08; 3]);
        assert!(coarse.reason.to_string().contains("made 8 times coarser"), "{}", coarse.reason);
    }
}
