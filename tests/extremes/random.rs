//! Random lattices, magnitudes, extents and counts: the same for a seed, which the name of a case says.

use pointmill_testkit::Random;

use crate::case::Case;
use crate::case::Kept::{Decimals, Rounded, Same};
use crate::cases::judge;
use crate::input::Input;

/// A number of any sign between two powers of ten, each decade as likely.
fn of_any_size(random: &mut Random, least: f64, most: f64) -> f64 {
    let sign = random.pick(&[1.0, -1.0]);
    sign * 10f64.powf(random.between(least, most))
}

/// 1 to 300 places within `side` steps, by axis; some axes are flat, some places are shared.
fn places(random: &mut Random) -> Vec<[i64; 3]> {
    let sides = [0; 3].map(|_| random.pick(&[0, 1, 7, 1000, 1_000_003, (1 << 30) - 1]) as f64);
    let mut points: Vec<[i64; 3]> = Vec::new();
    for _ in 0..1 + random.index(300) {
        let shared = points.get(random.index(2 * points.len() + 1)).copied();
        points.push(shared.unwrap_or_else(|| sides.map(|side| random.between(-side, side).round() as i64)));
    }
    points
}

/// Integers on a lattice that doubles hold: they are kept, whatever they are.
fn las(seed: u64) -> Case {
    let mut random = Random::new(seed);
    let offset = [0; 3].map(|_| of_any_size(&mut random, -3.0, 9.0));
    // two distances of doubles at the farthest coordinate, and more
    let step =
        10f64.powf(random.between(-6.0, 3.0)).max(1e-15 * offset.iter().fold(0.0, |far: f64, o| far.max(o.abs())));
    let points = places(&mut random).into_iter().map(|p| p.map(|v| v as i32)).collect();
    Case { step: None, ..Case::las(format!("lattice of seed {seed}"), [step; 3], offset, points) }
}

/// Decimals, at a middle.
fn text(seed: u64) -> Case {
    let mut random = Random::new(seed);
    let decimals = random.index(7) as u32;
    let middle = [0; 3].map(|_| random.between(-1e6, 1e6).round() as i64 * 10i64.pow(decimals));
    let points = places(&mut random).into_iter().map(|p| [0, 1, 2].map(|a| p[a] + middle[a])).collect();
    let input = Input::Text { decimals, points };
    Case { step: None, ..Case::new(format!("decimals of seed {seed}"), input, [0.0; 3], Decimals) }
}

/// Doubles, and a step that is requested.
fn doubles(seed: u64) -> Case {
    let mut random = Random::new(seed);
    let middle = [0; 3].map(|_| of_any_size(&mut random, -3.0, 9.0));
    let side = 10f64.powf(random.between(-2.0, 5.0));
    let points = (0..1 + random.index(300)).map(|_| middle.map(|m| m + random.between(-side, side))).collect();
    let steps = ["0.0001", "0.003", "0.25", "7"];
    let step = random.pick(&steps);
    let number = step.parse().unwrap_or(f64::NAN);
    Case::new(format!("doubles of seed {seed}"), Input::Double(points), [number; 3], Rounded).with(&["--scale", step])
}

/// A pose, and a step that is requested.
fn pose(seed: u64) -> Case {
    let mut random = Random::new(seed);
    let quaternion = [0; 4].map(|_| random.index(19) as i32 - 9);
    let quaternion = if quaternion == [0; 4] { [1, 0, 0, 0] } else { quaternion };
    let translation = [0; 3].map(|_| of_any_size(&mut random, 0.0, 9.0));
    let points = places(&mut random).into_iter().map(|p| p.map(|v| (v % 1_000_003) as i32)).collect();
    let input = Input::Posed { step: 0.001, quaternion, translation, points };
    Case::new(format!("pose of seed {seed}"), input, [0.003; 3], Rounded).with(&["--scale", "0.003"])
}

fn cases(seeds: std::ops::Range<u64>) -> impl Iterator<Item = Case> {
    seeds.flat_map(|seed| [las(seed), text(seed), doubles(seed), pose(seed)])
}

#[test]
fn a_few() {
    judge(cases(0..3));
}

#[test]
#[ignore = "long"]
fn many() {
    judge(cases(3..103));
}

#[test]
fn cases_differ_by_their_seed() {
    let of = |seed| las(seed).input.point(0).map(|p| p[0].value());
    assert!(of(1) != of(2) && of(3) == of(3));
    assert_eq!(las(1).kept, [Same; 3]);
}
