//! Normals, curvatures and radii of a sample, computed again from all positions of a dataset.

use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use rayon::prelude::*;
use serde_json::{Value, json};

use super::columns::Columns;
use super::derived::Extent;
use super::expected::{Expected, Normal, Plane, angle};
use super::nearest::{Nearest, Neighbourhood, Within};
use super::sample::Query;
use crate::against::Rules;
use crate::against::block::Block;
use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::outcome::SurfelSummary;

/// What normals of 16 bits may be off beside [`Expected`], degrees: half a degree instead of a tenth, and what two bytes are
/// off (a test has the largest).
const OCTAHEDRAL: f64 = 0.4 + 1.6;

/// What curvatures may be off: absolute, and relative.
const CURVATURE: [f64; 2] = [1e-4, 1e-3];

/// Neighbours of all queries together, about, where a distance says which they are: a minute or so.
const MOST_NEIGHBOURS: f64 = 4e9;

/// What radii may be off, relative.
const RADIUS: f64 = 1e-5;

/// The sample, and what has been found around it so far.
pub(super) struct Again {
    queries: Vec<Query>,
    around: Vec<Mutex<Neighbourhood>>,
    /// Bits of the squares of distances beyond which nothing is looked for: they only shrink.
    limits: Vec<AtomicU64>,
    scale: [f64; 3],
}

/// What is compared.
#[derive(Debug, Clone, Copy)]
pub(super) struct Compared<'a> {
    pub(super) rules: &'a Rules,
    pub(super) columns: Columns,
    pub(super) normals: bool,
    pub(super) radii: bool,
    pub(super) is_octahedral: bool,
}

impl Again {
    /// `scouts`: positions of some of the `points` of the dataset, each once. That the neighbours of a query are no farther than
    /// those among them spares most distances; of neighbourhoods that have very many of them, fewer are looked at.
    pub(super) fn new(
        mut queries: Vec<Query>,
        (scouts, points): (&[[i64; 3]], u64),
        extent: Extent,
        scale: [f64; 3],
    ) -> Self {
        if let Extent::Within(radius) = extent {
            let is_near = |scout: &&[i64; 3], query: &Query| {
                squared(difference(**scout, query.position), scale) <= radius * radius
            };
            let points_each = points as f64 / scouts.len().max(1) as f64;
            let mut work = 0.0;
            let mut fits = |query: &Query| {
                work += points_each * scouts.iter().filter(|scout| is_near(scout, query)).count() as f64;
                work <= MOST_NEIGHBOURS
            };
            let most = queries.iter().position(|query| !fits(query)).unwrap_or(queries.len());
            queries.truncate(most.max(1));
        }
        let around = |query: &Query| match extent {
            Extent::Within(radius) => Neighbourhood::Within(Box::new(Within::new(radius))),
            Extent::Nearest(count) => {
                let mut among = Nearest::new(count, f64::INFINITY);
                scouts.iter().for_each(|scout| {
                    let difference = difference(*scout, query.position);
                    among.offer(squared(difference, scale), difference);
                });
                Neighbourhood::Nearest(Nearest::new(count, among.limit()))
            }
        };
        let around: Vec<Neighbourhood> = queries.par_iter().map(around).collect();
        let limits = around.iter().map(|around| AtomicU64::new(around.limit().to_bits())).collect();
        Self { queries, around: around.into_iter().map(Mutex::new).collect(), limits, scale }
    }

    /// Takes in all points of a block.
    pub(super) fn look(&self, block: &Block) {
        let ranges = block
            .positions
            .each_ref()
            .map(|values| values.iter().fold([i64::MAX, i64::MIN], |[min, max], v| [min.min(*v), max.max(*v)]));
        for ((query, around), limit) in self.queries.iter().zip(&self.around).zip(&self.limits) {
            let reach = f64::from_bits(limit.load(Relaxed));
            // the nearest place of the box
            let nearest = [0, 1, 2].map(|a| query.position[a].clamp(ranges[a][0], ranges[a][1].max(ranges[a][0])));
            if squared(difference(nearest, query.position), self.scale) > reach {
                continue;
            }
            let Ok(mut around) = around.lock() else { continue };
            for i in 0..block.len() {
                let difference = difference(block.position(i), query.position);
                around.offer(squared(difference, self.scale), difference);
            }
            limit.store(around.limit().to_bits(), Relaxed);
        }
    }

    /// Compares, once all points were taken in.
    pub(super) fn compare(&self, compared: &Compared<'_>, findings: &Findings) -> SurfelSummary {
        let mut summary = SurfelSummary::default();
        for (query, around) in self.queries.iter().zip(&self.around) {
            let found = around.lock().map_or_else(|e| e.into_inner().finish(), |around| around.finish());
            let expected = Expected::of(&found, self.scale);
            findings.checked(Check::Surfels, 1);
            summary.points += 1;
            summary.ambiguous += u64::from(expected.is_ambiguous());
            Judge { query, expected, compared, findings }.judge(&mut summary);
        }
        summary
    }
}

impl Expected {
    fn is_ambiguous(&self) -> bool {
        matches!(self.plane, None | Some(Plane { normal: Normal::Any, .. }))
    }
}

/// A point of the sample, and what it should have.
struct Judge<'a> {
    query: &'a Query,
    expected: Expected,
    compared: &'a Compared<'a>,
    findings: &'a Findings,
}

impl Judge<'_> {
    fn judge(&self, summary: &mut SurfelSummary) {
        let Compared { columns, normals, radii, .. } = self.compared;
        if let Some(plane) = self.expected.plane {
            if *normals && columns.known_normal().is_some() {
                self.normal(plane.normal, summary);
            }
            if columns.known_curvature().is_some() {
                self.curvature(plane.curvature, summary);
            }
        }
        if *radii && columns.known_radius().is_some() {
            self.radius(summary);
        }
    }

    fn push(&self, what: &str, expected: Value, found: Value) {
        let [x, y, z] = self.compared.rules.world(self.query.position);
        let subject = format!("{what} at {x} {y} {z}");
        let finding = Finding::new(Check::Surfels, subject, expected, found);
        self.findings.push(finding.at(self.query.place).points(1));
    }

    fn normal(&self, expected: Normal, summary: &mut SurfelSummary) {
        let found = self.query.surfel().normal;
        let is_zero = found == [0.0; 3];
        match expected {
            Normal::Any => {}
            // 16 bits have no code for it
            Normal::None if self.compared.is_octahedral => {}
            Normal::None if is_zero => summary.normals += 1,
            Normal::None => self.push("normal", json!([0, 0, 0]), json!(found)),
            Normal::Line(right, _) if is_zero => self.push("normal", json!(right), json!(found)),
            Normal::Line(right, allowed) => {
                let allowed = allowed + if self.compared.is_octahedral { OCTAHEDRAL } else { 0.0 };
                let angle = angle(right, found);
                summary.normals += 1;
                widen(&mut summary.largest_angle, angle);
                // NaN is no angle
                if angle.is_nan() || angle > allowed {
                    let what = format!("normal, {angle:.3} degrees off,");
                    self.push(&what, json!(right), json!(found));
                }
            }
        }
    }

    fn curvature(&self, expected: f64, summary: &mut SurfelSummary) {
        let found = self.query.surfel().curvature;
        let off = (found - expected).abs();
        widen(&mut summary.largest_curvature, off);
        if off.is_nan() || off > CURVATURE[0] + CURVATURE[1] * expected {
            self.push("curvature", json!(expected), json!(found));
        }
    }

    fn radius(&self, summary: &mut SurfelSummary) {
        let found = self.query.surfel().radius;
        let [least, most] = self.expected.radius;
        let off = (least - found).max(found - most).max(0.0);
        let relative = if off > 0.0 { off / most.max(f64::MIN_POSITIVE) } else { 0.0 };
        widen(&mut summary.largest_radius, relative);
        if !found.is_finite() || off > RADIUS * most {
            let expected = if least == most { json!(most) } else { json!([least, most]) };
            self.push("radius", expected, json!(found));
        }
    }
}

/// NaN, which is a fault of its own, widens nothing.
fn widen(largest: &mut Option<f64>, found: f64) {
    *largest = Some(largest.unwrap_or(0.0).max(found));
}

fn difference(a: [i64; 3], b: [i64; 3]) -> [i64; 3] {
    [0, 1, 2].map(|axis| a[axis].saturating_sub(b[axis]))
}

/// The square of the length of a difference, world units.
fn squared(difference: [i64; 3], scale: [f64; 3]) -> f64 {
    let [x, y, z] = [0, 1, 2].map(|a| difference[a] as f64 * scale[a]);
    x * x + y * y + z * z
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A normal as two bytes, and back, by section 5.3 of `docs/formats/potree1.md`.
    fn stored([x, y, z]: [f64; 3]) -> [f64; 3] {
        let s = 1.0 / (x.abs() + y.abs() + z.abs());
        let sign = |v: f64| if v < 0.0 { -1.0 } else { 1.0 };
        let (u, v) = match z >= 0.0 {
            true => (x * s, y * s),
            false => (sign(x) * (1.0 - y.abs() * s), sign(y) * (1.0 - x.abs() * s)),
        };
        let [u, v] = [u, v].map(|v| ((v + 1.0) * 128.0).min(255.0).floor() / 255.0 * 2.0 - 1.0);
        let z = 1.0 - u.abs() - v.abs();
        if z >= 0.0 { [u, v, z] } else { [sign(u) * (1.0 - v.abs()), sign(v) * (1.0 - u.abs()), z] }
    }

    #[test]
    fn two_bytes_are_off_by_no_more_than_is_allowed_for_them() {
        let mut most: f64 = 0.0;
        // a spiral over the sphere, a point in every part of 0.1 degrees or so
        let points = 4_000_000;
        for i in 0..points {
            let z = 1.0 - (2 * i + 1) as f64 / points as f64;
            let (sin, cos) = (2.399_963_229_728_653 * i as f64).sin_cos();
            let level = (1.0 - z * z).sqrt();
            let normal = [level * cos, level * sin, z];
            most = most.max(angle(normal, stored(normal)));
        }
        assert!(most <= OCTAHEDRAL - 0.4 && most > OCTAHEDRAL - 0.42, "{most}");
    }

    #[test]
    fn a_box_that_is_too_far_away_is_passed_over_and_no_other() {
        let at = |position: [i64; 3]| {
            let surfel = super::super::columns::Surfel { normal: [0.0, 0.0, 1.0], curvature: 0.0, radius: 0.0 };
            Query::new(position, surfel, crate::place::Place::Batch(0))
        };
        let again = Again::new(vec![at([0; 3]), at([1000, 0, 0])], (&[], 0), Extent::Within(5.0), [0.5; 3]);
        let mut block = Block::default();
        for p in [[3, 4, 8], [4, 3, 3], [20, 1, 1]] {
            block.positions.iter_mut().zip(p).for_each(|(values, v)| values.push(v));
        }
        again.look(&block);
        let many = Again::new(vec![at([0; 3]); 9], (&[[1, 1, 1], [90, 0, 0]], 1 << 31), Extent::Within(5.0), [0.5; 3]);
        assert_eq!(many.queries.len(), 3, "a half of all points around each");
        let points = again.around.into_iter().map(|around| around.into_inner().unwrap().finish().points);
        assert_eq!(points.collect::<Vec<_>>(), [[2, 2], [0, 0]]);
    }
}
