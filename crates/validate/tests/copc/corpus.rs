//! What other programs wrote: never an error. Skipped where the corpus is not at hand.

use pointmill_testkit::files::{corpus, fixture};
use pointmill_validate::{Check, Options, Outcome, validate};

fn broken(outcome: &Outcome) -> Vec<Check> {
    outcome.checks.iter().filter(|c| !c.ok).map(|c| c.name).collect()
}

#[test]
fn files_of_another_encoder_are_right() {
    for (name, points) in [("format6", 22), ("format8", 22), ("pages", 22)] {
        let outcome = validate(&fixture(&format!("copc/{name}.copc.laz")), &Options::default(), &|_| {}).unwrap();
        assert_eq!(broken(&outcome), [], "{name}: {:#?}", outcome.problems);
        assert_eq!((outcome.points, outcome.nodes), (points, 7));
        assert_eq!(outcome.check(Check::Boxes).unwrap().checked, points);
    }
}

#[test]
fn a_real_file_holds_the_points_that_it_was_made_of() {
    let (Some(file), Some(source)) = (corpus("las/1.2-with-color.copc.laz"), corpus("las/1.2-with-color.las")) else {
        return;
    };
    let options = Options { against: vec![source], ..Options::default() };
    let outcome = validate(&file, &options, &|_| {}).unwrap();
    assert_eq!(broken(&outcome), [], "{:#?}", outcome.problems);
    assert_eq!((outcome.points, outcome.nodes), (1065, 65));
    let against = outcome.against.unwrap();
    assert_eq!((against.points_expected, against.points_found), (1065, 1065));
}
