//! Ranges of attributes, and points by class.

use pointmill_format::{AttributeType, Changes, Column, with_column};

use super::context::Context;
use super::visit::Visit;
use crate::cloud::Stats;
use crate::sources::doubled;

/// Up to here single precision has all whole numbers.
const GREATEST_CLASS: f64 = 16_777_216.0;

/// What colour values mean is a property of the whole file: points that are omitted count as well.
pub(super) fn unfiltered_colour(pass: &Context<'_>, visit: &mut Visit<'_>, columns: &[&Column]) {
    let places = &visit.intake.columns;
    let Some(rgb) = pass.intake.schema.rgb() else { return };
    let colour = columns.iter().zip(places).find(|(_, place)| **place == Some(rgb));
    if let Some((column, _)) = colour {
        visit.seen.rgb_unfiltered.include(column, None);
    }
}

/// Adds the points of a batch that `selection` names (`None`: all `points`) to ranges and counts. `read`: its columns as
/// they are stored.
pub(super) fn add(
    pass: &Context<'_>,
    visit: &mut Visit<'_>,
    read: &[&Column],
    points: usize,
    selection: Option<&[u32]>,
    stats: &mut Stats,
) {
    let schema = &pass.intake.schema;
    let rgb = schema.rgb();
    let columns = &visit.intake.columns;
    for (column, place) in read.iter().zip(columns) {
        let Some(place) = *place else { continue };
        let attribute = &schema.attributes[place];
        if matches!(attribute.ty, AttributeType::Int64 | AttributeType::UInt64) {
            stats.count_doubled(place, &doubled(column, attribute.elements, selection));
        }
        if Some(place) == rgb {
            visit.seen.rgb.include(column, selection);
        } else {
            stats.ranges[place].include(column, selection);
        }
        if attribute.name == "classification" && attribute.elements == 1 {
            match (column, selection) {
                (Column::UInt8(values), Some(s)) => {
                    s.iter().for_each(|i| stats.classes[usize::from(values[*i as usize])] += 1);
                }
                (Column::UInt8(values), None) => count_classes(values, &mut stats.classes),
                (column, _) => stats.odd_classes.merge(&odd_classes(column, selection)),
            }
        }
    }
    for place in (0..schema.attributes.len()).filter(|p| !visit.intake.has(Some(*p))) {
        // What this source does not have is stored as zeros.
        if Some(place) == rgb {
            visit.seen.rgb.add([0; 3]);
        } else {
            stats.ranges[place].add(0.0);
        }
        if schema.attributes[place].name == "classification" {
            let kept = selection.map_or(points, <[u32]>::len);
            stats.classes[0] += kept as u64;
        }
    }
}

/// Classes that are no whole numbers of single precision, in which binary trees have them.
#[allow(clippy::unnecessary_cast)] // one body for every type of column
fn odd_classes(column: &Column, selection: Option<&[u32]>) -> Changes {
    let mut changes = Changes::default();
    if matches!(column.ty(), AttributeType::Int8 | AttributeType::Int16 | AttributeType::UInt16) {
        return changes;
    }
    let mut add = |class: f64| {
        if !class.is_finite() {
            changes.not_finite += 1;
        } else if class.round().abs() > GREATEST_CLASS {
            changes.leave_out(class);
        } else if class.fract() != 0.0 {
            changes.round(class);
        }
    };
    with_column!(column, values => match selection {
        Some(s) => s.iter().for_each(|i| add(values[*i as usize] as f64)),
        None => values.iter().for_each(|v| add(*v as f64)),
    });
    changes
}

/// Four tables, so that runs of one class do not wait for the same counter.
fn count_classes(values: &[u8], into: &mut [u64]) {
    let mut tables = [[0u32; 256]; 4];
    let (quads, rest) = values.as_chunks::<4>();
    for quad in quads {
        for (table, v) in tables.iter_mut().zip(quad) {
            table[usize::from(*v)] += 1;
        }
    }
    rest.iter().for_each(|v| tables[0][usize::from(*v)] += 1);
    for (class, count) in into.iter_mut().enumerate() {
        *count += tables.iter().map(|t| u64::from(t[class])).sum::<u64>();
    }
}
