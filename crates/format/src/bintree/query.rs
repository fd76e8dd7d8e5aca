//! Which leaves a renderer or a tool wants. All of it relies on boxes being what the format promises: unions of those
//! below.

use crate::{Aabb, Frustum, NodePoints, ReadError};

use super::camera::{Material, distance_range};
use super::{Bintree, Node};

impl Bintree {
    /// The leaves of which something may be in sight, in preorder.
    #[must_use]
    pub fn leaves_in_frustum(&self, frustum: &Frustum) -> Vec<u32> {
        let mut leaves = Vec::new();
        self.descend(Frustum::ALL, |index, node, planes| {
            let cut = frustum.cut(&node.bounds, planes);
            if cut.is_some() && node.is_leaf() {
                leaves.push(index);
            }
            cut
        });
        leaves
    }

    /// The leaves whose boxes touch `bounds` (closed), in preorder.
    #[must_use]
    pub fn leaves_in_box(&self, bounds: &Aabb) -> Vec<u32> {
        let mut leaves = Vec::new();
        self.descend((), |index, node, ()| {
            let touch = touch(&node.bounds, bounds);
            if touch && node.is_leaf() {
                leaves.push(index);
            }
            touch.then_some(())
        });
        leaves
    }

    /// Reads the leaves that touch `bounds` and reports every point in it (closed): leaf, the leaf's points, index
    /// among them. Leaves come in preorder, points as they are stored.
    ///
    /// # Errors
    /// As [`Self::read_leaf`]; points of earlier leaves were reported by then.
    pub fn points_in_box(
        &self,
        bounds: &Aabb,
        scratch: &mut NodePoints,
        mut report: impl FnMut(u32, &NodePoints, usize),
    ) -> Result<(), ReadError> {
        for leaf in self.leaves_in_box(bounds) {
            self.read_leaf(leaf, scratch)?;
            let inside = |i: &usize| scratch.world(*i).is_some_and(|p| bounds.contains(p));
            (0..scratch.len()).filter(inside).for_each(|i| report(leaf, scratch, i));
        }
        Ok(())
    }

    /// What to draw from `camera` and how: leaves in preorder, those out of sight of `frustum`, if there is one, omitted.
    ///
    /// `switch_distance`: see [`super::switch_distance`]. One pass over the part of the tree that is in sight; below a
    /// node that is far or near as a whole nothing is measured.
    #[must_use]
    pub fn draw_list(&self, camera: [f64; 3], switch_distance: f64, frustum: Option<&Frustum>) -> Vec<(u32, Material)> {
        let mut list = Vec::new();
        self.descend((Frustum::ALL, Material::Both), |index, node, (planes, material)| {
            let planes = match frustum {
                Some(frustum) => frustum.cut(&node.bounds, planes)?,
                None => planes,
            };
            let material = match material {
                Material::Both => Material::choose(distance_range(&node.bounds, camera), switch_distance),
                decided => decided,
            };
            if node.is_leaf() {
                list.push((index, material));
            }
            Some((planes, material))
        });
        list
    }

    /// Visits nodes in preorder. `visit` gets what it gave for the parent (at the root `state`), and gives what its
    /// children get, or nothing if they are not to be visited.
    fn descend<S: Copy>(&self, state: S, mut visit: impl FnMut(u32, &Node, S) -> Option<S>) {
        let mut stack = vec![(0, state)];
        while let Some((index, state)) = stack.pop() {
            let Some(node) = self.node(index) else { continue };
            let Some(state) = visit(index, node, state) else { continue };
            if let Some([low, high]) = self.children(index) {
                stack.extend([(high, state), (low, state)]);
            }
        }
    }
}

fn touch(a: &Aabb, b: &Aabb) -> bool {
    (0..3).all(|i| a.min[i] <= b.max[i] && b.min[i] <= a.max[i])
}
