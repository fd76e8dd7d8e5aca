//! How every kind of scan and dataset is described.

use pointmill_format::{Aabb, Attribute};
use serde_json::{Value, json};

use crate::exit::Failure;

/// What is printed about a scan or a dataset.
pub(super) struct Description {
    pub(super) text: String,
    pub(super) json: Value,
    /// The error that ended the description early; the other two fields hold what was read before it.
    pub(super) fault: Option<Failure>,
}

pub(super) fn attribute_json(attribute: &Attribute) -> Value {
    json!({
        "name": attribute.name,
        "type": attribute.ty.potree_name(),
        "elements": attribute.elements,
        "scale": attribute.scale,
        "offset": attribute.offset,
        "no_data": attribute.no_data,
    })
}

pub(super) fn corners(bounds: &Aabb) -> Value {
    json!({ "min": bounds.min, "max": bounds.max })
}
