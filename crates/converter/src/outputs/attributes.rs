//! Which attributes a dataset keeps, and why others are omitted.

use pointmill_format::{Attribute, AttributeType, Changes, DatasetKind};

use crate::cloud::{Range, Relation};
use crate::plan::{AttributeChoice, Derive, Plan};
use crate::report::{ChangedAttribute, DropReason, DroppedAttribute};
use crate::sources::Schema;
use crate::warning::Warning;

/// Attributes that go into a dataset, and those that do not.
pub(crate) struct Choice {
    /// Indices of the schema, in output order.
    pub(crate) kept: Vec<usize>,
    pub(crate) dropped: Vec<DroppedAttribute>,
}

/// All, those that the scene requires, or those that were named; and what is computed. `unread`: names that were not even read; `relations`: what
/// attributes follow from, nothing where the format could not give them back.
pub(crate) fn choose(
    plan: &Plan,
    schema: &Schema,
    unread: &[String],
    ranges: &[Range],
    relations: &[Option<Relation>],
) -> Choice {
    let all = 0..schema.attributes.len();
    match &plan.attributes {
        AttributeChoice::Usual | AttributeChoice::All => Choice { kept: all.collect(), dropped: Vec::new() },
        AttributeChoice::Scene => {
            let (mut kept, mut dropped) = (Vec::new(), Vec::new());
            for i in all {
                match not_required(schema, ranges, relations, i).filter(|_| !is_derived(&plan.derive, schema, i)) {
                    Some(why) => dropped.push(DroppedAttribute { name: schema.attributes[i].name.clone(), why }),
                    None => kept.push(i),
                }
            }
            Choice { kept, dropped }
        }
        AttributeChoice::List(names) => {
            // A name that no input has was refused before anything was read.
            let mut kept: Vec<usize> = Vec::new();
            for i in names.iter().filter_map(|name| schema.find(name)).chain(derived(&plan.derive, schema)) {
                if !kept.contains(&i) {
                    kept.push(i);
                }
            }
            let dropped = left_out(schema, unread, |i| kept.contains(&i), &DropReason::NotRequested);
            Choice { kept, dropped }
        }
    }
}

/// What is computed, by its index in the schema: it goes into every output, or nobody would have asked for it.
pub(super) fn derived(derive: &Derive, schema: &Schema) -> impl Iterator<Item = usize> {
    derive.names().filter_map(|name| schema.find(name))
}

/// True if an attribute of the schema is computed.
pub(super) fn is_derived(derive: &Derive, schema: &Schema, i: usize) -> bool {
    derive.makes(&schema.attributes[i].name)
}

/// Why the scene does not require an attribute of the schema; `None`: it does.
pub(super) fn not_required(
    schema: &Schema,
    ranges: &[Range],
    relations: &[Option<Relation>],
    i: usize,
) -> Option<DropReason> {
    let name = |i: usize| schema.attributes[i].name.clone();
    match (ranges[i].constant(), relations.get(i).and_then(Option::as_ref)) {
        (Some(values), _) => Some(DropReason::Constant(values.to_vec())),
        (None, Some(Relation::SameAs(other))) => Some(DropReason::SameAs(name(*other))),
        (None, Some(Relation::FollowsFrom { attribute, table })) => {
            Some(DropReason::FollowsFrom { attribute: name(*attribute), table: table.clone() })
        }
        (None, None) => None,
    }
}

/// What the values of an attribute become in a format, if not all of them can be held: for the report, and in words.
pub(super) fn changed(
    kind: DatasetKind,
    attribute: &Attribute,
    stored_as: AttributeType,
    changes: &Changes,
) -> Option<(ChangedAttribute, Warning)> {
    let name = attribute.name.clone();
    let output = Some((kind, stored_as));
    let warning = Warning::ValuesChanged { attribute: name.clone(), output, changes: *changes };
    (!changes.is_empty()).then(|| (ChangedAttribute { name, changed: (*changes).into() }, warning))
}

/// Attributes of the schema that are not kept, and those that were not read at all.
pub(super) fn left_out(
    schema: &Schema,
    unread: &[String],
    kept: impl Fn(usize) -> bool,
    why: &DropReason,
) -> Vec<DroppedAttribute> {
    let read = (0..schema.attributes.len()).filter(|i| !kept(*i)).map(|i| &schema.attributes[i].name);
    read.chain(unread).map(|name| DroppedAttribute { name: name.clone(), why: why.clone() }).collect()
}
