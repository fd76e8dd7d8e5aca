//! What the points of the cloud lack of the sources' attributes: values that some sources do not have, and values that
//! could not stay as they were.

use pointmill_format::Changes;

use super::intake::Intake;
use super::stats::Stats;
use crate::sources::Sources;
use crate::warning::Warning;

/// Of one attribute.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Shortfall {
    /// Points without a value: 0 was taken.
    pub(crate) missing_points: u64,
    /// Files that have such points.
    pub(crate) missing_files: u64,
    /// Values that became others while they were read.
    pub(crate) changes: Changes,
}

/// By index of the schema.
pub(super) fn shortfalls(sources: &Sources, intake: &Intake, stats: &Stats) -> Vec<Shortfall> {
    let is_derived = |attribute: usize| intake.derived.all().any(|i| i == attribute);
    let of_attribute = |attribute: usize| {
        let mut sum = Shortfall::default();
        if is_derived(attribute) {
            return sum; // every point gets it
        }
        for (source, seen) in sources.all.iter().zip(&stats.sources) {
            let changes = seen.changes.get(attribute).copied().unwrap_or_default();
            let missing = if intake.of(source).has(Some(attribute)) { changes.missing } else { seen.kept };
            sum.missing_points += missing;
            sum.missing_files += u64::from(missing > 0);
            sum.changes.merge(&Changes { missing: 0, ..changes });
        }
        sum
    };
    (0..intake.schema.attributes.len()).map(of_attribute).collect()
}

/// A line for each attribute with changed values, and one for all attributes that the same points lack.
pub(super) fn warnings(intake: &Intake, shortfalls: &[Shortfall]) -> Vec<Warning> {
    let names = intake.schema.attributes.iter().map(|a| &a.name);
    let mut missing: Vec<(u64, u64, Vec<String>)> = Vec::new();
    let mut changed = Vec::new();
    for (name, shortfall) in names.zip(shortfalls) {
        let Shortfall { missing_points: points, missing_files: files, changes } = *shortfall;
        match missing.iter_mut().find(|(p, f, _)| (*p, *f) == (points, files)) {
            Some((.., names)) => names.push(name.clone()),
            None if points > 0 => missing.push((points, files, vec![name.clone()])),
            None => {}
        }
        if !changes.is_empty() {
            changed.push(Warning::ValuesChanged { attribute: name.clone(), output: None, changes });
        }
    }
    let missing = missing.into_iter();
    let missing = missing.map(|(points, files, attributes)| Warning::ValuesMissing { attributes, points, files });
    changed.into_iter().chain(missing).collect()
}
