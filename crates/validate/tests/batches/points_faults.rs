//! Faults of points: their words, boxes, order, levels, colours and originals.

use pointmill_validate::{Check, Place};

use super::cloud::{BATCH, Cloud, Parts, assert_only, broken, good, terrain};

#[test]
fn plane_words_with_bits_30_and_31() {
    for plane in 0..3 {
        let mut parts = good();
        parts.words[plane][17] |= 1 << 31;
        parts.words[plane][18] |= 1 << 30;
        let outcome = parts.validate();
        assert_only(&outcome, Check::PlaneWords, 1);
        assert_eq!(outcome.problems[0].points, Some(2));
    }
}

#[test]
fn a_bit_of_a_position_that_flipped() {
    // bits of lo10 move a point by less than half a step: it is no lattice point's q any more
    for bit in [0, 9, 12, 25] {
        let mut parts = good();
        parts.words[2][BATCH + 3] ^= 1 << bit;
        let outcome = parts.validate();
        assert_only(&outcome, Check::Quantisation, 1);
        assert_eq!(outcome.problems[0].points, Some(1));
    }
    let mut parts = good();
    parts.words[0][BATCH + 3] ^= 1 << 9;
    assert!(broken(&parts.validate()).contains(&Check::Quantisation));
}

#[test]
fn a_box_that_is_loose_by_one_ulp() {
    for (axis, down, up) in [(0, 1, 0), (1, 0, 1), (2, 1, 0)] {
        let cloud = Cloud { loose: Some((1, axis, down, up)), ..terrain() };
        let outcome = cloud.parts().validate();
        assert_only(&outcome, Check::BatchBoxes, 1);
        assert_eq!(outcome.problems[0].node, Some(Place::Batch(1)));
    }
}

#[test]
fn two_points_of_a_batch_in_the_wrong_order() {
    let mut parts = good();
    // of level 3 both, so that nothing else depends on them; inside one cell of level 2, or cells would fall apart
    let cell = |p: &Parts, at: usize| {
        let x = p.lattice[at];
        [(x[0] + 5000) / 250, x[1] / 250, (x[2] + 5000) / 250]
    };
    let plain = |p: &Parts, at: usize| p.level(at) == 3 && p.level(at + 1) == 3;
    let at = (500..BATCH - 1).find(|at| {
        plain(&parts, *at) && cell(&parts, *at) == cell(&parts, *at + 1) && parts.lattice[*at] != parts.lattice[*at + 1]
    });
    let at = at.unwrap();
    parts.exchange(at, at + 1);
    let outcome = parts.validate();
    assert_only(&outcome, Check::StorageOrder, 1);
    assert_eq!(outcome.problems[0].points, Some(1));
}

#[test]
fn equal_positions_in_the_wrong_order_of_colour_or_attributes() {
    let mut cloud = terrain();
    let twin = cloud.points[40];
    cloud.points.push(super::cloud::Point { class: twin.class + 1, ..twin });
    let mut parts = cloud.parts();
    assert!(parts.validate().ok);
    let pair = parts.morton.windows(2).find(|w| parts.lattice[w[0]] == twin.x && parts.lattice[w[1]] == twin.x);
    let (a, b) = pair.map(|w| (w[0], w[1])).unwrap();
    assert_eq!((parts.level(a), parts.level(b)), (3, 3));
    parts.exchange(a, b);
    assert_only(&parts.validate(), Check::StorageOrder, 1);
}

#[test]
fn batches_that_are_not_swapped() {
    let mut parts = good();
    // slots 1 and 2 are Morton batches 2 and 1
    for i in 0..BATCH {
        parts.exchange(BATCH + i, 2 * BATCH + i);
    }
    parts.boxes.swap(1, 2);
    for (index, _) in &mut parts.originals {
        *index = match *index as usize / BATCH {
            1 => *index + BATCH as u32,
            2 => *index - BATCH as u32,
            _ => *index,
        };
    }
    parts.originals.sort_unstable();
    assert!(broken(&parts.validate()).contains(&Check::StorageOrder));
    parts.flags &= !1; // which is right without the flag
    let outcome = parts.validate();
    assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
}

/// A point of that level which is the candidate of no coarser cell.
fn of_level(parts: &Parts, level: u32) -> usize {
    (parts.points / 3..parts.points).find(|at| parts.level(*at) == level).unwrap()
}

#[test]
fn a_candidate_that_lost_its_level() {
    for level in 0..3 {
        let mut parts = good();
        let at = of_level(&parts, level);
        let own = match parts.originals.iter().position(|(index, _)| *index == at as u32) {
            Some(i) => parts.originals.remove(i).1,
            None => parts.colours[at] & 0xff_ffff, // alone in its cell
        };
        parts.colours[at] = own | 3 << 24;
        let outcome = parts.validate();
        assert_eq!(broken(&outcome), [Check::Levels], "{:#?}", outcome.problems);
        // the cells of its level and, as far as it is their candidate too, of finer ones
        assert!((1..=3 - u64::from(level)).contains(&outcome.check(Check::Levels).unwrap().found));
        assert!(outcome.problems[0].subject.contains(&at.to_string()));
    }
}

#[test]
fn a_level_of_a_point_that_is_not_the_nearest() {
    for level in 0..3 {
        let mut parts = good();
        let at = of_level(&parts, 3);
        let colour = parts.colours[at] & 0xff_ffff;
        parts.colours[at] = colour | level << 24;
        let outcome = parts.validate();
        assert_only(&outcome, Check::Levels, 1);
        assert!(outcome.problems[0].subject.contains(&at.to_string()), "{:#?}", outcome.problems);
    }
}

#[test]
fn a_level_above_3() {
    let mut parts = good();
    let at = of_level(&parts, 3);
    parts.colours[at] |= 4 << 24;
    assert_only(&parts.validate(), Check::Levels, 1);
}

#[test]
fn a_mean_colour_that_is_off_by_one() {
    for level in 0..3 {
        for channel in 0..3 {
            let mut parts = good();
            let at = of_level(&parts, level);
            parts.colours[at] ^= 1 << (8 * channel);
            assert_only(&parts.validate(), Check::Colours, 1);
        }
    }
}

#[test]
fn an_original_of_another_point() {
    let mut parts = good();
    let i = parts.originals.windows(2).position(|w| w[0].0 + 1 < w[1].0).unwrap();
    parts.originals[i].0 += 1;
    assert_only(&parts.validate(), Check::Originals, 1); // a point that shows its own colour has none
}

#[test]
fn originals_that_are_missing_out_of_order_or_out_of_range() {
    let mut parts = good();
    parts.originals.remove(5);
    assert_eq!(broken(&parts.validate()), [Check::Colours], "the averages do not come out");

    let mut parts = good();
    parts.originals.swap(5, 6);
    let outcome = parts.validate();
    assert_only(&outcome, Check::Originals, 1);
    assert!(outcome.check(Check::Colours).unwrap().skipped.is_some());

    let mut parts = good();
    parts.originals.last_mut().unwrap().0 = parts.points as u32;
    assert_only(&parts.validate(), Check::Originals, 1);
}

#[test]
fn an_original_colour_with_a_level() {
    let mut parts = good();
    parts.originals[9].1 |= 1 << 24;
    assert_only(&parts.validate(), Check::Originals, 1);
}
