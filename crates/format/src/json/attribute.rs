//! Descriptions of attributes, whose sizes follow from type and elements.

use crate::{Attribute, AttributeType};

use super::{Fault, Fields, broken, unsupported};

/// More elements per point than any attribute has; keeps a bad count from requesting memory.
const MAX_ELEMENTS: u64 = 256;

/// Name, type, elements and description of an attribute, if its sizes agree. `elements_key`: what the format calls the
/// number of elements.
pub(crate) fn attribute(fields: &mut Fields<'_>, elements_key: &str) -> Result<Attribute, Fault> {
    let name = fields.text("name")?;
    if name.is_empty() {
        return broken(format!("{}name is missing", fields.place));
    }
    let word = fields.text("type")?;
    let Some(ty) = AttributeType::from_potree_name(&word) else {
        return unsupported(format!("attribute \"{name}\" has the type \"{word}\""));
    };
    let elements = fields.integer(elements_key)?;
    if !(1..=MAX_ELEMENTS).contains(&elements) {
        return broken(format!("attribute \"{name}\" has {elements_key} {elements}"));
    }
    let mut attribute = Attribute::new(name, ty, elements as usize);
    for (key, expected) in [("elementSize", ty.size()), ("size", attribute.size())] {
        let found = fields.integer(key)?;
        if found != expected as u64 {
            let name = &attribute.name;
            return broken(format!(
                "attribute \"{name}\" is {word} x {elements}, so its {key} is {expected}, not {found}"
            ));
        }
    }
    attribute.description = fields.text("description")?;
    Ok(attribute)
}
