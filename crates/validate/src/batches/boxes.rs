//! Batch boxes (§5): float32, rounded outwards, and no wider than that.

use serde_json::json;

use super::batch::{Points, Raw, corners};
use super::formulas::{f32_above, f32_below};
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::place::Place;

/// Each face, from the lattice points; where the planes leave a choice, from the cells they are in.
pub(crate) fn check(raw: &Raw, points: &Points, bits: u32, findings: &Findings) {
    findings.checked(Check::BatchBoxes, raw.len() as u64);
    for axis in 0..3 {
        let stated = (raw.bounds.min[axis], raw.bounds.max[axis]);
        let name = ["x", "y", "z"][axis];
        let fault = |face: &str, expected: String, found: f32| {
            let subject = format!("{face} {name} of slot {}", raw.slot);
            let finding = Finding::new(Check::BatchBoxes, subject, expected, json!(found));
            findings.push(finding.at(Place::Batch(raw.number as u32)));
        };
        if !points.ambiguous_axis[axis] {
            let r = &points.r[axis];
            let (low, high) = r.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), r| (l.min(*r), h.max(*r)));
            let (min, max) = (f32_below(low), f32_above(high));
            if stated.0 != min {
                fault("min", format!("{min}"), stated.0);
            }
            if stated.1 != max {
                fault("max", format!("{max}"), stated.1);
            }
            continue;
        }
        let cells = (0..raw.len()).map(|i| corners(raw, i, bits));
        let (low, high) = cells.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), [from, to]| {
            (low.min(from[axis]), high.max(to[axis]))
        });
        if low >= f64::from(stated.0.next_up()) {
            fault("min", format!("a point below {low}"), stated.0);
        }
        if high <= f64::from(stated.1.next_down()) {
            fault("max", format!("a point above {high}"), stated.1);
        }
    }
}
