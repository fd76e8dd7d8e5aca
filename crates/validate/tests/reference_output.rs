//! What PotreeConverter 2.1.1 wrote, and what is wrong with it. Skipped where the corpus is not at hand.

use pointmill_testkit::files::corpus;
use pointmill_validate::{Check, Options, Outcome, validate};

fn run(name: &str, source: &str) -> Option<Outcome> {
    let options = Options { against: vec![corpus("las")?.join(source)], max_problems: 100, ..Options::default() };
    Some(validate(&corpus("potree2")?.join(name), &options, &|_| {}).unwrap())
}

/// Checks that found errors, and how many.
fn broken(outcome: &Outcome) -> Vec<(Check, u64)> {
    outcome.checks.iter().filter(|c| !c.ok).map(|c| (c.name, c.found)).collect()
}

fn against(outcome: &Outcome) -> Vec<String> {
    let problems = outcome.problems.iter().filter(|p| p.check == Check::Against);
    problems.map(|p| format!("{}: {}", p.subject, p.found.as_str().unwrap_or_default())).collect()
}

/// The scan angle's min and max are those of a signed number, its type is unsigned; truncated positions miss the
/// header's maximum, from which the tight box was copied.
#[test]
fn wrong_types_empty_nodes_and_depth_in_a_small_default_cloud() {
    let Some(outcome) = run("color_1065_DEFAULT", "1.2-with-color.las") else { return };
    let expected = [
        (Check::NodeTypes, 16),
        (Check::EmptyNodes, 49),
        (Check::Depth, 1),
        (Check::TightBox, 1),
        (Check::AttributeRanges, 2),
        (Check::Against, 1),
    ];
    assert_eq!(broken(&outcome), expected);
    assert_eq!(against(&outcome), ["positions: truncated instead of rounded"]);
}

#[test]
fn shifted_positions_in_a_small_brotli_cloud() {
    let Some(outcome) = run("color_1065_BROTLI", "1.2-with-color.las") else { return };
    let expected = [
        (Check::NodeTypes, 16),
        (Check::EmptyNodes, 49),
        (Check::Depth, 1),
        (Check::TightBox, 2),
        (Check::AttributeRanges, 2),
        (Check::Against, 1),
    ];
    assert_eq!(broken(&outcome), expected);
    let words = "positions: truncated instead of rounded, and shifted by +1 step on every axis";
    assert_eq!(against(&outcome), [words]);
}

/// This one also has chunks that no proxy refers to.
#[test]
fn shifted_positions_and_orphaned_chunks_in_a_brotli_cloud_of_several_chunks() {
    let Some(outcome) = run("autzen_trim_BROTLI", "autzen_trim.laz") else { return };
    let expected = [
        (Check::Hierarchy, 1),
        (Check::NodeTypes, 20),
        (Check::EmptyNodes, 5),
        (Check::Depth, 1),
        (Check::TightBox, 2),
        (Check::AttributeRanges, 2),
        (Check::Against, 1),
    ];
    assert_eq!(broken(&outcome), expected);
    assert_eq!(outcome.against.as_ref().map(|a| (a.points_expected, a.points_found)), Some((110_000, 110_000)));
    let words = "positions: truncated instead of rounded, and shifted by +1 step on every axis";
    assert_eq!(against(&outcome), [words]);
}
