//! What `cloud.js` says.

use pointmill_format::potree1::Metadata;
use pointmill_format::{Aabb, Attribute};
use serde_json::{Map, Value, json};

use super::content::Content;
use super::settings::{Potree1Settings, Potree1Version};
use super::steps::Steps;
use crate::cloud::{Cloud, JobPoint, tidy_world};
use crate::outputs::octrees::ChosenSpacing;
use crate::outputs::origin::own_key;

/// The metadata of a dataset, but for the number of points.
pub(super) fn metadata(
    cloud: &Cloud<'_>,
    settings: &Potree1Settings,
    spacing: &ChosenSpacing,
    content: &Content,
    steps: &Steps,
) -> Metadata {
    let (cube, lattice, bounds) = (&cloud.frame.cube, &cloud.lattice.lattice, &cloud.stats.bounds);
    let corner = cube.offset(lattice);
    let root = Aabb { min: corner, max: corner.map(|v| v + cube.side) };
    let mut metadata = Metadata::new(root, steps.scale, spacing.root, content.fields.clone());
    metadata.minor = match settings.version {
        Potree1Version::V1_7 => 7,
        Potree1Version::V1_8 => 8,
    };
    let world = |q: JobPoint| std::array::from_fn(|a| tidy_world(q[a], lattice.scale[a], lattice.offset[a]));
    metadata.tight_box = Some(Aabb { min: world(bounds.min), max: world(bounds.max) });
    metadata.projection.clone_from(&cloud.facts.crs.projection);
    let mut own = own_key(cloud, &content.dropped);
    own.remove("latticeOffset");
    own.insert("lattice".into(), json!({ "scale": lattice.scale, "offset": lattice.offset }));
    own.insert("name".into(), cloud.plan.cloud_name().into());
    own.extend(content.colour.made().map(|made| ("colours".to_owned(), made)));
    if !content.renamed.is_empty() {
        let renamed = content.renamed.iter().map(|r| (r.stored_as.clone(), r.name.clone().into()));
        own.insert("attributesRenamed".into(), renamed.collect::<Map<_, _>>().into());
    }
    let scaled = scaled(cloud, content);
    if !scaled.is_empty() {
        own.insert("attributeScales".into(), scaled.into());
    }
    own.insert("sampling".into(), settings.sampling.name().into());
    own.insert("leafCapacity".into(), settings.leaf_capacity.into());
    own.extend(settings.max_node_points.map(|most| ("maxNodePoints".to_owned(), most.into())));
    metadata.extra = Map::from_iter([("pointmill".to_owned(), own.into())]);
    metadata
}

/// Scale and offset of attributes whose stored values are not the meant ones, by their names in the dataset: the format has no
/// other place for them.
fn scaled(cloud: &Cloud<'_>, content: &Content) -> Map<String, Value> {
    let kept = content.kept.iter().filter_map(|&i| cloud.schema().attributes.get(i));
    let is_scaled = |a: &&Attribute| a.scale.iter().any(|s| *s != 1.0) || a.offset.iter().any(|o| *o != 0.0);
    let stored_as = |a: &Attribute| {
        let renamed = content.renamed.iter().find(|renamed| renamed.name == a.name);
        renamed.map_or_else(|| a.name.clone(), |renamed| renamed.stored_as.clone())
    };
    kept.filter(is_scaled).map(|a| (stored_as(a), json!({ "scale": a.scale, "offset": a.offset }))).collect()
}
