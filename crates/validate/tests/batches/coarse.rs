//! Files whose planes do not determine the lattice integers: what is certain is checked, the rest is reported.

use pointmill_validate::{Check, Severity};

use super::cloud::{BATCH, Cloud, Parts, broken, terrain};

/// One plane: cells of about 5 steps.
fn coarse() -> Parts {
    Cloud { planes: 1, ..terrain() }.parts()
}

#[test]
fn a_plane_that_was_needed_is_a_warning_and_what_it_hides_is_said() {
    let outcome = coarse().validate();
    assert!(outcome.ok, "{:#?}", outcome.problems);
    assert_eq!(outcome.problems.iter().map(|p| p.severity).collect::<Vec<_>>(), [Severity::Warning]);
    for check in [Check::Errors, Check::TightBox, Check::Levels, Check::Colours, Check::StorageOrder] {
        assert!(outcome.check(check).unwrap().skipped.is_some(), "{}", check.name());
    }
}

#[test]
fn a_plane_that_was_not_needed_is_not_missed() {
    let outcome = Cloud { planes: 2, ..terrain() }.parts().validate();
    assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
    assert!(outcome.check(Check::Levels).unwrap().skipped.is_none());
}

#[test]
fn coarse_boxes_and_order_are_checked_to_within_a_cell() {
    // by 1 cm, two cells
    let loose = Cloud { planes: 1, loose: Some((1, 0, 0, 20_000)), ..terrain() };
    assert_eq!(broken(&loose.parts().validate()), [Check::BatchBoxes]);
    let mut parts = coarse();
    parts.exchange(BATCH + 10, BATCH + 5000);
    assert!(broken(&parts.validate()).contains(&Check::StorageOrder));
}

/// Cells of the order that are larger than those of the planes: the code of a point is certain, its integers are not.
#[test]
fn points_of_one_code_are_not_put_in_an_order_that_nothing_tells() {
    for cell in [1e5, 1e7] {
        let cloud = Cloud { planes: 1, cell, ..terrain() };
        let outcome = cloud.parts().validate();
        assert!(outcome.ok, "{:#?}", outcome.problems);
        let mut parts = cloud.parts();
        parts.exchange(10, 2 * BATCH + 5000);
        assert_eq!(broken(&parts.validate()).contains(&Check::StorageOrder), cell < 1e6, "far apart, where codes tell");
    }
}

#[test]
fn a_step_that_is_finer_than_30_bits_is_said_too() {
    let mut cloud = terrain();
    cloud.points.truncate(500);
    cloud.points.iter_mut().for_each(|p| p.x = p.x.map(|v| v * 1_000_000));
    cloud.scale = 1e-9;
    cloud.offset = [0.0; 3];
    let outcome = cloud.parts().validate();
    assert!(outcome.ok && outcome.problems.is_empty(), "{:#?}", outcome.problems);
    assert!(outcome.check(Check::Levels).unwrap().skipped.is_some());
}
