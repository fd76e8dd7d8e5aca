//! Which attributes which output needs: nothing else is read.

use pointmill_format::AttributeType;

use crate::error::ConvertError;
use crate::plan::{AttributeChoice, Plan, Target};
use crate::report::DroppedAttribute;
use crate::schema::Schema;

/// The name under which a binary tree takes the colour as four bytes.
pub(crate) const RGBA: &str = "rgba";

/// For each attribute of the inputs: does some output need it?
///
/// # Errors
/// A name that was asked for and is not there.
pub(crate) fn needed(plan: &Plan, all: &Schema) -> Result<Vec<bool>, ConvertError> {
    check_names(plan, all)?;
    let by_any = |i: usize| plan.targets.iter().any(|t| is_needed(t, &plan.attributes, all, i));
    Ok((0..all.attributes.len()).map(by_any).collect())
}

fn is_needed(target: &Target, choice: &AttributeChoice, all: &Schema, i: usize) -> bool {
    let name = &*all.attributes[i].name;
    let core = match target {
        Target::Potree2 => false,
        Target::Bintree(_) => class(all) == Some(i),
        Target::Batches(_) => colour(all) == Some(i),
    };
    let usual = matches!(target, Target::Potree2);
    core || match choice {
        AttributeChoice::Usual => usual,
        AttributeChoice::All | AttributeChoice::Scene => true,
        AttributeChoice::List(names) => {
            let is_rgba = |n: &String| n == RGBA && matches!(target, Target::Bintree(_)) && all.rgb() == Some(i);
            names.iter().any(|n| n == name || is_rgba(n))
        }
    }
}

/// The classification, of any integer type.
pub(crate) fn class(schema: &Schema) -> Option<usize> {
    schema.find("classification").filter(|&i| schema.attributes[i].elements == 1)
}

/// What batches are coloured by: the colour, else the intensity.
pub(crate) fn colour(schema: &Schema) -> Option<usize> {
    let intensity = || {
        let is_usual = |&i: &usize| {
            let a = &schema.attributes[i];
            a.elements == 1 && matches!(a.ty, AttributeType::UInt16 | AttributeType::UInt8 | AttributeType::Float32)
        };
        schema.find("intensity").filter(is_usual)
    };
    schema.rgb().or_else(intensity)
}

fn check_names(plan: &Plan, all: &Schema) -> Result<(), ConvertError> {
    let AttributeChoice::List(names) = &plan.attributes else { return Ok(()) };
    let takes_rgba = plan.targets.iter().any(|t| matches!(t, Target::Bintree(_))) && all.rgb().is_some();
    let is_known = |n: &&String| *n == "position" || all.find(n).is_some() || *n == RGBA && takes_rgba;
    match names.iter().find(|n| !is_known(n)) {
        None => Ok(()),
        Some(name) => {
            let known: Vec<&str> = all.attributes.iter().map(|a| a.name.as_str()).collect();
            Err(ConvertError::Usage(format!("--attributes: no input has \"{name}\"; there are: {}", known.join(", "))))
        }
    }
}

/// Attributes of the schema that were read for other outputs or are not wanted, and those that were not read at all.
pub(crate) fn dropped(
    schema: &Schema,
    unread: &[String],
    kept: impl Fn(usize) -> bool,
    why: &str,
) -> Vec<DroppedAttribute> {
    let read = (0..schema.attributes.len()).filter(|i| !kept(*i)).map(|i| &schema.attributes[i].name);
    read.chain(unread)
        .map(|name| DroppedAttribute { name: name.clone(), why: why.to_owned(), constant: None })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{BatchesSettings, BintreeSettings};
    use pointmill_format::Attribute;

    fn schema() -> Schema {
        Schema::new(vec![
            Attribute::new("rgb", AttributeType::UInt16, 3),
            Attribute::new("intensity", AttributeType::UInt16, 1),
            Attribute::new("classification", AttributeType::UInt8, 1),
        ])
    }

    fn plan(targets: Vec<Target>, attributes: AttributeChoice) -> Plan {
        Plan { targets, attributes, ..Plan::new(vec![], "out".into()) }
    }

    #[test]
    fn each_format_reads_what_it_is_made_for_and_what_was_asked() {
        let (tree, batches) =
            (Target::Bintree(BintreeSettings::default()), Target::Batches(BatchesSettings::default()));
        let of = |targets, choice| needed(&plan(targets, choice), &schema()).unwrap();
        assert_eq!(of(vec![Target::Potree2], AttributeChoice::Usual), [true; 3]);
        assert_eq!(of(vec![tree], AttributeChoice::Usual), [false, false, true]);
        assert_eq!(of(vec![batches], AttributeChoice::Usual), [true, false, false]);
        assert_eq!(of(vec![tree, batches], AttributeChoice::Usual), [true, false, true]);
        let list = |names: &[&str]| AttributeChoice::List(names.iter().map(|n| (*n).to_owned()).collect());
        assert_eq!(of(vec![Target::Potree2], list(&["intensity"])), [false, true, false]);
        assert_eq!(of(vec![tree], list(&["rgba"])), [true, false, true]);
        assert!(needed(&plan(vec![Target::Potree2], list(&["rgba"])), &schema()).is_err());
    }
}
