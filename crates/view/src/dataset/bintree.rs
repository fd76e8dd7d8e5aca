//! Binary trees: all points are in leaves.

use std::path::Path;
use std::sync::OnceLock;

use pointmill_format::bintree::Bintree;
use pointmill_format::{Aabb, Attribute, AttributeType, NodePoints, ReadError};
use serde_json::Value;

use super::octree::point_of;
use super::ranges::Attributes;
use super::request::PointsRequest;
use super::scene::{Scene, keys};
use crate::encode::{self, BoxRow, Unit};
use crate::refusal::Refusal;

/// Leaves whose values are looked at for ranges, evenly spread: the format has none.
const SAMPLED_LEAVES: usize = 8;

/// A binary tree that is open.
#[derive(Debug)]
pub(super) struct Leaves {
    tree: Bintree,
    /// Indices in preorder.
    leaves: Vec<u32>,
    attributes: OnceLock<Attributes>,
}

impl Leaves {
    pub(super) fn open(path: &Path) -> Result<Self, ReadError> {
        let tree = Bintree::open(path)?;
        let leaves = tree.leaves().collect();
        Ok(Self { tree, leaves, attributes: OnceLock::new() })
    }

    pub(super) fn scene(&self) -> Scene {
        let header = self.tree.header();
        let attributes = self.attributes().clone();
        Scene {
            kind: "bintree",
            format: "binary tree".to_owned(),
            name: header.name.clone(),
            points: Some(header.points),
            bounds: self.tree.node(0).map_or(Aabb::EMPTY, |root| root.bounds),
            projection: header.projection.clone(),
            has_colour: attributes.has_colour(),
            attributes,
            own: keys([("leaves", self.leaves.len().into())]),
        }
    }

    fn attributes(&self) -> &Attributes {
        self.attributes.get_or_init(|| {
            let class = Attribute::new("classification", AttributeType::Float32, 1);
            let extras = self.tree.header().record.extras().iter().map(|extra| extra.attribute.clone());
            let mut attributes = Attributes::new(std::iter::once(class).chain(extras).map(|a| (a, None)));
            let (count, mut points) = (self.leaves.len().min(SAMPLED_LEAVES), NodePoints::default());
            for i in 0..count {
                let leaf = self.leaves.get(i * self.leaves.len() / count);
                // a leaf that cannot be read is an error of the request for its points
                if leaf.is_some_and(|leaf| self.tree.read_leaf(*leaf, &mut points).is_ok()) {
                    attributes.sample(&points);
                }
            }
            attributes
        })
    }

    /// All leaves with their boxes.
    pub(super) fn nodes(&self) -> Vec<u8> {
        let row = |leaf: &u32| {
            let node = self.tree.node(*leaf);
            let points = node.map_or(0, |node| u32::try_from(node.count).unwrap_or(u32::MAX));
            let bounds = node.map_or(Aabb::EMPTY, |node| node.bounds);
            BoxRow { bounds, points, unit: *leaf, by_level: [0; 4] }
        };
        encode::boxes(self.leaves.iter().map(row))
    }

    /// The leaves of a request, and the most bytes of the answer.
    pub(super) fn find(&self, request: &PointsRequest) -> Result<(Vec<u32>, u64), Refusal> {
        if let Some(name) = &request.attribute {
            self.attributes().find(name)?;
        }
        let (mut leaves, mut cost) = (Vec::new(), 0u64);
        for name in &request.units {
            let (leaf, points) = self.leaf(name)?;
            cost = cost.saturating_add(encode::cost(points.div_ceil(request.every.max(1) as u64)));
            leaves.push(leaf);
        }
        Ok((leaves, cost))
    }

    pub(super) fn points(&self, leaves: &[u32], request: &PointsRequest) -> Result<Vec<u8>, Refusal> {
        let look = request.look(self.attributes())?;
        let (mut points, mut out) = (NodePoints::default(), Vec::new());
        for leaf in leaves {
            self.tree.read_leaf(*leaf, &mut points)?;
            encode::encode_unit(Unit { points: &points, may_round: false }, &look, &mut out);
        }
        Ok(out)
    }

    pub(super) fn point(&self, unit: &str, index: u64) -> Result<Value, Refusal> {
        let (leaf, _) = self.leaf(unit)?;
        let mut points = NodePoints::default();
        self.tree.read_leaf(leaf, &mut points)?;
        point_of(&points, &self.attributes().all, unit, index)
    }

    /// A leaf by its number, and its points.
    fn leaf(&self, name: &str) -> Result<(u32, u64), Refusal> {
        let shown: String = name.chars().take(40).collect();
        let number: u32 = name.parse().map_err(|_| Refusal::bad(format!("\"{shown}\" is no number of a leaf")))?;
        let found = self.tree.node(number).filter(|node| node.is_leaf());
        let node = found.ok_or_else(|| Refusal::absent(format!("node {number} is no leaf")))?;
        Ok((number, node.count))
    }
}
