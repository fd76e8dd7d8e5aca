//! What stands beside the position in the records of a dataset.

use pointmill_format::potree1::{Field, PointAttribute};
use pointmill_format::{Attribute, AttributeType, DatasetKind};
use serde_json::{Value, json};

use super::column::{Column, Source};
use super::notes;
use super::settings::Potree1Version;
use crate::cloud::Cloud;
use crate::error::{ConvertError, Unsupported};
use crate::outputs::attributes::{choose, derived, left_out};
use crate::outputs::colour::{colour_notes, colour_of, extremes};
use crate::outputs::potree2::{MAX_ELEMENTS, Names, viewable};
use crate::plan::AttributeChoice;
use crate::report::{DropReason, DroppedAttribute};
use crate::sources::{POSITION_BYTES, Schema};
use crate::warning::{NameFault, RenamedAttribute, Warning};

/// The components of normals, whose order is that of the axes.
const NORMALS: [&str; 3] = ["NormalX", "NormalY", "NormalZ"];

/// Bytes of the colour behind the position.
pub(super) const COLOUR_BYTES: usize = 4;

/// The record of a dataset, and what of the cloud it lacks.
#[derive(Debug, Clone)]
pub(super) struct Content {
    /// All of a record, the position and the colour first.
    pub(super) fields: Vec<PointAttribute>,
    pub(super) colour: Colour,
    /// What follows the colour.
    pub(super) columns: Vec<Column>,
    /// Bytes of a record.
    pub(super) stride: usize,
    /// Indices of the schema, in the order of the records.
    pub(super) kept: Vec<usize>,
    pub(super) dropped: Vec<DroppedAttribute>,
    pub(super) renamed: Vec<RenamedAttribute>,
    pub(super) warnings: Vec<Warning>,
}

/// Where colours come from; byte offsets are those of a stored record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Colour {
    Rgb { at: usize },
    Grey { at: usize, ty: AttributeType, least: f64, greatest: f64 },
    White,
}

impl Colour {
    /// What the dataset says of colours that are none of the sources.
    pub(super) fn made(self) -> Option<Value> {
        match self {
            Self::Rgb { .. } => None,
            Self::Grey { least, greatest, .. } => Some(json!({ "intensity": [least, greatest] })),
            Self::White => Some("white".into()),
        }
    }
}

impl Content {
    /// # Errors
    /// An attribute with more elements than readers accept.
    pub(super) fn choose(cloud: &Cloud<'_>, version: Potree1Version) -> Result<Self, ConvertError> {
        let (schema, requested) = (cloud.schema(), &cloud.plan.attributes);
        let asked = match requested {
            AttributeChoice::Usual => derived(&cloud.plan.derive, schema).collect(),
            _ => choose(cloud.plan, schema, &cloud.intake.unread, &cloud.facts.ranges, &[]).kept,
        };
        if let Some(wide) = asked.iter().map(|&i| &schema.attributes[i]).find(|a| a.elements > MAX_ELEMENTS) {
            let (kind, name, elements) = (DatasetKind::Potree1, wide.name.clone(), wide.elements);
            return Err(Unsupported::WideAttribute { kind, name, elements, max: MAX_ELEMENTS }.into());
        }
        let rgb = schema.rgb();
        let plan = Planned::of(schema, asked.into_iter().filter(|i| Some(*i) != rgb).collect(), version);
        let mut kept: Vec<usize> = rgb.into_iter().collect();
        kept.extend(plan.parts.iter().flat_map(|part| &part.indices));

        let mut fields: Vec<PointAttribute> =
            [Field::Position, Field::Rgba].into_iter().filter_map(|f| field(f, version)).collect();
        let (mut columns, mut stride) = (Vec::new(), POSITION_BYTES + COLOUR_BYTES);
        for part in plan.parts {
            columns.push(Column { at: stride, indices: part.indices, source: part.source, stored_as: part.field.ty });
            stride += part.field.size();
            fields.push(part.field);
        }
        let colour = match colour_of(schema) {
            Some(i) if Some(i) == rgb => Colour::Rgb { at: schema.offsets[i] },
            Some(i) => {
                let [least, greatest] = extremes(cloud, i);
                Colour::Grey { at: schema.offsets[i], ty: schema.attributes[i].ty, least, greatest }
            }
            None => Colour::White,
        };
        let dropped = dropped(cloud, &kept, &plan.no_place, version);
        let mut warnings = colour_notes(cloud, DatasetKind::Potree1);
        warnings.extend(notes::fields(&fields, &plan.renamed, version));
        Ok(Self { fields, colour, columns, stride, kept, dropped, renamed: plan.renamed, warnings })
    }
}

/// The part of a record that a field is.
struct Part {
    field: PointAttribute,
    source: Source,
    /// The attributes of the schema that are in it.
    indices: Vec<usize>,
}

/// The fields for attributes of the schema.
#[derive(Default)]
struct Planned {
    parts: Vec<Part>,
    renamed: Vec<RenamedAttribute>,
    /// Attributes that the version has no place for.
    no_place: Vec<usize>,
}

impl Planned {
    /// `asked`: indices of the schema, in order.
    fn of(schema: &Schema, asked: Vec<usize>, version: Potree1Version) -> Self {
        let mut planned = Self::default();
        let normals = normals(schema, &asked);
        let others: Vec<usize> = asked.into_iter().filter(|i| !normals.is_some_and(|n| n.contains(i))).collect();
        let mut unknown = Vec::new();
        for i in others {
            match known(schema, i, version) {
                Some(part) => planned.parts.push(part),
                None if version == Potree1Version::V1_8 => unknown.push(i),
                None => planned.no_place.push(i),
            }
        }
        planned.add_others(schema, &unknown);
        // Giro3D does not skip the bytes of normals: they come last
        planned.parts.extend(normals.and_then(|n| part_of_normals(schema, n, version)));
        planned
    }

    /// Fields under names of their own.
    fn add_others(&mut self, schema: &Schema, indices: &[usize]) {
        // A name that means another type to readers becomes another.
        let named = |&i: &usize| {
            let mut attribute = schema.attributes[i].clone();
            attribute.name = match Field::from_object_name(&attribute.name) {
                Field::Other => attribute.name,
                _ => format!("{}_", attribute.name),
            };
            attribute
        };
        let attributes: Vec<Attribute> = indices.iter().map(named).collect();
        let names = Names::of(&attributes.iter().collect::<Vec<_>>());
        for ((&i, name), attribute) in indices.iter().zip(names.stored).zip(&attributes) {
            let own = &schema.attributes[i];
            if name != own.name {
                let why = names.renamed.iter().find(|r| r.name == attribute.name).map_or(NameFault::Viewers, |r| r.why);
                self.renamed.push(RenamedAttribute::new(own.name.clone(), name.clone(), why));
            }
            let field = PointAttribute::other(name, viewable(own.ty), own.elements);
            let source = Source::own(schema, i);
            self.parts.push(Part { field, source, indices: vec![i] });
        }
    }
}

fn field(field: Field, version: Potree1Version) -> Option<PointAttribute> {
    match version {
        Potree1Version::V1_7 => PointAttribute::of_words(field),
        Potree1Version::V1_8 => PointAttribute::of_objects(field),
    }
}

/// The field that has a place for an attribute, if its values are of such a kind.
fn known(schema: &Schema, i: usize, version: Potree1Version) -> Option<Part> {
    let attribute = &schema.attributes[i];
    let found = Field::from_column(&attribute.name)?;
    let is_read = version == Potree1Version::V1_8 || matches!(found, Field::Intensity | Field::Classification);
    let field = field(found, version).filter(|_| is_read && attribute.elements == 1)?;
    let source = Source::of_number(schema, i, field.ty)?;
    Some(Part { field, source, indices: vec![i] })
}

/// The three components, if all of them are asked for.
fn normals(schema: &Schema, asked: &[usize]) -> Option<[usize; 3]> {
    let component = |name: &str| {
        let i = schema.find(name).filter(|i| asked.contains(i))?;
        let attribute = &schema.attributes[i];
        let is_real = matches!(attribute.ty, AttributeType::Float32 | AttributeType::Float64);
        (is_real && attribute.elements == 1).then_some(i)
    };
    match NORMALS.map(component) {
        [Some(x), Some(y), Some(z)] => Some([x, y, z]),
        _ => None,
    }
}

/// Two bytes where attributes are words; three floats, which lose nothing, where they are objects.
fn part_of_normals(schema: &Schema, indices: [usize; 3], version: Potree1Version) -> Option<Part> {
    let from = indices.map(|i| (schema.offsets[i], schema.attributes[i].ty));
    let (kind, source) = match version {
        Potree1Version::V1_7 => (Field::NormalOct16, Source::Octahedron { from }),
        Potree1Version::V1_8 => (Field::Normal, Source::Floats { from }),
    };
    Some(Part { field: field(kind, version)?, source, indices: indices.to_vec() })
}

fn dropped(cloud: &Cloud<'_>, kept: &[usize], no_place: &[usize], version: Potree1Version) -> Vec<DroppedAttribute> {
    let (schema, requested) = (cloud.schema(), &cloud.plan.attributes);
    let unwanted = match requested {
        AttributeChoice::Usual => DropReason::NotUsual,
        _ => DropReason::NotRequested,
    };
    let grey = colour_of(schema).filter(|i| Some(*i) != schema.rgb());
    let why = |i: usize| match cloud.facts.ranges[i].constant() {
        Some(values) if *requested == AttributeChoice::Scene => DropReason::Constant(values.to_vec()),
        _ if Some(i) == grey => DropReason::ShownAsGrey,
        _ if no_place.contains(&i) => DropReason::NoPlace(version.name()),
        _ => unwanted.clone(),
    };
    let missing = (0..schema.attributes.len()).filter(|i| !kept.contains(i));
    let mut dropped: Vec<DroppedAttribute> =
        missing.map(|i| DroppedAttribute { name: schema.attributes[i].name.clone(), why: why(i) }).collect();
    dropped.extend(left_out(schema, &cloud.intake.unread, |_| true, &unwanted));
    dropped
}
