//! Octrees of any format, whose hierarchy is read as the page asks for it.

use std::collections::{HashSet, VecDeque};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use pointmill_format::octree::{Octree, OctreeInfo, OctreeNode, OctreeNodes};
use pointmill_format::{
    Aabb, Attribute, Crs, DatasetKind, Located, NodeKey, NodePoints, ReadError, copc, open_octree, potree1, potree2,
};
use serde_json::{Value, json};

use super::ranges::{Attributes, Range};
use super::request::PointsRequest;
use super::scene::{Scene, box_json, keys};
use crate::encode::{self, Unit};
use crate::refusal::Refusal;
use crate::values::{Number, point_json};

/// An octree that is open.
pub(super) struct Nodes {
    octree: Box<dyn Octree>,
    index: Mutex<Index>,
    said: Said,
    /// With ranges of a sample where the dataset gives none; read when they are needed first.
    attributes: OnceLock<Attributes>,
}

/// What the formats say in different places.
struct Said {
    name: String,
    projection: String,
    bounds: Option<Aabb>,
    depth: Option<u32>,
    attributes: Attributes,
}

struct Index {
    nodes: OctreeNodes,
    /// Nodes with which a chunk begins: proxies, before the chunk was read.
    chunks: HashSet<NodeKey>,
}

impl Nodes {
    pub(super) fn open(located: &Located) -> Result<Self, ReadError> {
        let path = &located.path;
        let (octree, said): (Box<dyn Octree>, Said) = match located.kind {
            DatasetKind::Potree2 => {
                let dataset = potree2::Dataset::open(path)?;
                let said = of_potree2(dataset.metadata());
                (Box::new(dataset), said)
            }
            DatasetKind::Potree1 => {
                let dataset = potree1::Dataset::open(path)?;
                let said = Said { bounds: dataset.metadata().tight_box, ..Said::of(dataset.info()) };
                (Box::new(dataset), said)
            }
            DatasetKind::Copc => {
                let dataset = copc::Dataset::open(path)?;
                let projection = projection(dataset.crs());
                let said = Said { bounds: dataset.bounds_declared(), projection, ..Said::of(dataset.info()) };
                (Box::new(dataset), said)
            }
            _ => {
                let octree = open_octree(path)?;
                let said = Said::of(octree.info());
                (octree, said)
            }
        };
        let nodes = OctreeNodes::new(&*octree)?;
        let index = Mutex::new(Index { nodes, chunks: HashSet::from([NodeKey::ROOT]) });
        Ok(Self { octree, index, said, attributes: OnceLock::new() })
    }

    pub(super) fn scene(&self) -> Scene {
        let (info, said) = (self.octree.info(), &self.said);
        let attributes = self.attributes().clone();
        Scene {
            kind: "octree",
            format: info.format.clone(),
            name: said.name.clone(),
            points: info.points,
            bounds: said.bounds.unwrap_or(info.cube),
            projection: said.projection.clone(),
            has_colour: attributes.has_colour(),
            attributes,
            own: keys([("cube", box_json(&info.cube)), ("spacing", info.spacing.into()), ("depth", json!(said.depth))]),
        }
    }

    fn attributes(&self) -> &Attributes {
        self.attributes.get_or_init(|| {
            let mut attributes = self.said.attributes.clone();
            if attributes.is_incomplete() {
                let (root, mut points) = (self.lock().nodes.get(NodeKey::ROOT).copied(), NodePoints::default());
                // a root that cannot be read is an error of the request for its points
                if root.is_some_and(|root| self.octree.points(&root, &mut points).is_ok()) {
                    attributes.sample(&points);
                }
            }
            attributes
        })
    }

    /// The chunk that begins with the node of that name, breadth first.
    pub(super) fn chunk(&self, name: &str) -> Result<Vec<u8>, Refusal> {
        let key = key(name)?;
        self.node(key)?;
        let index = self.lock();
        if !index.chunks.contains(&key) {
            return Err(Refusal::absent(format!("no chunk of the hierarchy begins with node {name}")));
        }
        let (mut queue, mut nodes) = (VecDeque::from([key]), Vec::new());
        while let Some(at) = queue.pop_front() {
            let Some(mut node) = index.nodes.get(at).copied() else { continue };
            node.is_proxy |= at != key && index.chunks.contains(&at);
            if !node.is_proxy {
                queue.extend(index.nodes.children(at).map(|child| child.key));
            }
            nodes.push(node);
        }
        drop(index);
        for node in nodes.iter_mut().filter(|node| !node.is_proxy) {
            // what cannot be counted is an error of the request for its points
            node.points = self.octree.count(node).unwrap_or(node.points);
        }
        Ok(encode::nodes(&nodes))
    }

    /// The nodes of a request, and the most bytes of the answer.
    pub(super) fn find(&self, request: &PointsRequest) -> Result<(Vec<OctreeNode>, u64), Refusal> {
        if let Some(name) = &request.attribute {
            self.attributes().find(name)?;
        }
        let (mut nodes, mut cost) = (Vec::new(), 0u64);
        for name in &request.units {
            let node = self.node(key(name)?)?;
            let points = self.octree.count(&node)?;
            cost = cost.saturating_add(encode::cost(points.div_ceil(request.every.max(1) as u64)));
            nodes.push(node);
        }
        Ok((nodes, cost))
    }

    pub(super) fn points(&self, nodes: &[OctreeNode], request: &PointsRequest) -> Result<Vec<u8>, Refusal> {
        let look = request.look(self.attributes())?;
        let (mut points, mut out) = (NodePoints::default(), Vec::new());
        for node in nodes {
            self.octree.points(node, &mut points)?;
            encode::encode_unit(Unit { points: &points, may_round: node.child_mask != 0 }, &look, &mut out);
        }
        Ok(out)
    }

    pub(super) fn point(&self, unit: &str, index: u64) -> Result<Value, Refusal> {
        let node = self.node(key(unit)?)?;
        let mut points = NodePoints::default();
        self.octree.points(&node, &mut points)?;
        point_of(&points, &self.attributes().all, unit, index)
    }

    /// The node of that address; its chunk and those above it are read if they were not.
    fn node(&self, key: NodeKey) -> Result<OctreeNode, Refusal> {
        let mut index = self.lock();
        let Index { nodes, chunks } = &mut *index;
        for level in 0..=key.level {
            let Some(above) = key.ancestor(level) else { break };
            match nodes.get(above) {
                None => break,
                Some(node) if node.is_proxy => {
                    nodes.load(&*self.octree, above)?;
                    chunks.insert(above);
                }
                Some(_) => {}
            }
        }
        nodes.get(key).copied().ok_or_else(|| Refusal::absent(format!("there is no node {key}")))
    }

    fn lock(&self) -> MutexGuard<'_, Index> {
        self.index.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl std::fmt::Debug for Nodes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Nodes").field("info", self.octree.info()).finish_non_exhaustive()
    }
}

impl Said {
    /// What all octrees say.
    fn of(info: &OctreeInfo) -> Self {
        Self {
            name: String::new(),
            projection: info.projection.clone(),
            bounds: None,
            depth: None,
            attributes: Attributes::new(info.attributes.iter().map(|a| (a.clone(), None))),
        }
    }
}

fn of_potree2(metadata: &potree2::Metadata) -> Said {
    let columns = metadata.attributes.iter().filter(|stats| stats.attribute.name != "position");
    let known = columns.map(|stats| {
        let range = Range::of_raw(&stats.attribute, &stats.min, &stats.max);
        (stats.attribute.clone(), range)
    });
    let position = metadata.position_index().and_then(|i| metadata.attributes.get(i));
    let corners = position.and_then(|p| Some((p.min.first_chunk::<3>()?, p.max.first_chunk::<3>()?)));
    let bounds = corners.map(|(min, max)| Aabb { min: *min, max: *max });
    Said {
        name: metadata.name.clone(),
        projection: metadata.projection.clone(),
        bounds: bounds.filter(|b| !b.is_empty()),
        depth: Some(metadata.depth),
        attributes: Attributes::new(known),
    }
}

/// A proj4 definition, or a code, or nothing.
fn projection(crs: &Crs) -> String {
    let code = || crs.epsg.map(|code| format!("EPSG:{code}"));
    crs.proj4.clone().or_else(code).unwrap_or_default()
}

fn key(name: &str) -> Result<NodeKey, Refusal> {
    NodeKey::from_name(name).ok_or_else(|| {
        let shown: String = name.chars().take(40).collect();
        Refusal::bad(format!("\"{shown}\" names no node: r, and a digit of 0 to 7 per level"))
    })
}

/// Position and all attributes of a point.
pub(super) fn point_of(
    points: &NodePoints,
    attributes: &[Attribute],
    unit: &str,
    index: u64,
) -> Result<Value, Refusal> {
    let absent = || Refusal::absent(format!("unit {unit} has {} points, no point {index}", points.len()));
    let place = usize::try_from(index).ok().filter(|i| *i < points.len()).ok_or_else(absent)?;
    let position = points.world(place).ok_or_else(absent)?;
    let all = attributes.iter().zip(points.columns()).map(|(attribute, column)| {
        point_json(attribute, |element| Number::of_column(column, place * attribute.elements + element))
    });
    Ok(json!({ "position": position, "attributes": all.collect::<Vec<_>>() }))
}
