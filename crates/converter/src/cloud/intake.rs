//! What is read of the sources: the attributes that some output needs, and nothing else.

use pointmill_format::Wanted;

use super::widening::Group;
use crate::plan::{CURVATURE, Derive, Duplicates, NORMALS, Orient, Plan, RADIUS, RgbDepth};
use crate::sources::{Layout, Recast, Schema, Source, Sources};

/// The attributes that are read, and where each source has them.
pub(crate) struct Intake {
    /// The layout of stored records.
    pub(crate) schema: Schema,
    /// Where a stored record has the mark that tells apart points which only the lattice makes equal; needed if duplicates
    /// are to be dropped. No output writes it.
    pub(crate) mark: Option<usize>,
    /// What is computed, by attribute of the schema.
    pub(crate) derived: DerivedFields,
    /// Names of the attributes of the inputs that no output needs.
    pub(crate) unread: Vec<String>,
    /// By layout of the sources.
    layouts: Vec<LayoutIntake>,
    rgb_depth: RgbDepth,
    orient: Orient,
}

/// Where records have what is computed: index of the schema.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct DerivedFields {
    /// Components of the normal, and the curvature.
    pub(crate) normal: Option<([usize; 3], usize)>,
    pub(crate) radius: Option<usize>,
}

impl DerivedFields {
    /// What a record has in the place of the curvature while those of the normal have the direction to the scanner.
    pub(crate) const IS_DIRECTION: f32 = -1.0;

    fn of(derive: &Derive, schema: &Schema) -> Self {
        let find = |name: &str| schema.find(name).filter(|_| derive.makes(name));
        let normal = match (NORMALS.map(find), find(CURVATURE)) {
            ([Some(x), Some(y), Some(z)], Some(curvature)) => Some(([x, y, z], curvature)),
            _ => None,
        };
        Self { normal, radius: find(RADIUS) }
    }

    /// All of them.
    pub(crate) fn all(&self) -> impl Iterator<Item = usize> {
        let of_normal = self.normal.into_iter().flat_map(|([x, y, z], curvature)| [x, y, z, curvature]);
        of_normal.chain(self.radius)
    }
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
            // a part of a normal is none
            let has = |name: &&str| layout.columns.iter().any(|c| all.attributes[c.attribute].name == *name);
            let has_normal = NORMALS.iter().all(has);
            let is_replaced = |i: usize| {
                let name = all.attributes[i].name.as_str();
                plan.derive.replaces(name) || plan.derive.makes(name) && NORMALS.contains(&name) && !has_normal
            };
            let place = |i: usize| places[i].filter(|_| !is_replaced(i));
            let columns: Vec<Option<usize>> = layout.columns.iter().map(|c| place(c.attribute)).collect();
            let read = layout.columns.iter().enumerate().filter(|(i, _)| columns[*i].is_some());
            let recasts = read.filter_map(|(i, c)| Some((i, c.recast.clone()?))).collect();
            let is_filtered = |i: usize| plan.filter.classes.is_some() && layout.attributes[i].name == "classification";
            let wanted = columns.iter().enumerate().map(|(i, c)| c.is_some() || is_filtered(i)).collect::<Wanted>();
            let mut present = vec![false; schema.attributes.len()];
            columns.iter().flatten().for_each(|&i| present[i] = true);
            LayoutIntake { columns, recasts, wanted, present }
        };
        let layouts = sources.layouts.iter().map(of_layout).collect();
        let derived = DerivedFields::of(&plan.derive, &schema);
        Self { schema, mark, derived, unread, layouts, rgb_depth: plan.rgb_depth, orient: plan.derive.orient }
    }

    /// What is read of a source.
    pub(crate) fn of(&self, source: &Source) -> &LayoutIntake {
        &self.layouts[source.layout as usize]
    }

    /// True if records of a source have the direction to the scanner until normals are computed.
    pub(crate) fn wants_directions(&self, source: &Source) -> bool {
        let has = |(normal, _): ([usize; 3], usize)| normal.into_iter().any(|i| self.of(source).has(Some(i)));
        self.orient == Orient::Scanner && self.derived.normal.is_some_and(|fields| !has(fields))
    }

    /// Byte offsets in a record of what a direction takes the place of: the normal, and the curvature.
    pub(crate) fn directed(&self) -> Option<([usize; 3], usize)> {
        let at = |i: usize| self.schema.offsets[i];
        self.derived.normal.map(|(normal, curvature)| (normal.map(at), at(curvature)))
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
