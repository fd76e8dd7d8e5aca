//! The cases: a row each.

use std::panic::{AssertUnwindSafe, catch_unwind};

use pointmill_testkit::Random;

use crate::case::Case;
use crate::case::Kept::{Decimals, Rounded, Same};
use crate::input::Input;

/// Points of most cases.
const POINTS: usize = 120;

/// Random points of a lattice, from −`side` to `side` steps; two corners and the middle are among them.
pub(crate) fn cloud(side: i32, seed: u64) -> Vec<[i32; 3]> {
    let mut random = Random::new(seed);
    let mut one = || (random.between(-1.0, 1.0) * f64::from(side)).round() as i32;
    let mut points = vec![[-side; 3], [side; 3], [0; 3]];
    points.extend((3..POINTS).map(|_| [one(), one(), one()]));
    points
}

/// The same with a middle elsewhere, as 64-bit integers.
fn cloud_at(middle: i64, side: i32, seed: u64) -> Vec<[i64; 3]> {
    cloud(side, seed).into_iter().map(|p| p.map(|v| middle + i64::from(v))).collect()
}

/// Judges all, and names those that fail.
pub(crate) fn judge(cases: impl IntoIterator<Item = Case>) {
    let failed = |case: &Case| catch_unwind(AssertUnwindSafe(|| case.judge())).is_err();
    let failed: Vec<String> = cases.into_iter().filter(failed).map(|case| case.name).collect();
    assert!(failed.is_empty(), "{} cases failed: {failed:#?}", failed.len());
}

/// The least step at that distance from 0, as a multiple 1, 2, 5, 10 … of `step`: two distances of doubles (numerics, §2.1).
const COARSER: [(f64, f64, f64); 3] = [(1e7, 1e-9, 5e-9), (1e9, 1e-9, 5e-7), (-1e9, 1e-9, 5e-7)];

fn magnitudes_and_steps() -> Vec<Case> {
    let mut cases = Vec::new();
    for far in [0.0, 1e3, 1e6, -1e6, 1e7, 1e9, -1e9] {
        for step in [1e-9, 1e-6, 0.001, 0.0003, 1.0 / 3.0, 0.1, 1.0, 1e3] {
            let points = cloud(100_000, cases.len() as u64);
            let case = Case::las(format!("{far} in steps of {step}"), [step; 3], [far; 3], points);
            let coarser = COARSER.into_iter().find(|(at, fine, _)| (*at, *fine) == (far, step));
            cases.push(match coarser {
                Some((_, _, coarser)) => Case { step: Some([coarser; 3]), ..case.kept([Rounded; 3]) },
                None => case,
            });
        }
    }
    cases
}

#[test]
fn near_and_far_in_fine_and_coarse_steps() {
    judge(magnitudes_and_steps().into_iter().step_by(4));
}

#[test]
#[ignore = "long"]
fn near_and_far_in_all_steps() {
    judge(magnitudes_and_steps());
}

#[test]
fn extents_from_nothing_to_a_hundred_million() {
    let mm = |name: &str, points| Case::las(name, [0.001; 3], [-4_000.0, 5_400_000.0, 0.0], points);
    let wide = |decimals, side, points: fn(i64, i32, u64) -> Vec<[i64; 3]>| Input::Text {
        decimals,
        points: points(0, side, 5),
    };
    judge([
        mm("one point", vec![[7, -7, 0]]),
        mm("two points, one step apart", vec![[7, -7, 0], [8, -7, 0]]),
        mm("a metre", cloud(500, 1)),
        mm("a kilometre", cloud(500_000, 2)),
        mm("a thousand kilometres", cloud(500_000_000, 3)),
        mm("as many steps as there can be", cloud((1 << 30) - 1, 4)),
        Case::new("10^8 in steps of 0.1", wide(1, 500_000_000, cloud_at), [0.1; 3], Decimals),
        Case::new("10^8 in millimetres", far_apart(3), [0.05; 3], Rounded),
        Case::las("the finest step", [1e-15; 3], [0.0; 3], cloud(1_000_000_000, 6)),
        Case::las("the coarsest step", [4.6e20; 3], [0.0; 3], cloud(1_000_000_000, 7)),
    ]);
}

/// Points 10^8 apart in that many decimals.
fn far_apart(decimals: u32) -> Input {
    let unit = 10f64.powi(decimals as i32);
    let mut random = Random::new(8);
    let mut one = || (random.between(-5e7, 5e7) * unit).round() as i64;
    Input::Text { decimals, points: (0..POINTS).map(|_| [one(), one(), one()]).collect() }
}

#[test]
fn shapes_without_a_volume_and_points_on_borders() {
    let mm = |name: &str, points: Vec<[i32; 3]>| Case::las(name, [0.001; 3], [1e6, -1e6, 0.0], points);
    let of = |f: fn(i32) -> [i32; 3]| (0..POINTS as i32).map(f).collect::<Vec<_>>();
    let binary = |name: &str, points: Vec<[i32; 3]>| Case::las(name, [2f64.powi(-10); 3], [0.0; 3], points);
    judge([
        mm("all points equal", of(|_| [123, -456, 789])),
        mm("all points equal at 0", of(|_| [0; 3])),
        mm("a line along x", of(|i| [i * 1_000_003, 5, 5])),
        mm("a diagonal", of(|i| [i * 7919; 3])),
        mm("a plane across z", of(|i| [i % 11 * 90_001, i / 11 * 90_001, 77])),
        mm("a plane that is inclined", of(|i| [i % 11 * 1003, i / 11 * 1003, i % 11 * 1003 + i / 11 * 1003])),
        // a cell of the batches is 1024 steps and a power of two of them
        binary("on borders of cells", of(|i| [i % 5 * 1024, i / 5 % 5 * 2048, i / 25 * 512])),
        binary("on both sides of borders", of(|i| [i % 5 * 1024 - i % 2, i / 5 % 5 * 1024 - i % 3, i / 25 * 1024])),
        mm(
            "on the faces of the cube",
            of(|i| [[0, 1000, i * 8][i as usize % 3], [i * 8, 0, 1000][i as usize % 3], 1000]),
        ),
        mm("the far face", of(|i| [1_000_000, i * 8403, i * 8403])),
    ]);
}

#[test]
fn points_that_are_badly_spread() {
    let mm = |name: &str, points: Vec<[i32; 3]>| Case::las(name, [0.001; 3], [1e6, -1e6, 0.0], points);
    let cluster = |at: i64| (0..POINTS as i64 / 2).map(move |i| [at + i * 3, at + i * i, at - i % 7]);
    let apart = cluster(0).chain(cluster(10_000_000_000)).collect();
    let powers = (0..30).flat_map(|k| [[1 << k, 0, -(1 << k)], [0, 1 << k, 0]]);
    let mut lonely = cloud(1000, 1);
    lonely.push([1_000_000_000, 0, 0]);
    let mut lost: Vec<[i64; 3]> = cloud_at(0, 500_000, 2);
    lost.push([1_000_000_000_000_000; 3]);
    judge([
        // 10^10 steps do not fit 31 bits: five times as long
        Case::new("two clusters 10^7 apart", Input::Text { decimals: 3, points: apart }, [0.005; 3], Rounded),
        mm("powers of two up to 2^29, both signs", powers.collect()),
        mm("one outlier", lonely),
        Case::new("one outlier beyond 31 bits", Input::Text { decimals: 3, points: lost }, [500.0; 3], Rounded)
            .with(&["--outliers", "keep"]),
    ]);
}

#[test]
fn numbers_that_are_hardly_any() {
    let odd = [0.0, -0.0, 5e-324, -5e-324, f64::MIN_POSITIVE, 1e-300, -1e-16, 1e-15, 1.0, -1.0];
    let none = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -f64::NAN];
    let mut points: Vec<[f64; 3]> = (0..40).map(|i| [odd[i % 10], odd[i / 4 % 10], odd[(i + 3) % 10]]).collect();
    points.extend((0..12).map(|i| std::array::from_fn(|a| if a == i % 3 { none[i / 3] } else { 0.5 })));
    let tiny = [f32::from_bits(1), -f32::from_bits(1), f32::MIN_POSITIVE, -0.0, 0.0, 1.0, 0.5];
    let mut singles: Vec<[f32; 3]> = (0..40).map(|i| [tiny[i % 7], tiny[i / 7 % 7], tiny[(i + 2) % 7]]).collect();
    singles.extend([[f32::NAN, 0.0, 0.0], [0.0, f32::INFINITY, 0.0], [0.0, 0.0, f32::NEG_INFINITY]]);
    judge([
        Case::new("denormal doubles, -0, NaN and infinity", Input::Double(points), [1e-9; 3], Rounded),
        Case::new("denormal singles, -0, NaN and infinity", Input::Single(singles), [2f64.powi(-23); 3], Rounded),
    ]);
}

#[test]
fn singles_and_doubles() {
    let far =
        |middle: f32, step: f32| cloud(1000, 3).into_iter().map(move |p| p.map(|v| middle + v as f32 * step)).collect();
    let doubles = |middle: f64, side: f64| {
        let mut random = Random::new(9);
        let mut one = || middle + random.between(-side, side);
        (0..POINTS).map(|_| [one(), one(), one()]).collect()
    };
    judge([
        Case::new("singles at 500,000", Input::Single(far(5e5, 0.03125)), [0.03125; 3], Same),
        Case::new("singles at -5,400,000", Input::Single(far(-5.4e6, 0.5)), [0.5; 3], Same),
        Case::new("singles around 0", Input::Single(far(0.0, 1e-6)), [2f64.powi(-33); 3], Rounded),
        Case::new("doubles around 0", Input::Double(doubles(0.0, 1.0)), [1e-9; 3], Rounded),
        Case::new("doubles at 10^6", Input::Double(doubles(1e6, 50.0)), [5e-8; 3], Rounded),
        Case::new("doubles at -10^9", Input::Double(doubles(-1e9, 50.0)), [5e-7; 3], Rounded),
        Case::new("doubles, a step requested", Input::Double(doubles(1e6, 50.0)), [0.25; 3], Rounded)
            .with(&["--scale", "0.25"]),
    ]);
}

#[test]
fn decimals_of_text() {
    let text = |decimals, middle| Input::Text { decimals, points: cloud_at(middle, 40_000, 4) };
    judge([
        Case::new("whole numbers", text(0, 0), [1.0; 3], Decimals),
        Case::new("thousandths at 10^6", text(3, 1_000_000_000), [0.001; 3], Decimals),
        Case::new("thousandths at -10^9", text(3, -1_000_000_000_000), [0.001; 3], Decimals),
        Case::new("nine decimals", text(9, 0), [1e-9; 3], Decimals),
        Case::new("six decimals at 10^7", text(6, 10_000_000_000_000), [1e-6; 3], Decimals),
        Case::new("a step requested", text(3, 1_000_000_000), [0.03; 3], Rounded).with(&["--scale", "0.03"]),
    ]);
}

#[test]
fn limits_of_integers() {
    let (min, max) = (i32::MIN, i32::MAX);
    let near =
        |end: i32, sign: i32| cloud(1000, 5).into_iter().map(move |p| p.map(|v| end + sign * (v + 1000))).collect();
    let mm = |name: &str, points: Vec<[i32; 3]>| Case::las(name, [0.001; 3], [0.0; 3], points);
    let mut whole = cloud(max, 6);
    whole.extend([[min; 3], [max; 3]]);
    // 2^32 steps: 2 is a little too few
    let coarser = Case { step: Some([0.005; 3]), ..mm("all integers", whole).kept([Rounded; 3]) };
    judge([
        mm("the least integers", near(min, 1)),
        mm("the greatest integers", near(max, -1)),
        mm("from the least to -2", vec![[min; 3], [-2; 3], [-1_000_000_000, min, -2]]),
        mm("from 1 to the greatest", vec![[1; 3], [max; 3], [1_000_000_007, 1, max]]),
        coarser,
    ]);
}

#[test]
fn steps_that_differ_by_axis() {
    let las = |scale, offset, points| Case::las(format!("steps {scale:?}"), scale, offset, points);
    judge([
        las([0.002, 0.001, 0.004], [1e6, -1e6, 10.0], cloud(100_000, 1)),
        las([0.001, 0.003, 0.0007], [1e6, -1e6, 10.0], cloud(100_000, 2)),
        las([1e-8, 1e-8, 0.01], [10.0, 48.0, 0.0], cloud(50_000_000, 3)).without("potree1"),
        las([1e3, 1e-3, 1.0 / 3.0], [0.0; 3], cloud(1000, 4)).without("potree1"),
    ]);
}

#[test]
fn poses_far_away_and_quaternions_of_any_length() {
    let posed = |quaternion, translation, kept, step: f64| {
        let points = cloud(40_000, 7);
        let name = format!("turned by {quaternion:?}, moved by {translation:?}");
        Case::new(name, Input::Posed { step: 0.001, quaternion, translation, points }, [step; 3], kept)
    };
    judge([
        posed([1, 0, 0, 0], [0.0; 3], Same, 0.001),
        posed([3, 0, 0, 0], [1e7, -1e7, 1e3], Decimals, 0.001),
        posed([1, 0, 0, 1], [1e6, 2e6, 0.0], Rounded, 0.001),
        posed([1, 2, 3, 4], [1e7, -1e7, 1e3], Rounded, 0.001),
        posed([-3, 0, 0, 4], [1e9, -1e9, 1e9], Rounded, 0.001),
        posed([100, 1, 0, 0], [0.0; 3], Rounded, 0.001),
    ]);
}
