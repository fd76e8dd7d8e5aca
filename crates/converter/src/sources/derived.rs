//! Attributes that are computed: scans may have some of the same name.

use pointmill_format::{Attribute, AttributeType};

use super::recast::{Linear, Recast};
use super::schema::Schema;
use super::union::Layout;
use crate::plan::Derive;

/// Adds what is computed to the attributes of the scans. Where scans have it, it becomes single precision.
pub(super) fn add(schema: &mut Schema, layouts: &mut [Layout], derive: &Derive) {
    let mut attributes = std::mem::take(&mut schema.attributes);
    for name in derive.names() {
        let computed = Attribute::new(name, AttributeType::Float32, 1);
        match attributes.iter().position(|a| a.name == name) {
            // vectors are something else
            Some(i) if attributes[i].elements != 1 => {
                attributes[i].name = format!("{name} of the scans");
                attributes.push(computed);
            }
            Some(i) => {
                let description = std::mem::take(&mut attributes[i].description);
                attributes[i] = computed;
                attributes[i].description = description;
                layouts.iter_mut().for_each(|layout| recast(layout, i));
            }
            None => attributes.push(computed),
        }
    }
    *schema = Schema::new(attributes);
}

/// The column of a layout that goes into an attribute becomes single precision, of the values that are meant.
fn recast(layout: &mut Layout, attribute: usize) {
    for (own, placed) in layout.attributes.iter().zip(&mut layout.columns).filter(|(_, p)| p.attribute == attribute) {
        let is_plain = own.scale.iter().all(|s| *s == 1.0) && own.offset.iter().all(|o| *o == 0.0);
        if own.ty == AttributeType::Float32 && is_plain {
            placed.recast = None;
        } else {
            let linear = Linear { scale: own.scale.clone(), offset: own.offset.clone(), unit: 1.0 };
            placed.recast = Some(Recast { ty: AttributeType::Float32, linear: Some(linear) });
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::super::union::Union;
    use super::*;
    use crate::plan::DeriveNormals;

    #[test]
    fn what_scans_have_becomes_single_and_the_rest_is_added() {
        let mut radius = Attribute::new("radius", AttributeType::UInt16, 1);
        radius.scale = vec![0.001];
        let lists: [Arc<[Attribute]>; 2] = [
            [Attribute::new("intensity", AttributeType::UInt16, 1), radius].into(),
            [Attribute::new("radius", AttributeType::Float32, 1)].into(),
        ];
        let Union { mut schema, mut layouts, .. } = Union::of(&lists);
        let derive = Derive { normals: Some(DeriveNormals::Keep), radius: true, ..Derive::default() };
        add(&mut schema, &mut layouts, &derive);
        let names: Vec<String> = schema.attributes.iter().map(|a| format!("{} {}", a.name, a.ty)).collect();
        let expected =
            ["intensity uint16", "radius float", "NormalX float", "NormalY float", "NormalZ float", "curvature float"];
        assert_eq!(names, expected);
        assert_eq!(schema.stride, 12 + 2 + 5 * 4);
        let recast = layouts[0].columns[1].recast.as_ref().unwrap();
        let (column, _) = recast.apply(&pointmill_format::Column::UInt16(vec![250]));
        assert_eq!(column, pointmill_format::Column::Float32(vec![0.25]));
        assert_eq!(layouts[1].columns[0].recast, None);
    }

    #[test]
    fn vectors_of_that_name_stay_what_they_are() {
        let lists: [Arc<[Attribute]>; 1] = [[Attribute::new("radius", AttributeType::Float32, 3)].into()];
        let Union { mut schema, mut layouts, .. } = Union::of(&lists);
        add(&mut schema, &mut layouts, &Derive { radius: true, ..Derive::default() });
        let names: Vec<(&str, usize)> = schema.attributes.iter().map(|a| (a.name.as_str(), a.elements)).collect();
        assert_eq!(names, [("radius of the scans", 3), ("radius", 1)]);
        assert_eq!((layouts[0].columns[0].attribute, &layouts[0].columns[0].recast), (0, &None));
    }
}
