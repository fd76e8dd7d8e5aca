//! What other programs wrote. Skipped where the corpus is not at hand.

use pointmill_testkit::files::{corpus, fixture};
use pointmill_validate::{Check, Options, validate};

/// From before the reference lost count of leaves.
#[test]
fn the_lion_is_right() {
    let Some(folder) = corpus("potree1/lion_takanawa") else { return };
    let outcome = validate(&folder, &Options::default(), &|_| {}).unwrap();
    assert_eq!(outcome.nodes, 167);
    assert_eq!(outcome.check(Check::NodeCounts).map(|c| (c.checked, c.found)), Some((167, 0)));
    assert_eq!(outcome.check(Check::Boxes).map(|c| (c.checked, c.found)), Some((272_768, 0)));
    let broken: Vec<_> = outcome.checks.iter().filter(|c| !c.ok).map(ToString::to_string).collect();
    assert!(broken.is_empty(), "{broken:#?}, {:#?}", outcome.problems);
}

#[test]
fn wrong_counts_of_leaves_are_found() {
    let outcome = validate(&fixture("potree1/words"), &Options::default(), &|_| {}).unwrap();
    assert_eq!(outcome.check(Check::NodeCounts).map(|c| (c.checked, c.found)), Some((7, 2)));
    assert_eq!(outcome.check(Check::IndexFiles).map(|c| (c.checked, c.found)), Some((3, 0)));
    let broken: Vec<_> = outcome.checks.iter().filter(|c| !c.ok).map(|c| c.name).collect();
    // so few points cover nothing
    assert_eq!(broken, [Check::NodeCounts, Check::Coverage], "{:#?}", outcome.problems);
}
