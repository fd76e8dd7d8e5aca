//! Datasets as the Rust crates read them, in one form for all kinds.

use std::path::Path;

use pointmill_format::batches::{BatchRecord, BatchScratch, Batches, MappedFile, Precision};
use pointmill_format::bintree::{Bintree, NodeKind};
use pointmill_format::octree::{Octree, OctreeNode};
use pointmill_format::{
    Aabb, Attribute, AttributeType, DatasetKind, Lattice, NodeKey, NodePoints, copc, locate, potree1, potree2,
};

pub(crate) const NO_NODE: u32 = u32::MAX;
pub(crate) const LEAF: u32 = 2;
pub(crate) const DRAWABLE: u32 = 4;

pub(crate) type Corner = [f64; 3];

/// A node, whatever the kind.
pub(crate) struct Node {
    pub(crate) name: String,
    pub(crate) parent: u32,
    pub(crate) level: u32,
    pub(crate) flags: u32,
    pub(crate) points: u64,
    pub(crate) bounds: Aabb,
    pub(crate) center: Corner,
    pub(crate) children: Vec<u32>,
}

/// A dataset, opened by its own reader.
pub(crate) enum Dataset {
    Octree(Box<dyn Octree>, Vec<OctreeNode>),
    Bintree(Box<Bintree>),
    Batches(Box<Batches<MappedFile>>),
}

pub(crate) struct Facts {
    pub(crate) kind: u32,
    pub(crate) points: u64,
    pub(crate) bounds: Aabb,
    pub(crate) tight: Option<Aabb>,
    pub(crate) spacing: f64,
    pub(crate) lattice: Lattice,
    pub(crate) capacity: u64,
    pub(crate) bits: u32,
    pub(crate) projection: String,
    pub(crate) attributes: Vec<Attribute>,
    /// Least and greatest raw values, by attribute and element.
    pub(crate) ranges: Vec<Vec<[f64; 2]>>,
}

/// All nodes: chunk by chunk, those of the first proxy first.
fn all_nodes(octree: &dyn Octree) -> Vec<OctreeNode> {
    let mut nodes = octree.chunk(&octree.root()).unwrap();
    let mut at = 0;
    while at < nodes.len() {
        if nodes[at].is_proxy {
            let chunk = octree.chunk(&nodes[at]).unwrap();
            nodes[at] = chunk[0];
            nodes.extend(&chunk[1..]);
        }
        at += 1;
    }
    nodes
}

pub(crate) fn open(path: &Path) -> (Dataset, Facts) {
    let located = locate(path).unwrap();
    let of_octree = |kind, octree: &dyn Octree, tight, lattice| {
        let info = octree.info();
        Facts {
            kind,
            points: info.points.unwrap_or(0),
            bounds: info.cube,
            tight,
            spacing: info.spacing,
            lattice,
            capacity: 0,
            bits: 0,
            projection: info.projection.clone(),
            attributes: info.attributes.clone(),
            ranges: vec![Vec::new(); info.attributes.len()],
        }
    };
    let octree = |octree: Box<dyn Octree>| {
        let nodes = all_nodes(&*octree);
        Dataset::Octree(octree, nodes)
    };
    match located.kind {
        DatasetKind::Potree2 => {
            let dataset = potree2::Dataset::open(&located.path).unwrap();
            let metadata = dataset.metadata();
            let stats = |name: &str| metadata.attributes.iter().find(|a| a.attribute.name == name).unwrap();
            let corner = |values: &[f64]| Corner::try_from(values).unwrap();
            let position = stats("position");
            let tight = Aabb { min: corner(&position.min), max: corner(&position.max) };
            let mut facts = of_octree(1, &dataset, Some(tight), metadata.lattice);
            for (attribute, range) in facts.attributes.iter().zip(&mut facts.ranges) {
                let stats = stats(&attribute.name);
                *range = stats.min.iter().zip(&stats.max).map(|(min, max)| [*min, *max]).collect();
            }
            (octree(Box::new(dataset)), facts)
        }
        DatasetKind::Potree1 => {
            let dataset = potree1::Dataset::open(&located.path).unwrap();
            let metadata = dataset.metadata();
            let lattice = Lattice { scale: [metadata.scale; 3], offset: metadata.cube.min };
            let facts = of_octree(2, &dataset, metadata.tight_box, lattice);
            (octree(Box::new(dataset)), facts)
        }
        DatasetKind::Copc => {
            let dataset = copc::Dataset::open(&located.path).unwrap();
            let mut facts = of_octree(3, &dataset, dataset.bounds_declared(), dataset.lattice());
            facts.points = dataset.points_declared();
            (octree(Box::new(dataset)), facts)
        }
        DatasetKind::Bintree => {
            let tree = Bintree::open(&located.path).unwrap();
            let header = tree.header();
            let mut attributes = vec![Attribute::new("classification", AttributeType::Float32, 1)];
            attributes.extend(header.record.extras().iter().map(|e| e.attribute.clone()));
            let facts = Facts {
                kind: 4,
                points: header.points,
                bounds: tree.nodes()[0].bounds,
                tight: Some(tree.nodes()[0].bounds),
                spacing: 0.0,
                lattice: header.lattice,
                capacity: header.capacity,
                bits: 0,
                projection: header.projection.clone(),
                ranges: vec![Vec::new(); attributes.len()],
                attributes,
            };
            (Dataset::Bintree(Box::new(tree)), facts)
        }
        _ => {
            let batches = Batches::map(&located.path).unwrap();
            let (header, description) = (batches.header(), batches.description());
            let mut attributes = vec![Attribute::new("colour", AttributeType::UInt32, 1)];
            attributes.extend(batches.attributes().cloned());
            let mut ranges = vec![Vec::new()];
            ranges.extend(
                description
                    .attributes
                    .iter()
                    .map(|e| e.min.iter().zip(&e.max).map(|(min, max)| [*min, *max]).collect()),
            );
            let facts = Facts {
                kind: 5,
                points: header.points,
                bounds: header.tight,
                tight: Some(header.tight),
                spacing: 0.0,
                lattice: description.lattice.into(),
                capacity: 10_240,
                bits: header.precision().bits(),
                projection: description.projection.clone(),
                attributes,
                ranges,
            };
            (Dataset::Batches(Box::new(batches)), facts)
        }
    }
}

impl Dataset {
    pub(crate) fn nodes(&self) -> Vec<Node> {
        match self {
            Self::Octree(octree, nodes) => {
                let id = |key: NodeKey| nodes.iter().position(|n| n.key == key).unwrap() as u32;
                let node = |node: &OctreeNode| {
                    let bounds = octree.info().node_box(node.key);
                    Node {
                        name: node.key.to_string(),
                        parent: node.key.parent().map_or(NO_NODE, id),
                        level: node.key.level.into(),
                        flags: DRAWABLE | if node.child_mask == 0 { LEAF } else { 0 },
                        points: octree.count(node).unwrap(),
                        bounds,
                        center: bounds.center(),
                        children: (0..8)
                            .filter(|c| node.has_child(*c))
                            .map(|c| id(node.key.child(c).unwrap()))
                            .collect(),
                    }
                };
                nodes.iter().map(node).collect()
            }
            Self::Bintree(tree) => {
                let all = 0..tree.nodes().len() as u32;
                let parent = |id: u32| all.clone().find(|p| tree.children(*p).is_some_and(|c| c.contains(&id)));
                let node = |id: u32| {
                    let node = tree.node(id).unwrap();
                    let center = match node.kind {
                        NodeKind::Leaf { center, .. } => center,
                        _ => node.bounds.center(),
                    };
                    Node {
                        name: tree.leaf_name(id).trim_end_matches(".bin").to_owned(),
                        parent: parent(id).unwrap_or(NO_NODE),
                        level: tree.path(id).len() as u32,
                        flags: if node.is_leaf() { LEAF | DRAWABLE } else { 0 },
                        points: node.count,
                        bounds: node.bounds,
                        center,
                        children: tree.children(id).into_iter().flatten().collect(),
                    }
                };
                all.clone().map(node).collect()
            }
            Self::Batches(batches) => {
                let node = |(slot, record): (usize, &BatchRecord)| {
                    let bounds = Aabb {
                        min: batches.world(record.min.map(f64::from)),
                        max: batches.world(record.max.map(f64::from)),
                    };
                    Node {
                        name: slot.to_string(),
                        parent: NO_NODE,
                        level: 0,
                        flags: LEAF | DRAWABLE,
                        points: record.points.into(),
                        bounds,
                        center: bounds.center(),
                        children: Vec::new(),
                    }
                };
                batches.records().iter().enumerate().map(node).collect()
            }
        }
    }

    pub(crate) fn points(&self, id: usize) -> NodePoints {
        let mut points = NodePoints::default();
        match self {
            Self::Octree(octree, nodes) => octree.points(&nodes[id], &mut points).unwrap(),
            Self::Bintree(tree) => tree.read_leaf(id as u32, &mut points).unwrap(),
            Self::Batches(batches) => {
                batches.read_batch(id as u32, Precision::Thirty, &mut BatchScratch::default(), &mut points).unwrap();
            }
        }
        points
    }
}
