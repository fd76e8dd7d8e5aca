//! What every dataset says of its making: what a validator or a later run needs to know, and no viewer reads.

use pointmill_format::AttributeType;
use serde_json::{Map, Value, json};

use crate::cloud::Cloud;
use crate::report::{DropReason, DroppedAttribute, filter_settings};

/// Our own key of a dataset. `dropped`: attributes that the dataset lacks.
pub(super) fn own_key(cloud: &Cloud<'_>, dropped: &[DroppedAttribute]) -> Map<String, Value> {
    let plan = cloud.plan;
    let mut own = Map::new();
    own.insert("version".into(), env!("CARGO_PKG_VERSION").into());
    own.insert("latticeOffset".into(), json!(cloud.lattice.lattice.offset));
    own.insert("rgbDepth".into(), plan.rgb_depth.name().into());
    own.insert("duplicates".into(), plan.duplicates.name().into());
    let filter = filter_settings(&cloud.filter());
    if !filter.is_empty() {
        own.insert("filter".into(), filter.into());
    }
    if let Some(wkt) = cloud.facts.crs.wkt_text() {
        own.insert("wkt".into(), wkt.into());
    }
    // Those that were not requested are not recorded: which there were depends on the kind of the scans.
    let constant = |d: &DroppedAttribute| match &d.why {
        DropReason::Constant(values) => Some((d.name.clone(), json!(values))),
        _ => None,
    };
    let constants: Map<_, _> = dropped.iter().filter_map(constant).collect();
    if !constants.is_empty() {
        own.insert("attributesDropped".into(), constants.into());
    }
    // in order of name: in that of the sources they would differ once the dataset is converted again
    let mut in_order: Vec<&DroppedAttribute> = dropped.iter().collect();
    in_order.sort_by(|a, b| a.name.cmp(&b.name));
    let omitted: Vec<Value> = in_order.into_iter().filter_map(|d| omitted(cloud, d)).collect();
    if !omitted.is_empty() {
        own.insert("attributesOmitted".into(), omitted.into());
    }
    own
}

/// How the values of an attribute that is not stored are found again; `None` for those that are gone. JSON has no place for
/// 64-bit integers that doubles do not hold.
fn omitted(cloud: &Cloud<'_>, dropped: &DroppedAttribute) -> Option<Value> {
    let schema = cloud.schema();
    let attribute = &schema.attributes[schema.find(&dropped.name)?];
    let is_wide = matches!(attribute.ty, AttributeType::Int64 | AttributeType::UInt64);
    // what colours mean is not in the values that were read
    if is_wide || Some(&attribute.name) == schema.rgb().map(|i| &schema.attributes[i].name) {
        return None;
    }
    let mut entry = Map::new();
    entry.insert("name".into(), attribute.name.clone().into());
    entry.insert("type".into(), attribute.ty.to_string().into());
    entry.insert("elements".into(), attribute.elements.into());
    match &dropped.why {
        DropReason::Constant(values) => entry.insert("constant".into(), json!(values)),
        DropReason::SameAs(other) => entry.insert("sameAs".into(), other.clone().into()),
        DropReason::FollowsFrom { attribute, table } => {
            entry.insert("table".into(), json!(table));
            entry.insert("followsFrom".into(), attribute.clone().into())
        }
        _ => return None,
    };
    Some(entry.into())
}
