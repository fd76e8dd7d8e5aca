//! All points of a dataset, as its readers decode them, with the level of each.

use std::path::Path;

use pointmill_format::batches::{BatchScratch, Batches, ColourSource, Precision, lod_of, rgb_of};
use pointmill_format::bintree::Bintree;
use pointmill_format::octree::{Octree, OctreeNode, OctreeNodes};
use pointmill_format::{DatasetKind, NodeKey, NodePoints, ReadError, locate, open_octree};

use crate::cloud::{Cloud, in_parallel, narrowed};

/// What a dataset holds, and how far apart points of a level are meant to be.
#[derive(Debug, Default)]
pub(crate) struct Decoded {
    pub(crate) cloud: Cloud,
    /// Side of the cell that one point of a level stands for, world units, by level.
    pub(crate) spacings: Vec<f64>,
}

/// Reads the dataset at `path`. `has_colours`: whether the scene has any.
pub(crate) fn read(path: &Path, has_colours: bool) -> Result<Decoded, ReadError> {
    let located = locate(path)?;
    match located.kind {
        DatasetKind::Bintree => bintree(path, has_colours),
        DatasetKind::Batches => batches(&located.marker_path(), has_colours),
        _ => octree(&*open_octree(path)?, has_colours),
    }
}

/// Points as a thread gathers them; colours are narrowed once all are known.
#[derive(Default)]
struct Part {
    points: NodePoints,
    scratch: BatchScratch,
    cloud: Cloud,
    channels: Vec<[u16; 3]>,
    /// Some points have colours.
    is_coloured: bool,
}

impl Part {
    /// Takes the points that were read last.
    fn take(&mut self, level: u8, has_colours: bool) {
        let Self { points, cloud, channels, is_coloured, .. } = self;
        for world in (0..points.len()).filter_map(|i| points.world(i)) {
            for (all, value) in cloud.xyz.iter_mut().zip(world) {
                all.push(value);
            }
        }
        cloud.level.resize(cloud.len(), level);
        if has_colours {
            *is_coloured |= points.names().any(|name| name == "rgb");
            if let Some(deep) = points.column::<u16>("rgb") {
                channels.extend(deep.chunks_exact(3).map(|c| [c[0], c[1], c[2]]));
            } else if let Some(shallow) = points.column::<u8>("rgb") {
                channels.extend(shallow.chunks_exact(3).map(|c| [c[0], c[1], c[2]].map(u16::from)));
            }
            channels.resize(cloud.len(), [0; 3]);
        }
    }
}

/// Puts the parts together.
fn joined(parts: Vec<Part>, spacings: Vec<f64>) -> Decoded {
    let is_deep = parts.iter().flat_map(|part| &part.channels).flatten().any(|channel| *channel > 255);
    let is_coloured = parts.iter().any(|part| part.is_coloured);
    let mut cloud = Cloud::default();
    for mut part in parts {
        if part.cloud.rgb.is_empty() && is_coloured {
            part.cloud.rgb = narrowed(&part.channels, is_deep);
        }
        cloud.append(part.cloud);
    }
    Decoded { cloud, spacings }
}

fn octree(octree: &dyn Octree, has_colours: bool) -> Result<Decoded, ReadError> {
    let nodes = all_nodes(octree)?;
    let parts = in_parallel(nodes.len(), Part::default, |i, part| {
        octree.points(&nodes[i], &mut part.points)?;
        part.take(nodes[i].key.level, has_colours);
        Ok::<(), ReadError>(())
    })?;
    let deepest = nodes.iter().map(|node| node.key.level).max().unwrap_or(0);
    let spacings = (0..=deepest).map(|level| octree.info().spacing_at(level)).collect();
    Ok(joined(parts, spacings))
}

/// Every node of an octree, proxies resolved.
fn all_nodes(octree: &dyn Octree) -> Result<Vec<OctreeNode>, ReadError> {
    let mut nodes = OctreeNodes::new(octree)?;
    let mut open = vec![NodeKey::ROOT];
    let mut all = Vec::new();
    while let Some(key) = open.pop() {
        nodes.load(octree, key)?;
        if let Some(node) = nodes.get(key) {
            all.push(*node);
        }
        open.extend(nodes.children(key).map(|child| child.key));
    }
    Ok(all)
}

fn bintree(path: &Path, has_colours: bool) -> Result<Decoded, ReadError> {
    let tree = Bintree::open(path)?;
    let leaves: Vec<u32> = tree.leaves().collect();
    let parts = in_parallel(leaves.len(), Part::default, |i, part| {
        tree.read_leaf(leaves[i], &mut part.points)?;
        part.take(0, has_colours);
        part.cloud.level.clear();
        Ok::<(), ReadError>(())
    })?;
    Ok(joined(parts, Vec::new()))
}

fn batches(path: &Path, has_colours: bool) -> Result<Decoded, ReadError> {
    let batches = Batches::map(path)?;
    // words without colours of the scene are grey or one colour: nothing to compare
    let has_colours = has_colours && batches.description().colour == ColourSource::Rgb;
    let parts = in_parallel(batches.header().batches as usize, Part::default, |i, part| {
        batches.read_batch(i as u32, Precision::Thirty, &mut part.scratch, &mut part.points)?;
        let words = part.points.column::<u32>("colour").unwrap_or(&[]).to_vec();
        part.take(0, false);
        part.cloud.level.truncate(part.cloud.len() - words.len());
        part.cloud.level.extend(words.iter().map(|word| lod_of(*word)));
        if has_colours {
            part.cloud.rgb.extend(words.iter().map(|word| rgb_of(*word)));
        }
        Ok::<(), ReadError>(())
    })?;
    let levels = parts.iter().flat_map(|part| &part.cloud.level).max().map_or(0, |level| i32::from(*level) + 1);
    let cell = batches.header().grid.cell;
    Ok(joined(parts, (0..levels).map(|level| cell / 2_f64.powi(level)).collect()))
}
