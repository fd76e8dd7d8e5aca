//! What is known once every point was read, beside counts: what colours mean, ranges as outputs have them, the
//! coordinate reference system.

use super::intake::Intake;
use super::range::Range;
use super::relations::Relation;
use super::shortfall::{self, Shortfall};
use super::stats::{SourceStats, Stats};
use super::widening::Widening;
use crate::error::{ConvertError, InputFault};
use crate::plan::{Plan, RgbDepth};
use crate::sources::{ResolvedCrs, Sources, resolve_crs_of_all};
use crate::warning::Warning;

/// Facts about all points.
pub(crate) struct Facts {
    /// Colours that are 8 bits deep.
    pub(crate) widening: Widening,
    /// Byte offset of the classification in a stored record, if it is one byte.
    pub(crate) class: Option<usize>,
    /// Ranges as outputs have them, by index of the schema.
    pub(crate) ranges: Vec<Range>,
    /// What attributes follow from that the scene does not require, by index of the schema.
    pub(crate) relations: Vec<Option<Relation>>,
    /// What is missing or changed of each attribute, by index of the schema.
    pub(crate) shortfalls: Vec<Shortfall>,
    pub(crate) crs: ResolvedCrs,
}

impl Facts {
    pub(super) fn new(
        plan: &Plan,
        sources: &Sources,
        intake: &Intake,
        stats: &Stats,
        warnings: &mut Vec<Warning>,
    ) -> Result<Self, ConvertError> {
        let shortfalls = shortfall::shortfalls(sources, intake, stats);
        warnings.extend(shortfall::warnings(intake, &shortfalls));
        let schema = &intake.schema;
        let mut ranges = stats.ranges.clone();
        let mut widening = Widening::default();
        if let Some(rgb) = schema.rgb() {
            let all = sources.all.iter().zip(&stats.sources);
            let depths: Vec<bool> =
                all.map(|(s, stats)| is_eight_bit(plan.rgb_depth, s.rgb_is_16_bit, stats)).collect();
            let mut narrow = vec![false; sources.all.len()];
            for (i, seen) in stats.sources.iter().enumerate().filter(|(_, s)| s.kept > 0) {
                let source = &sources.all[i];
                let mut range = Range::new(3);
                if let Some([min, max]) = seen.rgb.ends() {
                    (range.min, range.max) = (min.to_vec(), max.to_vec());
                }
                if intake.of(source).has(Some(rgb)) && depths[i] {
                    if plan.rgb_depth == RgbDepth::Eight && !seen.rgb.fits_eight_bits() {
                        return Err(InputFault::DeepColours { path: source.path.to_path_buf() }.into());
                    }
                    narrow[i] = true;
                    range.min.iter_mut().chain(&mut range.max).for_each(|v| *v *= 257.0);
                }
                ranges[rgb].merge(&range);
            }
            widening = Widening::new(Some(schema.offsets[rgb]), narrow);
            warnings.extend(mixed_depths(sources, intake, stats, &depths, rgb));
        }
        let crs = resolve_crs_of_all(plan, &sources.all, warnings)?;
        let relations = match &stats.relations {
            Some(relations) => {
                let is_constant: Vec<bool> = ranges.iter().map(|range| range.constant().is_some()).collect();
                let mut chosen = relations.choose(schema, &is_constant);
                // what is computed is not there yet
                let is_derived = |i: usize| intake.derived.all().any(|derived| derived == i);
                for (i, relation) in chosen.iter_mut().enumerate() {
                    let of = match relation {
                        Some(Relation::SameAs(other)) => Some(*other),
                        Some(Relation::FollowsFrom { attribute, .. }) => Some(*attribute),
                        None => None,
                    };
                    if is_derived(i) || of.is_some_and(is_derived) {
                        *relation = None;
                    }
                }
                chosen
            }
            None => vec![None; schema.attributes.len()],
        };
        let class = schema.find("classification").filter(|&i| schema.attributes[i].size() == 1);
        Ok(Self { widening, class: class.map(|i| schema.offsets[i]), ranges, relations, shortfalls, crs })
    }
}

/// True if the colour values of a source have 8 bits; what the file declares comes before what its values look like.
fn is_eight_bit(policy: RgbDepth, is_declared_16_bit: bool, source: &SourceStats) -> bool {
    match policy {
        RgbDepth::Eight => true,
        RgbDepth::Sixteen => false,
        RgbDepth::Auto if is_declared_16_bit => false,
        RgbDepth::Auto => {
            !source.rgb.is_empty() && source.rgb.fits_eight_bits() && source.rgb_unfiltered.fits_eight_bits()
        }
    }
}

fn mixed_depths(sources: &Sources, intake: &Intake, stats: &Stats, eight: &[bool], rgb: usize) -> Option<Warning> {
    let coloured = |i: &usize| intake.of(&sources.all[*i]).has(Some(rgb)) && stats.sources[*i].kept > 0;
    // A file without any colour value above 0 is no sign of anything.
    let lit = |i: &usize| stats.sources[*i].rgb.is_lit();
    let coloured: Vec<usize> = (0..sources.all.len()).filter(coloured).filter(lit).collect();
    let narrow: Vec<usize> = coloured.iter().copied().filter(|i| eight[*i]).collect();
    let first = *narrow.first().filter(|_| narrow.len() < coloured.len())?;
    let first = sources.all[first].path.to_path_buf();
    Some(Warning::MixedRgbDepth { eight_bit: narrow.len(), coloured: coloured.len(), first })
}
