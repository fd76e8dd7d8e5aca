//! Least and greatest raw values of attributes in the description.

use pointmill_format::AttributeType;
use serde_json::json;

use super::batch::Raw;
use super::description::{Colour, Description, Extra};
use crate::check::Check;
use crate::finding::{Finding, Findings};

/// Least and greatest value of each element of each attribute; NaN and infinities are neither.
#[derive(Debug, Clone, Default)]
pub(crate) struct Ranges {
    /// Empty for attributes without stated values.
    values: Vec<Vec<[f64; 2]>>,
}

impl Ranges {
    /// The values of a batch.
    pub(crate) fn of(description: &Description, raw: &Raw) -> Self {
        let values = description.attributes.iter().zip(&raw.extras).enumerate().map(|(i, (extra, bytes))| {
            if extra.min.is_none() && extra.max.is_none() && description.intensity_column() != Some(i) {
                return Vec::new();
            }
            let Extra { attribute, .. } = extra;
            let size = attribute.ty.size();
            let mut out = vec![[f64::INFINITY, f64::NEG_INFINITY]; attribute.elements];
            for point in bytes.chunks_exact(attribute.size()) {
                for (range, value) in out.iter_mut().zip(point.chunks_exact(size)) {
                    let v = number(value, attribute.ty);
                    if v.is_finite() {
                        *range = [range[0].min(v), range[1].max(v)];
                    }
                }
            }
            out
        });
        Self { values: values.collect() }
    }

    /// Takes in another batch.
    pub(crate) fn merge(&mut self, other: Self) {
        if self.values.is_empty() {
            *self = other;
            return;
        }
        for (a, b) in self.values.iter_mut().flatten().zip(other.values.into_iter().flatten()) {
            *a = [a[0].min(b[0]), a[1].max(b[1])];
        }
    }

    /// Compares with the description. Does nothing without points.
    pub(crate) fn check(&self, description: &Description, findings: &Findings) {
        for (i, (extra, seen)) in description.attributes.iter().zip(&self.values).enumerate() {
            if seen.iter().any(|[min, max]| min > max) {
                continue; // nothing but NaN
            }
            let name = &extra.attribute.name;
            for (word, stated, side) in [("min", &extra.min, 0), ("max", &extra.max, 1)] {
                let Some(stated) = stated else { continue };
                let seen: Vec<f64> = seen.iter().map(|range| range[side]).collect();
                findings.checked(Check::AttributeRanges, seen.len() as u64);
                if *stated != seen {
                    let subject = format!("{word} of {name}");
                    findings.push(Finding::new(Check::AttributeRanges, subject, json!(seen), json!(stated)));
                }
            }
            if description.colour == Colour::Intensity
                && description.intensity_column() == Some(i)
                && let (Some(stated), [seen]) = (description.intensity_range, seen.as_slice())
            {
                findings.checked(Check::AttributeRanges, 2);
                if stated.map(|v| v as f64) != *seen {
                    findings.push(Finding::new(Check::AttributeRanges, "intensityRange", json!(seen), json!(stated)));
                }
            }
        }
    }
}

/// A raw value of little-endian bytes.
pub(super) fn number(bytes: &[u8], ty: AttributeType) -> f64 {
    let word = bytes.iter().rev().fold(0u64, |w, b| w << 8 | u64::from(*b));
    match ty {
        AttributeType::Int8 => f64::from(word as i8),
        AttributeType::Int16 => f64::from(word as i16),
        AttributeType::Int32 => f64::from(word as i32),
        AttributeType::Int64 => word as i64 as f64,
        AttributeType::Float32 => f64::from(f32::from_bits(word as u32)),
        AttributeType::Float64 => f64::from_bits(word),
        _ => word as f64,
    }
}
