//! Units of work: consecutive pieces of a source, about as many points in each.

use std::ops::Range;

use crate::sources::Sources;

/// Points of a unit, where pieces are smaller than that.
const POINTS: u64 = 200_000;

/// The units of all sources.
pub(super) struct Units {
    /// By source: the number of its first unit, and pieces of a unit.
    of: Vec<(u64, u32)>,
    count: usize,
}

impl Units {
    pub(super) fn of(sources: &Sources) -> Self {
        let mut count = 0u64;
        let of = sources.all.iter().map(|source| {
            let pieces = u64::from(source.pieces);
            let each = (source.points_declared / pieces.max(1)).max(1);
            // two consecutive pieces take less time in some formats
            let together = (POINTS / each).clamp(2, 4096) & !1;
            let first = count;
            count += pieces.div_ceil(together);
            (first, together as u32)
        });
        let of = of.collect();
        Self { of, count: count as usize }
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// The source of a unit and its pieces.
    pub(super) fn get(&self, unit: usize, sources: &Sources) -> (usize, Range<usize>) {
        // sources without pieces begin where the next one does
        let source = self.of.partition_point(|(first, _)| *first <= unit as u64).saturating_sub(1);
        let Some((first, together)) = self.of.get(source) else { return (source, 0..0) };
        let start = (unit as u64).saturating_sub(*first) * u64::from(*together);
        let end = (start + u64::from(*together)).min(u64::from(sources.all[source].pieces));
        (source, start as usize..end as usize)
    }
}
