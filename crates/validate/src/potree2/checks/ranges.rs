//! Values in the metadata: the tight box, min and max of every attribute, histograms.

use pointmill_format::potree2::{AttributeStats, Metadata};
use pointmill_format::{Column, NodePoints, with_column};
use serde_json::json;

use crate::check::Check;
use crate::finding::{Finding, Findings};
use crate::octree::expect::Geometry;

/// Smallest and largest values seen. NaN and infinities are neither: JSON cannot write them.
#[derive(Debug, Clone)]
pub(crate) struct Seen {
    /// Stored positions.
    position: [(i32, i32); 3],
    /// For each attribute but the position, for each element.
    attributes: Vec<Vec<(f64, f64)>>,
    /// For each attribute but the position; filled for one-byte attributes that have a histogram.
    histograms: Vec<Option<Box<[u64; 256]>>>,
    points: u64,
}

const NOTHING: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

impl Seen {
    pub(crate) fn new(metadata: &Metadata) -> Self {
        let others: Vec<_> = others(metadata).collect();
        Self {
            position: [(i32::MAX, i32::MIN); 3],
            attributes: others.iter().map(|a| vec![NOTHING; a.attribute.elements]).collect(),
            histograms: others
                .iter()
                .map(|a| (a.histogram.is_some() && a.attribute.size() == 1).then(|| Box::new([0; 256])))
                .collect(),
            points: 0,
        }
    }

    /// Takes in the points of a node.
    pub(crate) fn add(&mut self, points: &NodePoints) {
        self.points += points.len() as u64;
        for (seen, values) in self.position.iter_mut().zip(points.quantized().unwrap_or_default()) {
            *seen = values.iter().fold(*seen, |(min, max), v| (min.min(*v), max.max(*v)));
        }
        for (i, column) in points.columns().iter().enumerate() {
            add_column(&mut self.attributes[i], column);
            if let (Some(bins), Column::UInt8(values)) = (&mut self.histograms[i], column) {
                values.iter().for_each(|v| bins[usize::from(*v)] += 1);
            }
            if let (Some(bins), Column::Int8(values)) = (&mut self.histograms[i], column) {
                values.iter().for_each(|v| bins[usize::from(*v as u8)] += 1);
            }
        }
    }

    /// Takes in what another thread has seen.
    pub(crate) fn merge(&mut self, other: &Self) {
        self.points += other.points;
        for (a, b) in self.position.iter_mut().zip(&other.position) {
            *a = (a.0.min(b.0), a.1.max(b.1));
        }
        for (a, b) in self.attributes.iter_mut().flatten().zip(other.attributes.iter().flatten()) {
            *a = (a.0.min(b.0), a.1.max(b.1));
        }
        for (a, b) in self.histograms.iter_mut().flatten().zip(other.histograms.iter().flatten()) {
            a.iter_mut().zip(b.iter()).for_each(|(a, b)| *a += b);
        }
    }
}

#[allow(clippy::eq_op, clippy::unnecessary_cast)] // one body for every type of column; v != v: NaN
fn add_column(seen: &mut [(f64, f64)], column: &Column) {
    with_column!(column, values => {
        let elements = seen.len();
        for (element, seen) in seen.iter_mut().enumerate() {
            let Some(first) = values.get(element).copied() else { continue };
            let mut bounds = (first, first);
            for v in values.iter().skip(element).step_by(elements).copied() {
                // written so that NaN loses every comparison, and a NaN at the start gives way
                if v < bounds.0 || bounds.0 != bounds.0 { bounds.0 = v; }
                if v > bounds.1 || bounds.1 != bounds.1 { bounds.1 = v; }
            }
            let mut bounds = (bounds.0 as f64, bounds.1 as f64);
            if bounds.0.is_infinite() || bounds.1.is_infinite() {
                bounds = NOTHING; // rare: look again
                for v in values.iter().skip(element).step_by(elements).map(|v| *v as f64).filter(|v| v.is_finite()) {
                    bounds = (bounds.0.min(v), bounds.1.max(v));
                }
            }
            *seen = (seen.0.min(bounds.0), seen.1.max(bounds.1));
        }
    });
}

fn others(metadata: &Metadata) -> impl Iterator<Item = &AttributeStats> {
    metadata.attributes.iter().filter(|a| a.attribute.name != "position")
}

/// Compares the metadata with the values found. If not every node could be read (`complete` is false), only
/// values beyond the bounds are found, not bounds that nothing attains.
pub(crate) fn check(metadata: &Metadata, geometry: &Geometry, seen: &Seen, complete: bool, findings: &Findings) {
    if seen.points == 0 {
        return;
    }
    for stats in metadata.attributes.iter().filter(|a| a.attribute.name == "position") {
        tight_box(stats, geometry, seen, complete, findings);
    }
    for ((stats, bounds), bins) in others(metadata).zip(&seen.attributes).zip(&seen.histograms) {
        findings.checked(Check::AttributeRanges, bounds.len() as u64);
        let found: (Vec<f64>, Vec<f64>) = bounds.iter().copied().unzip();
        if bounds.iter().any(|b| b.0 > b.1) {
            continue; // nothing but NaN
        }
        let wrong = |declared: &[f64], seen: &[f64], side: f64| {
            declared.len() == seen.len()
                && declared.iter().zip(seen).any(|(d, s)| if complete { d != s } else { (s - d) * side > 0.0 })
        };
        let sides = [("min", &stats.min, &found.0, -1.0), ("max", &stats.max, &found.1, 1.0)];
        for (word, declared, seen, side) in sides {
            if wrong(declared, seen, side) {
                let subject = format!("{word} of {}", stats.attribute.name);
                findings.push(Finding::new(Check::AttributeRanges, subject, json!(seen), json!(declared)));
            }
        }
        if let (Some(declared), Some(bins), true) = (&stats.histogram, bins, complete) {
            histogram(&stats.attribute.name, declared, bins.as_ref(), findings);
        }
    }
}

/// The tight box, exact on the lattice: declared corners may differ from dequantised ones by the rounding of the last
/// digits ([`Geometry::tolerance`]), never by a step.
fn tight_box(stats: &AttributeStats, geometry: &Geometry, seen: &Seen, complete: bool, findings: &Findings) {
    findings.checked(Check::TightBox, seen.points);
    let sides = [
        ("min of position", &stats.min, seen.position.map(|p| p.0), -1.0),
        ("max of position", &stats.max, seen.position.map(|p| p.1), 1.0),
    ];
    for (subject, declared, stored, side) in sides {
        let world = [0, 1, 2].map(|axis| geometry.world(axis, i64::from(stored[axis])));
        let wrong = |axis: usize| {
            let beyond = (world[axis] - declared[axis]) * side;
            let tolerance = geometry.tolerance(axis).min(geometry.lattice.scale[axis] / 2.0);
            if complete { beyond.abs() > tolerance } else { beyond > tolerance }
        };
        if declared.len() == 3 && (0..3).any(wrong) {
            findings.push(Finding::new(Check::TightBox, subject, json!(world), json!(declared)));
        }
    }
}

fn histogram(name: &str, declared: &[u64], seen: &[u64; 256], findings: &Findings) {
    findings.checked(Check::Histogram, 256);
    for (value, (declared, seen)) in declared.iter().zip(seen).enumerate() {
        if declared != seen {
            let subject = format!("points with {name} {value}");
            findings.push(Finding::new(Check::Histogram, subject, *seen, *declared));
        }
    }
}
