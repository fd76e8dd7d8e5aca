//! What every dataset says of its making: what a validator or a later run needs to know, and no viewer reads.

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
    own
}
