//! The colours of formats that show every point in 8 bits, and what they show where the scans have none.

use pointmill_format::batches::grey;
use pointmill_format::{AttributeType, DatasetKind};

use super::number::number;
use crate::cloud::Cloud;
use crate::sources::Schema;
use crate::warning::{ColourNote, Warning};

/// What points are coloured by: the colour, else the intensity.
pub(super) fn colour_of(schema: &Schema) -> Option<usize> {
    let intensity = || schema.find("intensity").filter(|&i| schema.attributes[i].elements == 1);
    schema.rgb().or_else(intensity)
}

/// The grey of one intensity, given as stored bytes, in a cloud whose intensities span `least` to `greatest`.
pub(super) fn grey_of(bytes: &[u8], ty: AttributeType, least: f64, greatest: f64) -> u8 {
    match (ty, bytes) {
        (AttributeType::UInt8, [v, ..]) => grey(u16::from(*v), least as u16, greatest as u16),
        (AttributeType::UInt16, [a, b, ..]) => grey(u16::from_le_bytes([*a, *b]), least as u16, greatest as u16),
        _ => match number(bytes, ty) {
            v if v.is_nan() => 0,
            v if greatest > least => ((v - least) / (greatest - least) * 255.0 + 0.5) as u8,
            _ => 255,
        },
    }
}

/// What there is to say of the colours of a format.
pub(super) fn colour_notes(cloud: &Cloud<'_>, format: DatasetKind) -> Vec<Warning> {
    let schema = cloud.schema();
    let notes = match (schema.rgb(), colour_of(schema)) {
        (Some(rgb), _) => {
            let coloured = |i: &usize| cloud.intake.of(&cloud.sources.all[*i]).has(Some(rgb));
            let sources: Vec<usize> =
                (0..cloud.sources.all.len()).filter(|i| cloud.stats.sources[*i].kept > 0).collect();
            let is_narrowed = sources.iter().any(|i| coloured(i) && !cloud.facts.widening.is_narrow(*i));
            let (without, inputs) = (sources.iter().filter(|i| !coloured(i)).count(), sources.len());
            let narrowed = is_narrowed.then_some(ColourNote::Narrowed);
            let black = (without > 0).then_some(ColourNote::Black { without, inputs });
            narrowed.into_iter().chain(black).collect()
        }
        (None, Some(intensity)) => {
            let [least, greatest] = extremes(cloud, intensity);
            vec![ColourNote::Grey { least, greatest }]
        }
        (None, None) => vec![ColourNote::White],
    };
    notes.into_iter().map(|note| Warning::Colours { format, note }).collect()
}

/// Least and greatest value of an attribute of one element; zeros if there are none.
pub(super) fn extremes(cloud: &Cloud<'_>, attribute: usize) -> [f64; 2] {
    let range = &cloud.facts.ranges[attribute];
    if range.is_empty() { [0.0; 2] } else { [range.min[0], range.max[0]] }
}
