//! Ranges of attributes, and points by class.

use pointmill_format::{Column, PointBatch};

use super::context::Context;
use crate::cloud::Stats;

/// What colour values mean is a property of the whole file: points that are omitted count as well.
pub(super) fn unfiltered_colour(pass: &Context<'_>, source: usize, batch: &PointBatch, stats: &mut Stats) {
    let places = &pass.intake.sources[source].columns;
    let Some(rgb) = pass.intake.schema.rgb() else { return };
    let colour = batch.columns.iter().zip(places).find(|(_, place)| **place == Some(rgb));
    if let Some((column, _)) = colour {
        stats.sources[source].rgb_unfiltered.include(column, None);
    }
}

/// Adds the points of a batch that `selection` names (`None`: all) to ranges and counts.
pub(super) fn add(pass: &Context<'_>, source: usize, batch: &PointBatch, selection: Option<&[u32]>, stats: &mut Stats) {
    let schema = &pass.intake.schema;
    let rgb = schema.rgb();
    let columns = &pass.intake.sources[source].columns;
    for (column, place) in batch.columns.iter().zip(columns) {
        let Some(place) = *place else { continue };
        if Some(place) == rgb {
            stats.sources[source].rgb.include(column, selection);
        } else {
            stats.ranges[place].include(column, selection);
        }
        if schema.attributes[place].name == "classification"
            && let Column::UInt8(values) = column
        {
            match selection {
                Some(s) => s.iter().for_each(|i| stats.classes[usize::from(values[*i as usize])] += 1),
                None => count_classes(values, &mut stats.classes),
            }
        }
    }
    for place in (0..schema.attributes.len()).filter(|p| !columns.contains(&Some(*p))) {
        // What this source does not have is stored as zeros.
        if Some(place) == rgb {
            stats.sources[source].rgb.add(0.0);
        } else {
            stats.ranges[place].add(0.0);
        }
        if schema.attributes[place].name == "classification" {
            let kept = selection.map_or(batch.len(), <[u32]>::len);
            stats.classes[0] += kept as u64;
        }
    }
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
