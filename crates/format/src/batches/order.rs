//! Where batches stand (`docs/formats/batches.md`, §3).

use super::BATCH_POINTS;

/// Batches that hold `points` points: rounded up, 0 without points.
///
/// Saturates at `u32::MAX`, far above what [`super::MAX_POINTS`] points need.
pub fn batch_count(points: u64) -> u32 {
    u32::try_from(points.div_ceil(u64::from(BATCH_POINTS))).unwrap_or(u32::MAX)
}

/// Points of batch (or slot) `i` of a file of `points` points: full but for the last; 0 past the end.
pub fn batch_points(i: u32, points: u64) -> u32 {
    let first = u64::from(i) * u64::from(BATCH_POINTS);
    points.saturating_sub(first).min(u64::from(BATCH_POINTS)) as u32
}

/// The slot of Morton batch `i` of `batches`, and the Morton batch in slot `i`: the function undoes itself.
///
/// Batches at odd places left of the middle change with their mirrors; the first and the last stay. `i` outside
/// `0..batches` stays as well.
pub const fn swap_slot(i: u32, batches: u32) -> u32 {
    if i >= batches {
        return i;
    }
    let mirror = batches - 1 - i;
    let left = if i < mirror { i } else { mirror };
    if left % 2 == 1 && i != mirror { mirror } else { i }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The loop of the article, cut off at the middle.
    fn by_exchanges(batches: u32) -> Vec<u32> {
        let mut slots: Vec<u32> = (0..batches).collect();
        let mut i = 1;
        while i + i + 1 < batches {
            slots.swap(i as usize, (batches - 1 - i) as usize);
            i += 2;
        }
        slots
    }

    #[test]
    fn slots_are_those_of_the_exchanges_and_undo_themselves() {
        for batches in 0..200 {
            let slots: Vec<u32> = (0..batches).map(|i| swap_slot(i, batches)).collect();
            assert_eq!(slots, by_exchanges(batches), "{batches}");
            assert!(slots.iter().enumerate().all(|(i, s)| swap_slot(*s, batches) == i as u32));
            assert!(batches == 0 || slots.last() == Some(&(batches - 1)), "a partial batch stays last");
        }
        assert_eq!(by_exchanges(9), [0, 7, 2, 5, 4, 3, 6, 1, 8]);
    }

    #[test]
    fn batches_hold_all_points_and_only_the_last_is_partial() {
        for points in [0, 1, 10_239, 10_240, 10_241, 30_720, u64::from(u32::MAX)] {
            let batches = batch_count(points);
            let sum: u64 = (0..batches).map(|i| u64::from(batch_points(i, points))).sum();
            assert_eq!(sum, points);
            assert!(batches == 0 || batch_points(batches - 1, points) > 0);
            assert_eq!(batch_points(batches, points), 0);
        }
    }
}
