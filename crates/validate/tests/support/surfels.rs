//! Normals, curvatures and radii by `docs/surfels.md`, worked out by the plainest means and by another method than the
//! validator's, and the report that says so.
#![allow(dead_code, unreachable_pub)] // each test binary uses a part

use std::collections::BTreeSet;

use pointmill_validate::{Check, Outcome};
use serde_json::{Value, json};

/// Normal, curvature, radius.
pub type Surfel = [f32; 5];

pub const NAMES: [&str; 5] = ["NormalX", "NormalY", "NormalZ", "curvature", "radius"];

pub const NEIGHBOURS: usize = 16;

fn difference(from: &[i64; 3], to: &[i64; 3], scale: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|a| (to[a] - from[a]) as f64 * scale[a])
}

fn squared(d: [f64; 3]) -> f64 {
    d[0] * d[0] + d[1] * d[1] + d[2] * d[2]
}

/// Of points at these steps of a lattice, by all points within a distance, upwards.
pub fn right_within(steps: &[[i64; 3]], scale: [f64; 3], radius: f64) -> Vec<Surfel> {
    let of = |from: &[i64; 3]| {
        let all = steps.iter().map(|to| difference(from, to, scale));
        let near: Vec<[f64; 3]> = all.filter(|d| squared(*d) <= radius * radius).collect();
        let is_one_place = near.iter().all(|d| squared(*d) == 0.0);
        surfel(&near, if is_one_place { 0.0 } else { radius })
    };
    steps.iter().map(of).collect()
}

/// Of points at these steps of a lattice, by their 16 nearest, upwards.
pub fn right(steps: &[[i64; 3]], scale: [f64; 3]) -> Vec<Surfel> {
    let of = |from: &[i64; 3]| {
        let difference = |to: &[i64; 3]| difference(from, to, scale);
        let mut all: Vec<(f64, &[i64; 3])> = steps.iter().map(|to| (squared(difference(to)), to)).collect();
        let order = |a: &(f64, &[i64; 3]), b: &(f64, &[i64; 3])| a.0.total_cmp(&b.0).then(a.1.cmp(b.1));
        let count = NEIGHBOURS.min(all.len());
        all.select_nth_unstable_by(count - 1, order);
        let near: Vec<[f64; 3]> = all[..count].iter().map(|(_, to)| difference(to)).collect();
        surfel(&near, all[count - 1].0.sqrt())
    };
    steps.iter().map(of).collect()
}

fn surfel(near: &[[f64; 3]], farthest: f64) -> Surfel {
    if farthest == 0.0 {
        return [0.0; 5];
    }
    let n = near.len() as f64;
    let mean = [0, 1, 2].map(|a| near.iter().map(|d| d[a]).sum::<f64>() / n);
    let c = |a: usize, b: usize| near.iter().map(|d| (d[a] - mean[a]) * (d[b] - mean[b])).sum::<f64>() / n;
    let m = [0, 1, 2].map(|a| [0, 1, 2].map(|b| c(a, b)));
    let (least, sum) = (smallest(m), m[0][0] + m[1][1] + m[2][2]);
    // the rows of m − λ are at right angles to the eigenvector
    let rows = [0, 1, 2].map(|a| [0, 1, 2].map(|b| m[a][b] - if a == b { least } else { 0.0 }));
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [0, 1, 2].map(|i: usize| a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3])
    };
    let length = |v: [f64; 3]| (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    let candidates = [cross(rows[0], rows[1]), cross(rows[0], rows[2]), cross(rows[1], rows[2])];
    let radius = farthest * (4.0 / n).sqrt().min(1.0);
    let places: BTreeSet<[u64; 3]> = near.iter().map(|d| d.map(f64::to_bits)).collect();
    if places.len() < 3 {
        return [0.0, 0.0, 0.0, 0.0, radius as f32];
    }
    let longest = candidates.into_iter().max_by(|a, b| length(*a).total_cmp(&length(*b))).unwrap();
    let [x, y, z] = longest.map(|v| v / length(longest));
    let is_up = z > 0.0 || z == 0.0 && (y > 0.0 || y == 0.0 && x > 0.0);
    let sign = if is_up { 1.0 } else { -1.0 };
    [sign * x, sign * y, sign * z, least.max(0.0) / sum, radius].map(|v| v as f32)
}

/// The smallest root of the characteristic polynomial, by cosines.
fn smallest(m: [[f64; 3]; 3]) -> f64 {
    let q = (m[0][0] + m[1][1] + m[2][2]) / 3.0;
    let off = m[0][1] * m[0][1] + m[0][2] * m[0][2] + m[1][2] * m[1][2];
    let p = (((0..3).map(|i| (m[i][i] - q).powi(2)).sum::<f64>() + 2.0 * off) / 6.0).sqrt();
    let b = [0, 1, 2].map(|i| [0, 1, 2].map(|j| (m[i][j] - if i == j { q } else { 0.0 }) / p));
    let half = (b[0][0] * (b[1][1] * b[2][2] - b[1][2] * b[2][1]) - b[0][1] * (b[1][0] * b[2][2] - b[1][2] * b[2][0])
        + b[0][2] * (b[1][0] * b[2][1] - b[1][1] * b[2][0]))
        / 2.0;
    let angle = half.clamp(-1.0, 1.0).acos() / 3.0;
    q + 2.0 * p * (angle + std::f64::consts::TAU / 3.0).cos()
}

/// The normal turned by so many degrees.
pub fn turned(surfel: Surfel, degrees: f32) -> Surfel {
    let [x, y, z, curvature, radius] = surfel;
    // about an axis at right angles to the normal
    let across = if z.abs() < 0.9 { [y, -x, 0.0] } else { [0.0, z, -y] };
    let length = across.iter().map(|c| c * c).sum::<f32>().sqrt();
    let (sin, cos) = degrees.to_radians().sin_cos();
    let [a, b, c] = [0, 1, 2].map(|i| [x, y, z][i] * cos + across[i] / length * sin);
    [a, b, c, curvature, radius]
}

/// What is asked for by default, upwards.
pub fn settings() -> Value {
    json!({ "normals": "keep", "radius": true, "neighbours": NEIGHBOURS, "orient": "up" })
}

/// The report of a conversion that has computed attributes. `zeros`: points without a normal, and without a radius.
pub fn report(format: &str, settings: &Value, zeros: [u64; 2], dropped: &Value) -> String {
    json!({
        "options": { "derive": settings },
        "derived": { "points": 0, "kept_normals": 0, "without_normal": zeros[0], "without_radius": zeros[1] },
        "outputs": [{ "format": format, "folder": "", "attributes_dropped": dropped }],
    })
    .to_string()
}

/// Errors of all checks but those of the report, which says nothing else here.
pub fn faults(outcome: &Outcome) -> Vec<(Check, u64)> {
    let others = [Check::Report, Check::Accuracy];
    let broken = outcome.checks.iter().filter(|c| !c.ok && !others.contains(&c.name));
    broken.map(|c| (c.name, c.found)).collect()
}

#[track_caller]
pub fn assert_faults(outcome: &Outcome, expected: &[(Check, u64)]) {
    let lines: Vec<String> = outcome.problems.iter().map(ToString::to_string).collect();
    assert_eq!(faults(outcome), expected, "{lines:#?}");
}

/// Asserts that everything was compared, and was right.
#[track_caller]
pub fn assert_right(outcome: &Outcome, most_degrees: f64) {
    assert_faults(outcome, &[]);
    for check in Check::DERIVED {
        let result = outcome.check(*check).unwrap();
        assert!(result.checked > 0 && result.skipped.is_none() && result.warnings == 0, "{result}");
    }
    let summary = outcome.surfels.unwrap();
    assert!(summary.points >= 500 && summary.ambiguous < summary.points / 4, "{summary:?}");
    assert!(summary.largest_angle.unwrap() <= most_degrees && summary.normals > summary.points / 2, "{summary:?}");
    assert!(summary.largest_curvature.unwrap() < 1e-6 && summary.largest_radius.unwrap() < 1e-6, "{summary:?}");
}
