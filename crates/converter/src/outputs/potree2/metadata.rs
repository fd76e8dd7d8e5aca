//! The metadata of an octree.

use std::borrow::Cow;

use pointmill_format::potree2::{AttributeStats, Encoding as StoredEncoding, HierarchyBytes, Metadata};
use pointmill_format::{Aabb, Attribute, AttributeType, Lattice};
use serde_json::Map;

use super::layout::viewable;
use super::names::Names;
use super::settings::{DarkColours, Encoding, Potree2Settings};
use super::watch::rounded_range;
use crate::cloud::{Cloud, JobPoint, Ledger, Range};
use crate::outputs::attributes::Choice;
use crate::outputs::octrees::ChosenSpacing;
use crate::outputs::origin::own_key;

/// The metadata of the dataset.
pub(super) fn metadata(
    cloud: &Cloud<'_>,
    settings: &Potree2Settings,
    spacing: &ChosenSpacing,
    choice: &Choice,
    names: &Names,
    ledger: &Ledger,
    hierarchy: &HierarchyBytes,
) -> Metadata {
    let Cloud { stats, facts, frame, .. } = cloud;
    let (cube, side) = (&frame.cube, frame.cube.side);
    let offset = cube.offset(&cloud.lattice.lattice);
    let lattice = Lattice { scale: cloud.lattice.lattice.scale, offset };
    let stored = |q: JobPoint| std::array::from_fn(|a| q[a] - cube.min[a]);
    let mut position = AttributeStats::new(Attribute::new("position", AttributeType::Int32, 3));
    position.min = lattice.world(stored(stats.bounds.min)).to_vec();
    position.max = lattice.world(stored(stats.bounds.max)).to_vec();
    let mut attributes = vec![position];
    attributes.extend(choice.kept.iter().zip(&names.stored).map(|(&i, name)| {
        let mut attribute = cloud.schema().attributes[i].clone();
        attribute.name.clone_from(name);
        attribute.ty = viewable(attribute.ty);
        let range = stored_range(settings, &attribute, &facts.ranges[i]);
        // A range must be there and finite; a column of NaN has none.
        let finite = |v: &[f64]| v.iter().map(|v| if v.is_finite() { *v } else { 0.0 }).collect::<Vec<_>>();
        let mut described = AttributeStats::new(attribute.clone());
        (described.min, described.max) = (finite(&range.min), finite(&range.max));
        described.histogram = (attribute.name == "classification" && attribute.ty == AttributeType::UInt8).then(|| {
            let mut left = stats.classes.clone();
            left.iter_mut().zip(&ledger.classes_dropped).for_each(|(all, dropped)| *all -= dropped);
            left
        });
        described
    }));
    let mut own = own_key(cloud, &choice.dropped);
    if !names.renamed.is_empty() {
        let renamed = names.renamed.iter().map(|r| (r.stored_as.clone(), r.name.clone().into()));
        own.insert("attributesRenamed".into(), renamed.collect::<Map<_, _>>().into());
    }
    if settings.dark_colours == DarkColours::Round {
        own.insert("darkColours".into(), settings.dark_colours.name().into());
    }
    own.insert("sampling".into(), settings.sampling.name().into());
    own.insert("leafCapacity".into(), settings.leaf_capacity.into());
    let box_of_root = Aabb { min: offset, max: offset.map(|v| v + side) };
    let mut metadata = Metadata::new(lattice, box_of_root, spacing.root, attributes);
    metadata.name = cloud.plan.cloud_name();
    metadata.points = ledger.points();
    metadata.projection.clone_from(&facts.crs.projection);
    metadata.first_chunk_size = hierarchy.first_chunk_size;
    metadata.depth = hierarchy.depth;
    metadata.encoding = match settings.encoding {
        Encoding::Default => StoredEncoding::Default,
        Encoding::Brotli { .. } => StoredEncoding::Brotli,
    };
    metadata.extra = Map::from_iter([("pointmill".to_owned(), own.into())]);
    metadata
}

/// The range of the values that are stored.
fn stored_range<'a>(settings: &Potree2Settings, attribute: &Attribute, range: &'a Range) -> Cow<'a, Range> {
    match settings.dark_colours {
        DarkColours::Round if attribute.name == "rgb" => Cow::Owned(rounded_range(range)),
        _ => Cow::Borrowed(range),
    }
}
