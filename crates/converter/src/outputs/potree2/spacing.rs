//! The distance between points in the root, of which each level has half of the one above.

use serde_json::{Value, json};

use super::Potree2Settings;
use crate::cloud::Cloud;
use crate::error::ConvertError;
use crate::octree::{Sampling, Spacing};
use crate::plan::{PlanError, PlanFault, Setting};

/// A spacing, and why it was chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ChosenSpacing {
    pub(super) spacing: Spacing,
    /// World units, in the root.
    pub(super) root: f64,
    is_requested: bool,
}

impl ChosenSpacing {
    /// As it is requested, or the usual part of the cube's side.
    ///
    /// # Errors
    /// A request that the tree cannot keep.
    pub(super) fn of(settings: &Potree2Settings, cloud: &Cloud<'_>) -> Result<Self, ConvertError> {
        let side = cloud.frame.cube.side;
        let Some(requested) = settings.spacing else { return Ok(Self::new(Spacing::default(), side, false)) };
        let (coarsest, finest) = Spacing::DIVISORS.into_inner();
        let (least, most) = (side / finest, side / coarsest);
        if !(least..=most).contains(&requested) {
            return Err(PlanError::new(Setting::Spacing, PlanFault::NotBetween { least, most }).into());
        }
        let divisor = side / requested;
        let divisor = match settings.sampling {
            Sampling::Poisson => divisor,
            // cells of a grid are a power of two: no finer than requested
            Sampling::Grid | Sampling::Random { .. } => 2f64.powi(divisor.log2().floor() as i32),
        };
        Ok(Self::new(Spacing::new(divisor), side, true))
    }

    fn new(spacing: Spacing, side: f64, is_requested: bool) -> Self {
        Self { spacing, root: side / spacing.divisor(), is_requested }
    }

    /// For the report.
    pub(super) fn describe(&self) -> Value {
        let reason = if self.is_requested {
            "requested"
        } else {
            "usual: a surface across the cube then has 10,000 to 25,000 points in the root"
        };
        json!({ "root": self.root, "per_side": self.spacing.divisor(), "reason": reason })
    }
}
