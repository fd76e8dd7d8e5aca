//! What is read of the sources: the attributes that some output needs, and nothing else.

use pointmill_format::Wanted;

use super::widening::Group;
use crate::plan::{Duplicates, Plan, RgbDepth};
use crate::sources::{Layout, Recast, Schema, Source, Sources};

/// The attributes that are read, and where each source has them.
pub(crate) struct Intake {
    /// The layout of stored records.
    pub(crate) schema: Schema,
    /// Where a stored record has the mark that tells apart points which only the lattice makes equal; needed if duplicates
    /// are to be dropped. No output writes it.
    pub(crate) mark: Option<usize>,
    /// Names of the attributes of the inputs that no output needs.
    pub(crate) unread: Vec<String>,
    /// By layout of the sources.
    layouts: Vec<LayoutIntake>,
    rgb_depth: RgbDepth,
}

/// What is read of the sources of one layout.
pub(crate) struct LayoutIntake {
    /// Where each of its columns goes in the schema; `None`: no output needs it.
    pub(crate) columns: Vec<Option<usize>>,
    /// Which columns do not go there as they were read.
    pub(crate) recasts: Vec<(usize, Recast)>,
    /// The columns to decode: those, and what the filter looks at.
    pub(crate) wanted: Wanted,
    /// By attribute of the schema: whether one of the columns is it.
    present: Vec<bool>,
}

impl LayoutIntake {
    /// True if these sources have the attribute with that index in the schema.
    pub(crate) fn has(&self, attribute: Option<usize>) -> bool {
        attribute.and_then(|i| self.present.get(i)).copied().unwrap_or(false)
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
        let of_layout = |layout: &Layout| {
            let columns: Vec<Option<usize>> = layout.columns.iter().map(|c| places[c.attribute]).collect();
            let read = layout.columns.iter().enumerate().filter(|(i, _)| columns[*i].is_some());
            let recasts = read.filter_map(|(i, c)| Some((i, c.recast.clone()?))).collect();
            let is_filtered = |i: usize| plan.filter.classes.is_some() && layout.attributes[i].name == "classification";
            let wanted = columns.iter().enumerate().map(|(i, c)| c.is_some() || is_filtered(i)).collect::<Wanted>();
            let mut present = vec![false; schema.attributes.len()];
            columns.iter().flatten().for_each(|&i| present[i] = true);
            LayoutIntake { columns, recasts, wanted, present }
        };
        let layouts = sources.layouts.iter().map(of_layout).collect();
        Self { schema, mark, unread, layouts, rgb_depth: plan.rgb_depth }
    }

    /// What is read of a source.
    pub(crate) fn of(&self, source: &Source) -> &LayoutIntake {
        &self.layouts[source.layout as usize]
    }

    /// The sources whose records may be in the blocks of the source with that index: those whose colours turn out to be
    /// of the same depth, whatever they are.
    pub(crate) fn group(&self, index: usize, source: &Source) -> Group {
        match self.rgb_depth {
            _ if !self.of(source).has(self.schema.rgb()) => Group::WIDE,
            RgbDepth::Sixteen => Group::WIDE,
            RgbDepth::Auto if source.rgb_is_16_bit => Group::WIDE,
            RgbDepth::Eight => Group::NARROW,
            RgbDepth::Auto => Group::of_source(index),
        }
    }
}
