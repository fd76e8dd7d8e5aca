//! Where a bound is attained, by inputs that are exactly as far off as it says. All numbers here are whole, halves or quarters: no
//! double is rounded.

use crate::input::Input;
use crate::output::{OUTPUTS, Output, Rule};
use crate::support::Dir;

/// Converts to one output; the error of each point on x.
fn errors(input: &Input, options: &[&str], output: &Output) -> Vec<(u8, f64)> {
    let dir = Dir::new();
    dir.write(input.file_name(), &input.bytes());
    let fixed = ["convert", input.file_name(), "-o", "out", "--attributes", "intensity", "-q"];
    dir.succeed(fixed.iter().chain(options));
    dir.validate("out", &[input.file_name()]);
    let decoded = output.decode(&dir.path("out"));
    assert_eq!(decoded.len(), input.len());
    let error = |i: u16, x: f64| input.point(i.into()).unwrap()[0].error_of(x);
    let mut errors: Vec<_> = decoded.iter().map(|p| (p.number, p.level, error(p.number, p.world[0]))).collect();
    errors.sort_by_key(|(number, ..)| *number);
    errors.into_iter().map(|(_, level, error)| (level, error)).collect()
}

fn of(rule: Rule) -> &'static Output {
    OUTPUTS.iter().find(|output| output.rule == rule).unwrap()
}

fn las(step: f64, xs: impl IntoIterator<Item = i32>) -> Input {
    Input::Las { scale: [step; 3], offset: [0.0; 3], points: xs.into_iter().map(|x| [x, 1, 3]).collect() }
}

#[test]
fn half_a_step_of_the_lattice_and_ties_go_to_even() {
    let to = |scale| ["--to", "potree2", "--scale", scale];
    // §2.2: in integers
    let found = errors(&las(1.0, [0, 1, 2, 3, -1, -3]), &to("2"), of(Rule::Integers));
    assert_eq!(found.map_errors(), [0.0, -1.0, 0.0, 1.0, 1.0, -1.0]);
    // §2.3: in doubles
    let halves = Input::Double([0.5, 1.5, -0.5, -2.5, 2.25].map(|x| [x, 0.0, 0.0]).to_vec());
    let found = errors(&halves, &to("1"), of(Rule::Integers));
    assert_eq!(found.map_errors(), [-0.5, 0.5, 0.5, 0.5, -0.25]);
}

#[test]
fn half_the_distance_of_singles_at_the_half_of_a_leaf() {
    // 3 · 2^25 long: the half is 3 · 2^24, where singles are 4 apart; 2^25 + 2 from the center is between two of them
    let center = 3 << 24;
    let found =
        errors(&las(1.0, [0, 2 * center, center + (1 << 25) + 2, center + 5]), &["--to", "bintree"], of(Rule::Singles));
    let bound = 2f64.powi(25 - 24);
    assert_eq!(found.map_errors().iter().map(|e| e.abs()).collect::<Vec<_>>(), [0.0, 0.0, bound, 0.0]);
}

#[test]
fn half_a_cell_at_the_ends_of_a_box() {
    for bits in [10, 20, 30] {
        let planes = bits.to_string();
        let found =
            errors(&las(1.0, [0, 1 << 30, 1 << 29]), &["--to", "batches", "--planes", &planes], of(Rule::Cells(bits)));
        let half = 2f64.powi(29 - bits as i32);
        assert_eq!(found.map_errors(), [half, -half, half], "{bits} bits");
    }
}

#[test]
fn a_quarter_of_a_step_below_corners_that_are_whole() {
    // 2^29 to 2^30 steps: one halving. Of the rows that are a million steps apart, the root takes some, and leaves of level 2 the
    // others; of a tight cluster most points are in nodes far below.
    let rows = (0..15).flat_map(|i| [50_000_000, 160_000_000].map(|at| at + i * 1_000_003));
    let cluster = (0..300).map(|i| 400_000_001 + i * 17);
    let input = las(1.0, [0, (1 << 29) + 1000].into_iter().chain(rows).chain(cluster));
    let found = errors(&input, &["--to", "potree1", "--leaf-capacity", "20"], of(Rule::FromCorners));
    let worst = found.iter().fold(0.0, |worst: f64, (_, error)| worst.max(error.abs()));
    assert!(found.iter().all(|(level, error)| *level > 1 || *error == 0.0), "whole steps down to level 1");
    assert!(found.iter().any(|(level, _)| *level > 5));
    assert_eq!(worst, 0.25);
    let at_level_2: Vec<f64> = found.iter().filter(|(level, _)| *level == 2).map(|(_, error)| error.abs()).collect();
    assert!(at_level_2.contains(&0.0) && at_level_2.contains(&0.25), "{at_level_2:?}");
}

trait Errors {
    fn map_errors(&self) -> Vec<f64>;
}

impl Errors for Vec<(u8, f64)> {
    fn map_errors(&self) -> Vec<f64> {
        self.iter().map(|(_, error)| *error).collect()
    }
}
