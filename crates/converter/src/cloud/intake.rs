//! What is read of the sources: the attributes that some output needs, and nothing else.

use pointmill_format::Wanted;

use crate::plan::{Duplicates, Plan};
use crate::sources::{Recast, Schema, Sources};

/// The attributes that are read, and where each source has them.
pub(crate) struct Intake {
    /// The layout of stored records.
    pub(crate) schema: Schema,
    /// Where a stored record has the mark that tells apart points which only the lattice makes equal; needed if duplicates
    /// are to be dropped. No output writes it.
    pub(crate) mark: Option<usize>,
    /// Names of the attributes of the inputs that no output needs.
    pub(crate) unread: Vec<String>,
    /// By source.
    pub(crate) sources: Vec<SourceIntake>,
}

/// What is read of a source.
pub(crate) struct SourceIntake {
    /// Where each of its columns goes in the schema; `None`: no output needs it.
    pub(crate) columns: Vec<Option<usize>>,
    /// Which columns do not go there as they were read.
    pub(crate) recasts: Vec<(usize, Recast)>,
    /// The columns to decode: those, and what the filter looks at.
    pub(crate) wanted: Wanted,
}

impl SourceIntake {
    /// True if the source has the attribute with that index in the schema.
    pub(crate) fn has(&self, attribute: Option<usize>) -> bool {
        attribute.is_some() && self.columns.contains(&attribute)
    }
}

impl Intake {
    /// `needed`: for each attribute of the sources, whether some output needs it.
    /// `wants_marks`: positions that the lattice alone makes equal are to be told apart.
    pub(crate) fn new(plan: &Plan, sources: &Sources, needed: &[bool], wants_marks: bool) -> Self {
        let all = &sources.attributes;
        let (mut schema, places) = all.reduce(needed);
        let mark = (wants_marks || plan.duplicates == Duplicates::Drop).then(|| schema.add_mark());
        let unread = all.attributes.iter().zip(needed).filter(|(_, needed)| !**needed);
        let unread = unread.map(|(a, _)| a.name.clone()).collect();
        let of_source = |source: &crate::sources::Source| {
            let columns: Vec<Option<usize>> = source.columns.iter().map(|c| places[c.attribute]).collect();
            let read = source.columns.iter().enumerate().filter(|(i, _)| columns[*i].is_some());
            let recasts = read.filter_map(|(i, c)| Some((i, c.recast.clone()?))).collect();
            let attributes = &source.scan.info().attributes;
            let is_filtered = |i: usize| plan.filter.classes.is_some() && attributes[i].name == "classification";
            let wanted = columns.iter().enumerate().map(|(i, c)| c.is_some() || is_filtered(i)).collect::<Wanted>();
            SourceIntake { columns, recasts, wanted }
        };
        let of_sources = sources.all.iter().map(of_source).collect();
        Self { schema, mark, unread, sources: of_sources }
    }
}
