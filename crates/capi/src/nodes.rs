//! Nodes: octree nodes, nodes of a binary tree, batches.

use std::ffi::{CString, c_char};
use std::mem::MaybeUninit;

use pointmill_format::bintree::{NodeKind, distance_range};
use pointmill_format::{Aabb, batches::BatchRecord};

use crate::border::{buffer, corner, fill, given, put, put_text};
use crate::dataset::{Content, PM_NO_NODE, PmDataset};
use crate::info::PmBox;
use crate::status::{Fault, Outcome, PmStatus, c_text, guard};

/// What is below the node is in a chunk of the hierarchy that was not read yet: pm_load().
pub const PM_NODE_PROXY: u32 = 1;

/// The node has no children.
pub const PM_NODE_LEAF: u32 = 2;

/// The node has points of its own: every node of an octree but a proxy, leaves of a binary tree, batches.
pub const PM_NODE_DRAWABLE: u32 = 4;

/// A node. Numbers stay the same as long as the handle is open.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PmNode {
    /// Its number. Octrees and binary trees: the root is 0, further numbers of a binary tree are in preorder. Batches: the
    /// slot in the file.
    pub id: u32,
    /// Number of its parent; PM_NO_NODE of a root and of batches.
    pub parent: u32,
    /// 0 of a root and of batches.
    pub level: u32,
    /// PM_NODE_PROXY, PM_NODE_LEAF, PM_NODE_DRAWABLE.
    pub flags: u32,
    /// Points of the node alone; of an inner node of a binary tree: of its leaves; of a proxy: 0.
    pub points: u64,
    /// Octrees: the node's cube. Else: the tight box of its points.
    pub bounds: PmBox,
    /// Octrees: distance between points in inner nodes of this level, world units. Else 0.
    pub spacing: f64,
    /// A place in the middle, as an origin for positions in single precision; of a leaf of a binary tree the one that its
    /// records are relative to.
    pub center: [f64; 3],
}

impl PmDataset {
    pub(crate) fn node_count(&self) -> u32 {
        match &self.content {
            Content::Octree(tree) => tree.len(),
            Content::Bintree(leaves) => leaves.tree.nodes().len() as u32,
            Content::Batches(batches) => batches.header().batches,
        }
    }

    pub(crate) fn no_node(&self, id: u32) -> Fault {
        Fault::argument(format!("node {id} was requested, {} are known", self.node_count()))
    }

    /// The box of a node, in the axes of the file.
    pub(crate) fn node_bounds(&self, id: u32) -> Outcome<Aabb> {
        let bounds = match &self.content {
            Content::Octree(tree) => tree.node(id).map(|(node, _)| tree.octree.info().node_box(node.key)),
            Content::Bintree(leaves) => leaves.tree.node(id).map(|node| node.bounds),
            Content::Batches(batches) => batches.records().get(id as usize).map(|r| record_bounds(batches, r)),
        };
        bounds.ok_or_else(|| self.no_node(id))
    }

    fn node(&self, id: u32) -> Outcome<PmNode> {
        let bounds = self.node_bounds(id)?;
        let mut center = bounds.center();
        let mut out = PmNode {
            id,
            parent: PM_NO_NODE,
            level: 0,
            flags: PM_NODE_LEAF | PM_NODE_DRAWABLE,
            points: 0,
            bounds: self.axes.bounds(&bounds).into(),
            spacing: 0.0,
            center: [0.0; 3],
        };
        match &self.content {
            Content::Octree(tree) => {
                let (node, parent) = tree.node(id).ok_or_else(|| self.no_node(id))?;
                out.parent = parent.unwrap_or(PM_NO_NODE);
                out.level = node.key.level.into();
                out.spacing = tree.octree.info().spacing_at(node.key.level);
                if node.is_proxy {
                    out.flags = PM_NODE_PROXY;
                } else {
                    out.flags = PM_NODE_DRAWABLE | if node.child_mask == 0 { PM_NODE_LEAF } else { 0 };
                    out.points = tree.octree.count(&node)?;
                }
            }
            Content::Bintree(leaves) => {
                let node = leaves.tree.node(id).ok_or_else(|| self.no_node(id))?;
                (out.parent, out.level) = leaves.places.get(id as usize).copied().unwrap_or((PM_NO_NODE, 0));
                out.points = node.count;
                match node.kind {
                    NodeKind::Leaf { center: of_leaf, .. } => center = of_leaf,
                    _ => out.flags = 0,
                }
            }
            Content::Batches(batches) => {
                out.points = batches.records().get(id as usize).map_or(0, |record| record.points.into());
            }
        }
        out.center = self.axes.outward(center);
        Ok(out)
    }

    fn name(&self, id: u32) -> Outcome<CString> {
        let name = match &self.content {
            Content::Octree(tree) => tree.node(id).map(|(node, _)| node.key.to_string()),
            Content::Bintree(leaves) => leaves.tree.node(id).map(|_| format!("n{}", leaves.tree.path(id))),
            Content::Batches(batches) => batches.records().get(id as usize).map(|_| id.to_string()),
        };
        name.map(c_text).ok_or_else(|| self.no_node(id))
    }

    /// An octree, or the fault of asking another kind for `what`.
    pub(crate) fn octree(&self, what: &str) -> Outcome<&crate::octree::Tree> {
        match &self.content {
            Content::Octree(tree) => Ok(tree),
            _ => Err(self.other_kind(what)),
        }
    }
}

/// World coordinates, axes of the file.
pub(crate) fn record_bounds<B: AsRef<[u8]>>(
    batches: &pointmill_format::batches::Batches<B>,
    record: &BatchRecord,
) -> Aabb {
    Aabb { min: batches.world(record.min.map(f64::from)), max: batches.world(record.max.map(f64::from)) }
}

/// Node `id`. Of Potree 1.x this may look at the size of the node's file.
///
/// `*node` is overwritten. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_node(dataset: Option<&PmDataset>, id: u32, node: Option<&mut MaybeUninit<PmNode>>) -> PmStatus {
    guard(|| put(node, "node", given(dataset, "dataset")?.node(id)?))
}

/// The nodes from number `first` on, in the order of their numbers: `count` of them into `nodes`, which has room for as
/// many. PmInfo::nodes says how many are known. Any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_nodes(dataset: Option<&PmDataset>, first: u32, count: u32, nodes: *mut PmNode) -> PmStatus {
    guard(|| {
        let dataset = given(dataset, "dataset")?;
        // SAFETY: the caller's promise
        let out = unsafe { buffer(nodes, count as usize, "nodes") }?;
        let end = first.checked_add(count).filter(|end| *end <= dataset.node_count());
        let end = end.ok_or_else(|| dataset.no_node(first.saturating_add(count.saturating_sub(1))))?;
        let found = (first..end).map(|id| dataset.node(id)).collect::<Outcome<Vec<_>>>()?;
        fill(out, found.len(), found.into_iter(), "nodes")
    })
}

/// The children of node `id` that are known: their numbers in `children`, which has room for 8, and in `*count` how many
/// these are (a binary tree: 0 or 2, the low side first; batches: 0; a proxy: 0). Any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_children(
    dataset: Option<&PmDataset>,
    id: u32,
    children: *mut u32,
    count: Option<&mut MaybeUninit<u32>>,
) -> PmStatus {
    guard(|| {
        let dataset = given(dataset, "dataset")?;
        dataset.node_bounds(id)?;
        let found = match &dataset.content {
            Content::Octree(tree) => tree.children(id),
            Content::Bintree(leaves) => leaves.tree.children(id).into_iter().flatten().collect(),
            Content::Batches(_) => Vec::new(),
        };
        // SAFETY: the caller's promise
        let out = unsafe { buffer(children, 8, "children") }?;
        put(count, "count", found.len() as u32)?;
        fill(out, found.len(), found.into_iter(), "children")
    })
}

/// The name of node `id`: "r042" of an octree, "n0101" of a binary tree, the slot of a batch; UTF-8 with a 0 at its end,
/// in `name`, which has room for `capacity` bytes. 520 are always enough. Any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_node_name(
    dataset: Option<&PmDataset>,
    id: u32,
    name: *mut c_char,
    capacity: usize,
) -> PmStatus {
    guard(|| {
        let text = given(dataset, "dataset")?.name(id)?;
        // SAFETY: the caller's promise; a char of C is a byte
        put_text(unsafe { buffer(name.cast::<u8>(), capacity, "name") }?, &text, "name")
    })
}

/// Octrees: if node `id` is a proxy, reads its chunk of the hierarchy, so that it and nodes below it become known. Does
/// nothing for other nodes and other kinds of datasets.
///
/// `*added`: how many nodes became known, at the end of the list; may be NULL. Reads from the disk; other threads can use
/// the handle meanwhile. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_load(dataset: Option<&PmDataset>, id: u32, added: Option<&mut MaybeUninit<u32>>) -> PmStatus {
    guard(|| {
        let dataset = given(dataset, "dataset")?;
        let found = match &dataset.content {
            Content::Octree(tree) => {
                let (node, _) = tree.node(id).ok_or_else(|| dataset.no_node(id))?;
                tree.load(&node)?
            }
            _ => dataset.node_bounds(id).map(|_| 0)?,
        };
        added.map_or(Ok(()), |added| put(Some(added), "added", found))
    })
}

/// Octrees: reads all chunks of the hierarchy. Ends with PM_STATUS_MEMORY when more than `most_nodes` are known (about
/// 150 bytes each). Does nothing for other kinds. Any thread.
#[unsafe(no_mangle)]
pub extern "C" fn pm_load_all(dataset: Option<&PmDataset>, most_nodes: u32) -> PmStatus {
    guard(|| match &given(dataset, "dataset")?.content {
        Content::Octree(tree) => tree.load_all(most_nodes),
        _ => Ok(()),
    })
}

/// D_min and D_max of node `id`: the distances from `eye` to the nearest point of its box (0 inside) and to its
/// farthest corner, world units. `eye`: 3 doubles. Any thread.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn pm_distances(
    dataset: Option<&PmDataset>,
    id: u32,
    eye: *const f64,
    d_min: Option<&mut MaybeUninit<f64>>,
    d_max: Option<&mut MaybeUninit<f64>>,
) -> PmStatus {
    guard(|| {
        let dataset = given(dataset, "dataset")?;
        // SAFETY: the caller's promise
        let eye = unsafe { corner(eye, "eye") }?.ok_or_else(|| Fault::null("eye"))?;
        let eye = dataset.axes.inward(eye);
        let [least, greatest] = distance_range(&dataset.node_bounds(id)?, eye);
        put(d_min, "d_min", least)?;
        put(d_max, "d_max", greatest)
    })
}
