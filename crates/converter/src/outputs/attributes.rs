//! Which attributes a dataset keeps, and why others are omitted.

use pointmill_format::{Attribute, AttributeType, Changes, DatasetKind};

use crate::cloud::Range;
use crate::plan::AttributeChoice;
use crate::report::{ChangedAttribute, DropReason, DroppedAttribute};
use crate::sources::Schema;
use crate::warning::Warning;

/// Attributes that go into a dataset, and those that do not.
pub(crate) struct Choice {
    /// Indices of the schema, in output order.
    pub(crate) kept: Vec<usize>,
    pub(crate) dropped: Vec<DroppedAttribute>,
}

/// All, those that vary, or those that were named. `unread`: names that were not even read.
pub(crate) fn choose(choice: &AttributeChoice, schema: &Schema, unread: &[String], ranges: &[Range]) -> Choice {
    let all = 0..schema.attributes.len();
    match choice {
        AttributeChoice::Usual | AttributeChoice::All => Choice { kept: all.collect(), dropped: Vec::new() },
        AttributeChoice::Scene => {
            let (kept, constant): (Vec<usize>, Vec<usize>) = all.partition(|i| ranges[*i].constant().is_none());
            let dropped = constant.into_iter().map(|i| {
                let values = ranges[i].constant().unwrap_or_default().to_vec();
                DroppedAttribute { name: schema.attributes[i].name.clone(), why: DropReason::Constant(values) }
            });
            Choice { kept, dropped: dropped.collect() }
        }
        AttributeChoice::List(names) => {
            // A name that no input has was refused before anything was read.
            let mut kept: Vec<usize> = Vec::new();
            for i in names.iter().filter_map(|name| schema.find(name)) {
                if !kept.contains(&i) {
                    kept.push(i);
                }
            }
            let dropped = left_out(schema, unread, |i| kept.contains(&i), &DropReason::NotRequested);
            Choice { kept, dropped }
        }
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
