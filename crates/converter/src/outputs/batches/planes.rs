//! How many planes of positions a file has.

use pointmill_format::batches::{BatchRecord, ErrorSums, Precision, f32_above, f32_below};

use super::frame::Frame;
use crate::cloud::Cloud;

/// The planes of a file whose points are known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Planes {
    /// `None`: as many as were requested.
    pub(super) needed: Option<Precision>,
    /// As many fewer than without a requested precision.
    pub(super) spared: u32,
}

/// The planes that are written at first; more are never needed.
pub(super) fn at_most(cloud: &Cloud<'_>, frame: &Frame, requested: Option<u8>) -> Precision {
    if let Some(planes) = requested {
        return Precision::from_bits(10 * u32::from(planes)).unwrap_or(Precision::Thirty);
    }
    // no batch is larger than the cloud
    let far = frame.grid.relative(frame.tight.max);
    let near = frame.grid.relative(frame.tight.min);
    let cube = BatchRecord { min: near.map(f32_below), first_point: 0, max: far.map(f32_above), points: 1 };
    // cells that are smaller than a requested precision have errors of half of it, the other half is that of the lattice
    let allowed = cloud.sources.tolerance.map_or([f64::INFINITY; 3], |tolerance| tolerance.total);
    let steps = std::array::from_fn(|a| frame.lattice.scale[a].min(allowed[a]));
    Precision::for_steps([&cube], steps)
}

/// The fewest planes that keep the requested precision; without one, those below which there is nothing but the step.
/// `errors`: what each number of planes does to positions on the lattice.
pub(super) fn needed(
    cloud: &Cloud<'_>,
    requested: Option<u8>,
    records: &[BatchRecord],
    step: [f64; 3],
    errors: &ErrorSums,
) -> Planes {
    if requested.is_some() {
        return Planes { needed: None, spared: 0 };
    }
    let Some(tolerance) = &cloud.sources.tolerance else {
        return Planes { needed: Some(Precision::for_steps(records, step)), spared: 0 };
    };
    let lattice = cloud.stats.change.max;
    let keeps = |planes: &Precision| {
        let format = errors.deviations(*planes).max;
        (0..3).all(|a| lattice[a] + format[a] <= tolerance.total[a])
    };
    let needed = Precision::ALL.into_iter().find(keeps).unwrap_or(Precision::Thirty);
    let factors = cloud.lattice.reason.axes.map(|axis| axis.enough.unwrap_or(1.0));
    let without = Precision::for_steps(records, std::array::from_fn(|a| step[a] / factors[a]));
    Planes { needed: Some(needed), spared: without.planes().saturating_sub(needed.planes()) }
}
