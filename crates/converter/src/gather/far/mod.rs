//! Points so far from all others that these lose precision: 31 bits then hold the distance and not the scene.
//!
//! The points are looked at once more, positions alone, and only where precision was lost. What cells of the partition
//! show ([`super::outliers`]) is too coarse for that: with one point at 1e18 all others share a cell.

mod spread;

use std::ops::ControlFlow;

use pointmill_format::{Aabb, PointBatch, Positions, Scan, Scratch, Wanted};

use self::spread::Spread;
use crate::error::ConvertError;
use crate::runtime::Runtime;
use crate::sources::Sources;

/// Points far from all others, and where these others are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FarPoints {
    /// At least as many.
    pub(super) points: u64,
    /// The box of all others, a little larger, in round numbers.
    pub(super) others: Aabb,
}

/// Looks for points far from all others. `cut`: only points inside are looked at; `enough`: the extent, by axis, that
/// costs no precision.
pub(super) fn find(
    sources: &Sources,
    cut: Option<&Aabb>,
    enough: [f64; 3],
    rt: &Runtime<'_>,
) -> Result<Option<FarPoints>, ConvertError> {
    let parts = rt.in_parallel(
        sources.pairs(),
        || (Default::default(), Recent::default(), Scratch::default()),
        |(spreads, recent, scratch): &mut ([Spread; 3], Recent, Scratch), unit| {
            let (source, pieces) = sources.pair(unit);
            let scan = sources.scan(source)?;
            for piece in pieces.clone() {
                scratch.next_piece = Some(piece + 1).filter(|next| pieces.contains(next));
                add_piece(&*scan, piece, cut, scratch, |p| {
                    if recent.is_new(p) {
                        spreads.iter_mut().zip(p).for_each(|(spread, v)| spread.add(v));
                    }
                });
            }
            Ok(())
        },
        |(spreads, _, _)| spreads,
    )?;
    let mut all: [Spread; 3] = Default::default();
    for part in parts {
        all.iter_mut().zip(part).for_each(|(a, b)| a.merge(b));
    }
    let mut others = Aabb::EMPTY;
    let mut points = 0;
    for a in 0..3 {
        let Some(trimmed) = all[a].trimmed(enough[a]) else { return Ok(None) };
        (others.min[a], others.max[a]) = (trimmed.min, trimmed.max);
        points = points.max(trimmed.points);
    }
    let is_one_place = others.min == others.max;
    Ok((points > 0 && !is_one_place).then(|| FarPoints { points, others: rounded_outwards(&others) }))
}

/// Places that were seen lately, one for each hash: a mass of points in one place counts about once.
struct Recent(Vec<[u64; 3]>);

/// Places that are remembered.
const RECENT: usize = 4096;

impl Default for Recent {
    fn default() -> Self {
        Self(vec![[u64::MAX; 3]; RECENT])
    }
}

impl Recent {
    fn is_new(&mut self, p: [f64; 3]) -> bool {
        let bits = p.map(f64::to_bits);
        let hash = bits.iter().fold(0u64, |h, b| (h ^ b).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29));
        let place = &mut self.0[hash as usize % RECENT];
        std::mem::replace(place, bits) != bits
    }
}

/// Pieces that cannot be decoded were reported when the points were read.
fn add_piece(scan: &dyn Scan, piece: usize, cut: Option<&Aabb>, scratch: &mut Scratch, mut take: impl FnMut([f64; 3])) {
    let wanted = Wanted::positions(scan.info());
    let _ = scan.decode(piece, &wanted, scratch, &mut |batch: &PointBatch| {
        let lattice = scan.info().lattice;
        for i in 0..batch.len() {
            let p: [f64; 3] = std::array::from_fn(|a| match (&batch.positions, &lattice) {
                (Positions::Quantized(q), Some(l)) => f64::from(q[a][i]) * l.scale[a] + l.offset[a],
                (Positions::Quantized(q), None) => f64::from(q[a][i]),
                (Positions::World(w), _) => w[a][i],
            });
            if p.iter().all(|v| v.is_finite()) && cut.is_none_or(|cut| cut.contains(p)) {
                take(p);
            }
        }
        ControlFlow::Continue(())
    });
}

/// The box with numbers of few digits: a thousandth of its longest side is the last one.
fn rounded_outwards(b: &Aabb) -> Aabb {
    let longest = b.extent().into_iter().fold(0.0, f64::max);
    let decimals = if longest > 0.0 { (3.0 - longest.log10().floor()).clamp(0.0, 15.0) as usize } else { 3 };
    let grain = 10f64.powi(-(decimals as i32));
    let tidy = |v: f64| format!("{v:.decimals$}").parse().unwrap_or(v);
    let down = |v: f64| tidy((v / grain).floor() * grain).min(v);
    let up = |v: f64| tidy((v / grain).ceil() * grain).max(v);
    Aabb { min: b.min.map(down), max: b.max.map(up) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_rounded_outwards_to_few_digits() {
        let b = Aabb { min: [345_678.123, -0.1, 13.4], max: [346_678.9, 900.0, 13.4] };
        assert_eq!(rounded_outwards(&b), Aabb { min: [345_678.0, -1.0, 13.0], max: [346_679.0, 900.0, 14.0] });
        let degrees = Aabb { min: [13.012_345, 52.0, 0.0], max: [13.032_345, 52.01, 0.0] };
        assert_eq!(rounded_outwards(&degrees).min[0], 13.012_34);
    }
}
