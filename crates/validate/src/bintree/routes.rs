//! Where single precision is too coarse for the lattice, integers do not come back from the leaves. But planes and centers
//! show which leaf a source's point belongs to, and which offsets have to be stored for it: these are compared then.

use pointmill_format::Lattice;
use pointmill_format::bintree::NodeKind;

use super::precision;
use super::tree::Tree;
use crate::against::rules::StoredPositions;

/// How to go on from a node.
#[derive(Debug, Clone, Copy)]
enum Route {
    Split {
        axis: u8,
        plane: f64,
        high: u32,
    },
    /// A leaf, or a place whose points are cut by number: all its leaves have one center.
    Center([f64; 3]),
}

/// The planes and centers of a tree, about 40 bytes per node.
#[derive(Debug)]
pub(super) struct Routes {
    lattice: Lattice,
    routes: Vec<Route>,
}

impl Routes {
    pub(super) fn new(tree: &Tree<'_>) -> Self {
        let mut routes: Vec<Route> = Vec::with_capacity(tree.nodes().len());
        for (index, node) in tree.indexed() {
            routes.push(match node.kind {
                NodeKind::Inner { axis, split, high } => Route::Split { axis, plane: split, high },
                NodeKind::Leaf { center, .. } => Route::Center(center),
                NodeKind::Degenerate { .. } => Route::Center(tree.first_center(index)),
            });
        }
        Self { lattice: tree.header().lattice, routes }
    }

    /// True if neighbours on the lattice have different world coordinates, so that planes separate them.
    pub(super) fn are_certain(tree: &Tree<'_>) -> bool {
        let lattice = tree.header().lattice;
        let Some(root) = tree.nodes().first() else { return true };
        (0..3).all(|axis| {
            let magnitude = [root.bounds.min[axis], root.bounds.max[axis], lattice.offset[axis]];
            let magnitude = magnitude.into_iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            precision::bound(0.0, magnitude) < lattice.scale[axis]
        })
    }

    /// The leaf that a lattice point belongs to, or the topmost node of its place.
    fn leaf(&self, world: [f64; 3]) -> (usize, [f64; 3]) {
        let mut at = 0;
        loop {
            match self.routes.get(at) {
                Some(Route::Split { axis, plane, high }) => {
                    at = if world[usize::from(*axis)] <= *plane { at + 1 } else { *high as usize };
                }
                Some(Route::Center(center)) => return (at, *center),
                None => return (at, [0.0; 3]),
            }
        }
    }

    /// The node that stands for a leaf: itself, or the topmost of its place.
    pub(super) fn node_of_leaf(tree: &Tree<'_>, mut index: u32) -> u32 {
        while let Some((above, parent)) = tree.parent(index)
            && matches!(parent.kind, NodeKind::Degenerate { .. })
        {
            index = above;
        }
        index
    }
}

/// A node and three offsets as words.
pub(super) fn words(node: usize, offsets: [f32; 3]) -> [i64; 3] {
    // adding 0 makes −0 a 0
    let [x, y, z] = offsets.map(|d| i64::from((d + 0.0).to_bits()));
    [(node as i64) << 32 | x, y, z]
}

impl StoredPositions for Routes {
    fn stored(&self, step: [i64; 3]) -> [i64; 3] {
        let world = self.lattice.world(step);
        let (node, center) = self.leaf(world);
        words(node, [0, 1, 2].map(|a| (world[a] - center[a]) as f32))
    }

    fn world(&self, stored: [i64; 3]) -> [f64; 3] {
        let center = match self.routes.get((stored[0] >> 32) as usize) {
            Some(Route::Center(center)) => *center,
            _ => [0.0; 3],
        };
        [0, 1, 2].map(|a| center[a] + f64::from(f32::from_bits(stored[a] as u32)))
    }
}
