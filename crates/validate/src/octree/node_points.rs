//! Checks that need the points of one node alone: coordinates, boxes, order.

use std::cmp::Ordering;

use pointmill_format::NodeKey;
use serde_json::json;

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::expect::{Geometry, morton_cmp};

/// Stored coordinates below 0 (read as unsigned by some clients: 2^31 and more).
pub(crate) fn coordinates(key: NodeKey, positions: [&[i32]; 3], findings: &Findings) {
    findings.checked(Check::Coordinates, positions[0].len() as u64);
    for (axis, values) in positions.iter().enumerate() {
        let negative = values.iter().filter(|v| **v < 0).count() as u64;
        if negative > 0 {
            let least = values.iter().copied().min().unwrap_or(0);
            let subject = ["stored X", "stored Y", "stored Z"][axis];
            let finding = Finding::new(Check::Coordinates, subject, "0 to 2^31 - 1", least);
            findings.push(finding.at(key).points(negative));
        }
    }
}

/// Dequantised points in the closed box of their node, within [`Geometry::tolerance`]. Negative coordinates are
/// [`coordinates`]'s business. True if all are inside.
pub(crate) fn boxes(key: NodeKey, positions: [&[i32]; 3], geometry: &Geometry, findings: &Findings) -> bool {
    let [xs, ys, zs] = positions;
    findings.checked(Check::Boxes, xs.len() as u64);
    // Limits beyond 32 bits cannot be exceeded by what is stored in 32.
    let limits = geometry.node_limits(key).map(|(first, last)| {
        (first.clamp(i64::from(i32::MIN), i64::from(i32::MAX)), last.clamp(i64::from(i32::MIN), i64::from(i32::MAX)))
    });
    let [x, y, z] = limits.map(|(first, last)| first as i32..=last as i32);
    let outside =
        |px: i32, py: i32, pz: i32| (px | py | pz) >= 0 && !(x.contains(&px) & y.contains(&py) & z.contains(&pz));
    let count: u64 = xs.iter().zip(ys).zip(zs).map(|((x, y), z)| u64::from(outside(*x, *y, *z))).sum();
    if count == 0 {
        return true;
    }
    let node = geometry.node_box(key);
    let example = xs.iter().zip(ys).zip(zs).find(|((x, y), z)| outside(**x, **y, **z));
    let world = example.map(|((x, y), z)| [*x, *y, *z].map(i64::from));
    let world = world.map(|q| [0, 1, 2].map(|axis| geometry.world(axis, q[axis])));
    let expected = json!({ "min": node.min, "max": node.max });
    findings.push(Finding::new(Check::Boxes, "position", expected, json!(world)).at(key).points(count));
    false
}

/// Ascending Morton codes, which BROTLI requires.
pub(crate) fn order(key: NodeKey, positions: [&[i32]; 3], findings: &Findings) {
    let [xs, ys, zs] = positions;
    findings.checked(Check::Order, xs.len() as u64);
    let at = |i: usize| [xs[i], ys[i], zs[i]];
    let descents = (1..xs.len()).filter(|i| morton_cmp(at(i - 1), at(*i)) == Ordering::Greater);
    let (first, count) = descents.fold((None, 0), |(first, n), i| (first.or(Some(i)), n + 1));
    if let Some(first) = first {
        let expected = "points in ascending Morton order";
        let found = format!("point {first} is below the one before it");
        findings.push(Finding::new(Check::Order, "order", expected, found).at(key).points(count));
    }
}
